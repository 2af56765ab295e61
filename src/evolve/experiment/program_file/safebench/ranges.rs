//! ChatScene: the ranges that it optimised, as those of our templates. Its forty behaviours are Scenic programs; a row of [`ROWS`] is
//! one that a behaviour of ours does, too, with what each of its numbers is here. The others are refused by name.
//!
//! Its places are counted from points of its own, ours from where the traffic family stands its road user: each row says how many
//! metres lie between. A row without a trigger waits until the ego is within 60 m, as ChatScene's programs do.

use std::collections::BTreeMap;

use super::{Made, Wanted, changed, family_of, of_list_of};
use crate::families::chatscene;
use crate::formats::ImportError;
use crate::formats::safebench::parameters::{OptimisedRanges, Range, behaviour_key, step_key};
use crate::kernel::num;
use crate::objects::{ParameterValue, Program, Setting};

/// A behaviour of ChatScene that one of ours does.
struct Row {
    scenario: usize,
    behaviour: usize,
    kind: &'static str,
    word: &'static str,
    /// Name of the distance at which the second phase begins.
    act: &'static str,
    /// Name of the distance that sets it off; none: 60 m.
    trigger: Option<&'static str>,
    /// Distance that is added to its place ahead, and to its place aside where it has one, metres.
    ahead_m: f64,
    aside_m: Option<f64>,
    /// Numbers of the Scenic program that no template has, with the ranges that ChatScene begins with.
    others: &'static [(&'static str, f64, f64)],
}

const THROTTLE: (&str, f64, f64) = ("OPT_THROTTLE", 0.5, 1.0);
const SLOW_SPEED: (&str, f64, f64) = ("OPT_SLOW_SPEED", 0.0, 2.0);
const LEADER: &[(&str, f64, f64)] = &[("OPT_LEADING_DISTANCE", 0.0, 30.0), ("OPT_LEADING_SPEED", 1.0, 5.0)];
const ADV: &str = "OPT_ADV_DISTANCE";
const STOP: &str = "OPT_STOP_DISTANCE";

const fn roadside(behaviour: usize) -> Row {
    Row {
        scenario: 1,
        behaviour,
        kind: "roadside",
        word: "intercept_and_stop",
        act: STOP,
        trigger: Some(ADV),
        ahead_m: -45.0,
        aside_m: Some(-3.5),
        others: &[],
    }
}

const fn turning(behaviour: usize) -> Row {
    Row { scenario: 2, kind: "turning", ahead_m: 0.0, ..roadside(behaviour) }
}

const fn crossing(scenario: usize, behaviour: usize, others: &'static [(&'static str, f64, f64)]) -> Row {
    Row {
        scenario,
        behaviour,
        kind: "crossing",
        word: "rush_and_stop",
        act: STOP,
        trigger: None,
        ahead_m: 0.0,
        aside_m: None,
        others,
    }
}

const fn lane_change(behaviour: usize, word: &'static str) -> Row {
    Row { kind: "lane_change", word, act: ADV, ahead_m: -36.0, ..crossing(3, behaviour, LEADER) }
}

/// The first of a scenario and word is the one that is written.
const ROWS: &[Row] = &[
    roadside(1),
    roadside(2),
    roadside(4),
    roadside(5),
    turning(2),
    turning(3),
    turning(4),
    turning(5),
    lane_change(1, "cut_in"),
    lane_change(3, "stop_before"),
    lane_change(4, "weave"),
    Row {
        kind: "passing",
        word: "speed_up",
        act: ADV,
        ahead_m: -30.0,
        aside_m: Some(3.5),
        ..crossing(4, 4, &[("OPT_GEO_BLOCKER_Y_DISTANCE", 0.0, 20.0), THROTTLE])
    },
    crossing(5, 1, &[THROTTLE]),
    crossing(5, 5, &[]),
    Row { kind: "oncoming", word: "slow_block", act: "OPT_SLOW_DISTANCE", ..crossing(6, 5, &[SLOW_SPEED]) },
    crossing(7, 1, &[THROTTLE]),
    crossing(8, 1, &[THROTTLE]),
    crossing(8, 2, &[THROTTLE]),
    crossing(8, 3, &[]),
    crossing(8, 4, &[]),
];
/// ChatScene's programs wait until the ego is as near as this, metres.
const WAITS_M: f64 = 60.0;
/// ChatScene's routes.
const ROUTES: u32 = 10;
/// Decimals of what is written.
const DECIMALS: u32 = 9;

impl Row {
    /// Its numbers: name in the file, name here, what is added.
    fn numbers(&self) -> Vec<(&'static str, &'static str, f64)> {
        let aside = self.aside_m.map(|m| ("OPT_GEO_X_DISTANCE", "aside_m", m));
        let trigger = self.trigger.map(|name| (name, "trigger_m", 0.0));
        let always = [
            ("OPT_GEO_Y_DISTANCE", "ahead_m", self.ahead_m),
            ("OPT_ADV_SPEED", "speed_mps", 0.0),
            (self.act, "act_within_m", 0.0),
        ];
        always.into_iter().chain(aside).chain(trigger).collect()
    }

    fn parameter(&self, drawn: &str, end: &str) -> String {
        format!("{}_{drawn}_{end}", self.kind)
    }
}

