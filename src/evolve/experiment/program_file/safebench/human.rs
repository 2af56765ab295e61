//! Human: lists of hand-chosen parameters, as a grid around a middle or as one member.

use std::collections::BTreeMap;

use super::{Made, Wanted, by_route, changed, chosen};
use crate::families::{human, staged};
use crate::formats::ImportError;
use crate::formats::safebench::parameters::{Entry, Parameters};
use crate::kernel::num;
use crate::objects::{ParameterValue, Program};
use crate::scene::safebench::TrafficFamily;

/// Decimals to which a written parameter is rounded: what arithmetic adds lies far below.
const DECIMALS: u32 = 9;

/// Names in θ of a traffic family's parameters, in SafeBench's order.
fn names(family: TrafficFamily) -> Vec<String> {
    staged::scenario_parameters().filter(|(of, _, _)| *of == family).map(|(of, _, p)| human::name(of, p)).collect()
}

/// The program of a list: its whole grid, or one member of each scenario's.
pub fn made(file: &str, entries: &[Entry], wanted: &Wanted) -> Result<Made, ImportError> {
    let mut values = BTreeMap::new();
    let note = match wanted.take {
        Some(take) => {
            for (family, (_, entry)) in chosen(file, entries, take as usize, wanted.route)? {
                put(&mut values, family, &numbers(file, entry)?);
            }
            values.insert("grid_reach".to_string(), 0.0);
            format!("entry {take} of each scenario alone (grid_reach = 0)")
        }
        None => whole(file, entries, wanted, &mut values)?,
    };
    let here = |family: &TrafficFamily| entries.iter().any(|entry| entry.scenario_id == family.number());
    let absent: Vec<&str> =
        TrafficFamily::ALL.iter().filter(|family| !here(family)).map(|family| family.name()).collect();
    let mut notes = vec![note];
    if !absent.is_empty() {
        notes.push(format!("not in the file, so as in the published parent: {}", absent.join(", ")));
    }
    Ok(Made { file: changed(file, human::NAME, values, &BTreeMap::new(), BTreeMap::new())?, notes })
}

/// The grid that the whole list is.
fn whole(
    file: &str,
    entries: &[Entry],
    wanted: &Wanted,
    values: &mut BTreeMap<String, f64>,
) -> Result<String, ImportError> {
    let mut first: BTreeMap<TrafficFamily, (u32, Vec<Vec<f64>>)> = BTreeMap::new();
    for ((family, route), members) in by_route(entries) {
        if wanted.route.is_some_and(|named| named != route) {
            continue;
        }
        let members = members.into_iter().map(|entry| numbers(file, entry)).collect::<Result<Vec<_>, _>>()?;
        match first.get(&family) {
            None => drop(first.insert(family, (route, members))),
            Some((_, before)) if *before == members => {}
            Some((other, _)) => {
                let place = format!("scenario {}, route {route}", family.number());
                let expected =
                    format!("the entries of route {other}, found others: a program has one grid for all routes");
                return Err(ImportError::new(
                    file,
                    place,
                    expected,
                    "name one route, --route NUMBER, and one entry, --take NUMBER",
                ));
            }
        }
    }
    let mut reach: Option<(f64, TrafficFamily)> = None;
    for (family, (_, members)) in &first {
        let place = format!("scenario {}", family.number());
        let refuse =
            |expected: String| ImportError::new(file, place.as_str(), expected, "take one entry: --take NUMBER");
        let (middles, own) = human::grid_of(*family, members).map_err(refuse)?;
        put(values, *family, &middles);
        match reach {
            None => reach = Some((own, *family)),
            Some((known, _)) if (known - own).abs() <= 1e-8 => {}
            Some((known, other)) => {
                return Err(refuse(format!(
                    "a grid that reaches {known} times as far as the published one, as that of scenario {}, found {own}",
                    other.number()
                )));
            }
        }
    }
    let Some((reach, _)) = reach else {
        return Err(ImportError::new(
            file,
            "the list",
            "entries of that route, found none",
            "name a route that it holds",
        ));
    };
    values.insert("grid_reach".into(), num::rounded(reach, DECIMALS));
    Ok(format!("the whole grid, {reach} times as far as the published one"))
}

fn put(values: &mut BTreeMap<String, f64>, family: TrafficFamily, numbers: &[f64]) {
    values.extend(names(family).into_iter().zip(numbers.iter().copied()));
}

fn numbers(file: &str, entry: &Entry) -> Result<Vec<f64>, ImportError> {
    let wanted = TrafficFamily::of_number(entry.scenario_id).map_or(0, |family| names(family).len());
    match &entry.parameters {
        Parameters::Numbers(numbers) if numbers.len() == wanted => Ok(numbers.clone()),
        other => {
            let found = match other {
                Parameters::Numbers(numbers) => numbers.len().to_string(),
                _ => "something else".into(),
            };
            let expected = format!("{wanted} numbers for scenario {}, found {found}", entry.scenario_id);
            Err(ImportError::new(file, format!("data_id {}", entry.data_id), expected, "take the benchmark's list"))
        }
    }
}

/// The list of a program: every member of its grid on every route, in the benchmark's order.
///
/// # Errors
/// Why the program has no such form.
pub fn entries(program: &Program, parent: &Program, routes: &[u32]) -> Result<Vec<Entry>, String> {
    if !program.scenario_conditioned_policy.is_empty() {
        return Err("it sets parameters by rules, scene by scene, and a list of SafeBench has none".into());
    }
    if program.operator_graph != parent.operator_graph || !program.mechanism_modules.is_empty() {
        return Err(
            "it chooses among its scenarios by operators or expressions of its own, and a list of SafeBench has none"
                .into(),
        );
    }
    let value = |name: &str| match program.parameters.get(name) {
        Some(ParameterValue::Number(value)) => Ok(*value),
        _ => Err(format!("its parameter {name} is no number")),
    };
    let mut all = Vec::new();
    for family in TrafficFamily::ALL {
        let middles = names(family).iter().map(|name| value(name)).collect::<Result<Vec<_>, _>>()?;
        let members = human::grid(family, &middles, value("grid_reach")?);
        for route_id in routes {
            for member in &members {
                let numbers = member.iter().map(|x| num::rounded(*x, DECIMALS)).collect();
                all.push(Entry {
                    data_id: u32::try_from(all.len()).unwrap_or(u32::MAX),
                    scenario_folder: human::NAME.into(),
                    scenario_id: family.number(),
                    route_id: *route_id,
                    risk_level: None,
                    parameters: Parameters::Numbers(numbers),
                });
            }
        }
    }
    Ok(all)
}
