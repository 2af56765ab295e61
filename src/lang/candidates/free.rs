//! Free constants of a patch: the ranges in which a numeric search may set them.

use std::collections::BTreeMap;

use crate::adapters::{Contract, Domain, Problem};
use crate::kernel::{Stream, num};
use crate::objects::{FREE_SIGN, FreeConstant, Operation, Pointer, Program, ProgramPatch};

/// Most free constants of a patch: with more a search of a few draws says nothing of any.
const FREE_MAX: usize = 8;
/// Decimals of a drawn value.
const DECIMALS: u32 = 4;
/// Spread of a draw near the start, as a share of the range.
const NEAR: f64 = 0.15;

/// The range of a free constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeRange {
    /// Smallest value, in the unit of its place.
    pub low: f64,
    /// Largest value, likewise.
    pub high: f64,
    /// The first value that is tried.
    pub start: f64,
    /// True if the place takes whole numbers alone.
    pub whole: bool,
}

impl FreeRange {
    /// Draws a value: anywhere in the range, or near the start.
    pub fn draw(&self, near: bool, stream: &mut Stream) -> f64 {
        let FreeRange { low, high, start, whole } = *self;
        let value = if near { stream.normal(start, NEAR * (high - low)) } else { stream.uniform(low, high) };
        num::rounded(value, if whole { 0 } else { DECIMALS }).clamp(low, high)
    }
}

/// Returns the range of each free constant of a patch.
///
/// # Errors
/// What is wrong with them: a name that no value uses or that no constant has, bounds that are missing, crossed or beyond the contract's, a
/// start outside of them, too many constants.
pub fn free_ranges(
    parent: &Program,
    patch: &ProgramPatch,
    contract: &Contract,
) -> Result<BTreeMap<String, FreeRange>, Vec<Problem>> {
    let mut problems = Vec::new();
    let used = patch.constants_used();
    if patch.free.len() > FREE_MAX {
        problems.push(Problem::new(
            "patch/free",
            format!("{} constants", patch.free.len()),
            format!("at most {FREE_MAX}"),
        ));
    }
    for name in used.iter().filter(|name| !patch.free.contains_key(*name)) {
        let found = format!("{FREE_SIGN}{name} in a value");
        problems.push(Problem::new("patch/free", found, "an entry of that name with its start, low and high"));
    }
    let mut ranges = BTreeMap::new();
    for (name, free) in &patch.free {
        if !used.contains(name) {
            let found = format!("{name}, which no value uses");
            problems.push(Problem::new("patch/free", found, format!("{FREE_SIGN}{name} in a value of an operation")));
            continue;
        }
        match range(parent, patch, contract, name, free) {
            Ok(range) => drop(ranges.insert(name.clone(), range)),
            Err(problem) => problems.push(problem),
        }
    }
    if problems.is_empty() { Ok(ranges) } else { Err(problems) }
}

fn range(
    parent: &Program,
    patch: &ProgramPatch,
    contract: &Contract,
    name: &str,
    free: &FreeConstant,
) -> Result<FreeRange, Problem> {
    let place = format!("patch/free/{name}");
    let whole_value = format!("{FREE_SIGN}{name}");
    let domains =
        patch.operations.iter().filter(|of| of.value.as_ref().is_some_and(|value| *value == whole_value.as_str()));
    // The narrowest of its places binds.
    let (mut low, mut high, mut whole) = (f64::NEG_INFINITY, f64::INFINITY, false);
    for domain in domains.filter_map(|operation| domain(parent, contract, operation)) {
        let (least, most) = match *domain {
            Domain::Number { low, high, .. } => (low, high),
            Domain::Integer { low, high, .. } => (low as f64, high as f64),
            Domain::Choice { .. } | Domain::Mechanism { .. } => {
                return Err(Problem::new(place, "a place for a word", "free constants in places for numbers"));
            }
        };
        whole |= matches!(domain, Domain::Integer { .. });
        (low, high) = (low.max(least), high.min(most));
    }
    let bounds = (free.low.map_or(low, |own| own.max(low)), free.high.map_or(high, |own| own.min(high)));
    let (low, high) = if whole { (bounds.0.ceil(), bounds.1.floor()) } else { bounds };
    if !low.is_finite() || !high.is_finite() {
        return Err(Problem::new(place, "no bounds", "low and high: the contract has none for this place"));
    }
    if low >= high || !(low..=high).contains(&free.start) {
        let found = format!("start {} in {low} to {high}", free.start);
        return Err(Problem::new(place, found, "a start between low and high, which the contract may narrow"));
    }
    Ok(FreeRange { low, high, start: free.start, whole })
}