/// The program with the ranges of one behaviour on one route.
pub fn made(file: &str, all: &OptimisedRanges, wanted: &Wanted) -> Result<Made, ImportError> {
    let named = file.strip_prefix("scenario_").and_then(|rest| rest.strip_suffix(".json")).and_then(|n| n.parse().ok());
    let traffic = family_of(file, wanted.scenario.or(named))?;
    let (behaviour, route) = (wanted.behaviour.unwrap_or(1), wanted.route.unwrap_or(0));
    let key = behaviour_key(behaviour, route);
    let steps = all.get(&key).ok_or_else(|| {
        ImportError::new(
            file,
            "the top",
            format!("an entry {key}, found none"),
            "name others: --behaviour 1 to 5, --route NUMBER",
        )
    })?;
    let own = || ROWS.iter().filter(|row| row.scenario == traffic.number());
    let row = own().find(|row| row.behaviour == behaviour).ok_or_else(|| {
        let here = of_list_of(own().map(|row| row.behaviour));
        let expected = format!("a behaviour that a template here does ({here}), found behaviour {behaviour}");
        ImportError::new(file, format!("scenario {}", traffic.number()), expected, "name one of them with --behaviour")
    })?;
    let last = steps.keys().filter_map(|name| name.strip_prefix("opt_time_")?.parse().ok()).max().unwrap_or(0);
    let step = step_key(wanted.step.unwrap_or(last));
    let ranges = steps.get(&step).ok_or_else(|| {
        ImportError::new(file, key.as_str(), format!("{step}, found steps up to {last}"), "name one with --step")
    })?;
    let mut values = BTreeMap::new();
    for (name, drawn, added) in row.numbers() {
        let range = ranges.get(name).ok_or_else(|| {
            ImportError::new(file, format!("{key}, {step}"), format!("a range {name}"), "take ChatScene's own file")
        })?;
        values.insert(row.parameter(drawn, "low"), range.low + added);
        values.insert(row.parameter(drawn, "high"), range.high + added);
    }
    if row.trigger.is_none() {
        values.extend(["low", "high"].map(|end| (row.parameter("trigger_m", end), WAITS_M)));
    }
    let words = BTreeMap::from([(format!("{}_behaviour", row.kind), row.word.to_string())]);
    let known: Vec<&str> = row.numbers().into_iter().map(|(name, _, _)| name).collect();
    let other: Vec<&str> = ranges.keys().map(String::as_str).filter(|name| !known.contains(name)).collect();
    let mut notes = vec![format!("{key}, {step}: the template {} with {}", row.kind, row.word)];
    if !other.is_empty() {
        notes.push(format!("no template has these, so they are not played: {}", other.join(", ")));
    }
    Ok(Made { file: changed(file, chatscene::NAME, values, &words, BTreeMap::new())?, notes })
}

/// The ranges of a program, scenario by scenario, and why other templates have no such form.
///
/// # Errors
/// Why none has.
pub fn written(program: &Program) -> Result<(BTreeMap<usize, OptimisedRanges>, Vec<String>), String> {
    if !program.scenario_conditioned_policy.is_empty() || !program.mechanism_modules.is_empty() {
        return Err("it has rules or expressions of its own, and ChatScene's ranges have none".into());
    }
    let (mut all, mut notes) = (BTreeMap::new(), Vec::new());
    for scenario in 1..=8 {
        match of_scenario(program, scenario) {
            Ok(ranges) => drop(all.insert(scenario, ranges)),
            Err(reason) => notes.push(format!("scenario {scenario}: {reason}")),
        }
    }
    if all.is_empty() { Err(notes.join("; ")) } else { Ok((all, notes)) }
}

fn of_scenario(program: &Program, scenario: usize) -> Result<OptimisedRanges, String> {
    let own = || ROWS.iter().filter(|row| row.scenario == scenario);
    let kind = own().next().map_or("", |row| row.kind);
    let setting = format!("{kind}_behaviour");
    let word = program.operator_graph.values().find_map(|node| match node.settings.get(&setting) {
        Some(Setting::Choice(word)) => Some(word.as_str()),
        _ => None,
    });
    let word = word.unwrap_or("nothing");
    let row = own().find(|row| row.word == word);
    let row = row.ok_or_else(|| format!("no program of ChatScene does {word} there"))?;
    let bounds = |drawn: &str| {
        let value = |end| match program.parameters.get(&row.parameter(drawn, end)) {
            Some(ParameterValue::Number(value)) => Ok(*value),
            _ => Err(format!("{} is no number", row.parameter(drawn, end))),
        };
        // The family itself takes the two ends in either order.
        let (one, other) = (value("low")?, value("high")?);
        Ok::<_, String>((one.min(other), one.max(other)))
    };
    if row.trigger.is_none() && bounds("trigger_m")? != (WAITS_M, WAITS_M) {
        let (low, high) = bounds("trigger_m")?;
        return Err(format!("it is set off at {low} to {high} m, and ChatScene's program waits for {WAITS_M} m"));
    }
    let mut ranges = BTreeMap::new();
    for (name, drawn, added) in row.numbers() {
        let (low, high) = bounds(drawn)?;
        let [low, high] = [low, high].map(|x| num::rounded(x - added, DECIMALS));
        ranges.insert(name.to_string(), Range { low, high });
    }
    ranges.extend(row.others.iter().map(|(name, low, high)| (name.to_string(), Range { low: *low, high: *high })));
    let steps = BTreeMap::from([(step_key(0), ranges)]);
    Ok((0..ROUTES).map(|route| (behaviour_key(row.behaviour, route), steps.clone())).collect())
}
