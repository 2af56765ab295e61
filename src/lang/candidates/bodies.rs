//! Bodies: the sort of road user that a program inserts is its parent's, where the run says so. A car with a cyclist's box gains
//! realism by the bounds of cyclists and meets the ego as a car would; that is no better generator.

use std::collections::{BTreeMap, BTreeSet};

use crate::adapters::Problem;
use crate::objects::{BODY_SETTING, ParameterValue, Program, Setting, Slot};

/// The bodies of the child that its parent never inserts.
pub fn check(parent: &Program, child: &Program) -> Vec<Problem> {
    let known = bodies(parent);
    let fresh = bodies(child).into_iter().filter(|body| !known.contains(body));
    let expected = || known.iter().map(|body| format!("`{body}`")).collect::<Vec<_>>().join(" or ");
    fresh
        .map(|body| {
            let place = format!("/operator_graph, setting `{BODY_SETTING}` of an actor");
            Problem::new(
                &place,
                format!("`{body}`"),
                format!("{}, as the parent has: bodies are fixed in this run", expected()),
            )
        })
        .collect()
}

/// Returns every value that a body setting can have in some scene: of the graph, of the rules that override it, and of the parameters that
/// any of them reads, with their overrides.
fn bodies(program: &Program) -> BTreeSet<String> {
    let actors: Vec<&String> =
        program.operator_graph.iter().filter(|(_, node)| node.slot == Slot::Actor).map(|(name, _)| name).collect();
    let written = program.operator_graph.values().filter(|node| node.slot == Slot::Actor).map(|node| &node.settings);
    let overridden = program
        .scenario_conditioned_policy
        .iter()
        .flat_map(|rule| rule.operators.iter().filter(|(node, _)| actors.contains(node)).map(|(_, settings)| settings));
    written
        .chain(overridden)
        .filter_map(|settings| settings.get(BODY_SETTING))
        .flat_map(|body| words(program, body))
        .collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::{OperatorNode, ParameterRef, PolicyRule};

    /// The family's parent with the body read from a parameter, which a rule sets anew where `swap` says so.
    fn program(value: &str, swap: Option<&str>) -> Program {
        let family = crate::families::registry();
        let family = family.iter().find(|family| family.contract.family.as_str() == "adv_bmt");
        let mut program = family.map(|family| family.parent.clone()).unwrap();
        let body = Setting::Parameter(ParameterRef { parameter: "body".into() });
        let of_actor = |node: &&mut OperatorNode| node.slot == Slot::Actor;
        let actor = program.operator_graph.values_mut().find(of_actor).unwrap();
        actor.settings.insert(BODY_SETTING.into(), body);
        program.parameters.insert("body".into(), ParameterValue::Choice(value.into()));
        program.scenario_conditioned_policy.extend(swap.map(|to| PolicyRule {
            name: "swap".into(),
            when: "true".into(),
            parameters: BTreeMap::from([("body".into(), ParameterValue::Choice(to.into()))]),
            operators: BTreeMap::new(),
        }));
        program
    }

    #[test]
    fn a_body_that_a_parameter_names_is_followed_into_the_parameter_and_its_overrides() {
        let parent = program("vehicle", None);
        assert_eq!(check(&parent, &program("vehicle", Some("vehicle"))), []);
        for child in [program("cyclist", None), program("vehicle", Some("cyclist"))] {
            let problems = check(&parent, &child);
            assert!(problems.len() == 1 && problems[0].found == "`cyclist`", "{problems:?}");
        }
        // A child of a parent that inserts both may go on with either.
        assert_eq!(check(&program("vehicle", Some("cyclist")), &program("cyclist", None)), []);
    }
}