/// The domain of an operation's place, if it is a parameter or a setting of a node that the parent has.
fn domain<'c>(parent: &Program, contract: &'c Contract, operation: &Operation) -> Option<&'c Domain> {
    let pointer = Pointer::parse(&operation.path).ok()?;
    let tokens: Vec<&str> = pointer.tokens.iter().map(String::as_str).collect();
    match tokens.as_slice() {
        ["parameters", name] => Some(&contract.parameters.get(*name)?.domain),
        ["operator_graph", node, "settings", setting] => {
            let node = parent.operator_graph.get(*node)?;
            let spec = contract.operators.get(&node.slot)?.iter().find(|spec| spec.kind == node.kind)?;
            Some(&spec.settings.get(*setting)?.domain)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{add, patch};
    use super::*;
    use crate::adapters::toy;
    use crate::kernel::Seed;
    use serde_json::json;

    fn free(start: f64, low: Option<f64>, high: Option<f64>) -> FreeConstant {
        FreeConstant { start, low, high }
    }

    /// Ranges, or findings, of a patch with one operation.
    fn ranges(path: &str, value: serde_json::Value, names: &[(&str, FreeConstant)]) -> Result<Vec<FreeRange>, String> {
        let mut patch = patch(vec![add(path, value)]);
        patch.free = names.iter().map(|(name, free)| (name.to_string(), *free)).collect();
        let found = free_ranges(&toy::program(), &patch, &toy::contract());
        found.map(|of| of.into_values().collect()).map_err(|all| all.iter().map(|of| of.to_string() + "\n").collect())
    }

    #[test]
    fn a_constant_that_is_a_parameter_has_the_bounds_of_the_contract_or_narrower_ones() {
        let Domain::Number { low, high, .. } = toy::contract().parameters["gap_limit_m"].domain else {
            panic!("a number")
        };
        let middle = 0.5 * (low + high);
        let at =
            |start, low, high| ranges("/parameters/gap_limit_m", json!("$gap"), &[("gap", free(start, low, high))]);
        assert_eq!(at(middle, None, None).unwrap(), [FreeRange { low, high, start: middle, whole: false }]);
        assert_eq!(at(middle, Some(low - 1.0), Some(middle)).unwrap()[0].high, middle);
        assert_eq!(at(middle, Some(low - 1.0), Some(middle)).unwrap()[0].low, low);
        assert!(at(high + 1.0, None, None).unwrap_err().contains("patch/free/gap"));
        let whole = ranges("/parameters/push_count", json!("$n"), &[("n", free(2.0, None, None))]).unwrap();
        assert!(whole[0].whole);
    }

    #[test]
    fn what_is_wrong_with_free_constants_is_named() {
        let rule = json!({"when": "ego_speed_mps > $v"});
        let refused = |value: serde_json::Value, names: &[(&str, FreeConstant)]| {
            ranges("/scenario_conditioned_policy/-", value, names).unwrap_err()
        };
        assert!(refused(rule.clone(), &[]).contains("an entry of that name"));
        assert!(refused(rule.clone(), &[("v", free(3.0, None, None))]).contains("low and high"));
        let (low, high) = (Some(0.0), Some(9.0));
        let two = [("v", free(3.0, low, high)), ("w", free(3.0, low, high))];
        assert!(refused(rule.clone(), &two).contains("which no value uses"));
        assert!(refused(rule.clone(), &[("v", free(3.0, high, low))]).contains("start"));
        assert!(ranges("/parameters/style", json!("$s"), &[("s", free(1.0, low, high))]).unwrap_err().contains("word"));
        assert!(ranges("/scenario_conditioned_policy/-", rule, &two[..1]).is_ok());
    }

    #[test]
    fn draws_stay_in_the_range_and_near_ones_near_the_start() {
        let range = FreeRange { low: 0.0, high: 10.0, start: 8.0, whole: false };
        let mut stream = Seed(1).stream(&["test"]);
        let mut spread = |near: bool| {
            let draws: Vec<f64> = (0..400).map(|_| range.draw(near, &mut stream)).collect();
            assert!(draws.iter().all(|draw| (0.0..=10.0).contains(draw)));
            num::mean(&draws.iter().map(|draw| (draw - range.start).abs()).collect::<Vec<_>>()).unwrap()
        };
        let (far, near) = (spread(false), spread(true));
        assert!(near < 0.5 * far, "{near} {far}");
        let whole = FreeRange { whole: true, ..range };
        assert!((0..50).all(|_| whole.draw(true, &mut stream).fract() == 0.0));
    }
}
