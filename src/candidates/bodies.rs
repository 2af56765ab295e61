//! Bodies: what sort of road user a program inserts belongs to its parent, where the run says so. A car with a cyclist's box gains
//! realism by the bounds of cyclists and meets the ego as a car would; that is no better generator.

use std::collections::{BTreeMap, BTreeSet};

use crate::adapters::Problem;
use crate::objects::{ParameterValue, Program, Setting, Slot};

/// The setting of an actor operator that names a body.
const BODY: &str = "shape";

/// The bodies of the child that its parent never inserts.
pub fn check(parent: &Program, child: &Program) -> Vec<Problem> {
    let known = bodies(parent);
    let fresh = bodies(child).into_iter().filter(|body| !known.contains(body));
    let expected = || known.iter().map(|body| format!("`{body}`")).collect::<Vec<_>>().join(" or ");
    fresh
        .map(|body| {
            let place = format!("/operator_graph, setting `{BODY}` of an actor");
            Problem::new(
                &place,
                format!("`{body}`"),
                format!("{}, as the parent has: bodies are fixed in this run", expected()),
            )
        })
        .collect()
}

/// Everything that a body setting can be in some scene: of the graph, of the rules that override it, and of the parameters that any of
/// them reads, with their overrides.
fn bodies(program: &Program) -> BTreeSet<String> {
    let actors: Vec<&String> =
        program.operator_graph.iter().filter(|(_, node)| node.slot == Slot::Actor).map(|(name, _)| name).collect();
    let written = program.operator_graph.values().filter(|node| node.slot == Slot::Actor).map(|node| &node.settings);
    let overridden = program
        .scenario_conditioned_policy
        .iter()
        .flat_map(|rule| rule.operators.iter().filter(|(node, _)| actors.contains(node)).map(|(_, settings)| settings));
    written.chain(overridden).filter_map(|settings| settings.get(BODY)).flat_map(|body| words(program, body)).collect()
}

fn words(program: &Program, body: &Setting) -> Vec<String> {
    let word = |value: &ParameterValue| match value {
        ParameterValue::Number(number) => number.to_string(),
        ParameterValue::Choice(word) => word.clone(),
    };
    match body {
        Setting::Choice(word) => vec![word.clone()],
        Setting::Number(number) => vec![number.to_string()],
        Setting::Mechanism(module) => vec![format!("module {}", module.mechanism)],
        Setting::Parameter(of) => {
            let at = |parameters: &BTreeMap<String, ParameterValue>| parameters.get(&of.parameter).map(word);
            let rules = program.scenario_conditioned_policy.iter().map(|rule| &rule.parameters);
            std::iter::once(&program.parameters).chain(rules).filter_map(at).collect()
        }
    }
}
