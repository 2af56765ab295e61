//! Example patches in a prompt, made from the family's own contract and parent, so that every name in them exists: a
//! structural edit whose first operation has no effect without the others, and a rule.

use serde_json::{Value, json};

use super::json_text::{dense_json, lines};
use crate::adapters::{Contract, Domain, Feature, OperatorSpec, Port};
use crate::objects::{OperatorNode, Program, Setting, Slot, ValueType};

/// Fewest letters of a word by which a feature and a parameter are akin.
const KIN_LETTERS_MIN: usize = 4;

/// The operations of the examples as JSON text; `None` where the contract has no place for one.
pub struct Examples {
    /// A module, and what uses it.
    pub works: Option<String>,
    /// A rule that overrides a parameter and an operator's setting.
    pub rule: Option<String>,
}

/// Examples for a family.
pub fn examples(contract: &Contract, parent: &Program, compact: bool) -> Examples {
    let shown = |operations: Vec<Value>| {
        if compact { dense_json(&operations.into(), 1) } else { lines(&Value::from(operations)) }
    };
    Examples { works: guarded(contract, parent).map(shown), rule: rule(contract, parent).map(|rule| shown(vec![rule])) }
}

/// A filter with a guard of its own, put before the choice.
fn guarded(contract: &Contract, parent: &Program) -> Option<Vec<Value>> {
    let kinds = contract.operators.get(&Slot::Filter)?;
    let (kind, setting, slot) = kinds.iter().find_map(|kind| {
        let module = kind.settings.iter().find_map(|(name, setting)| match &setting.domain {
            Domain::Mechanism { slot } if setting.required => Some((name, slot)),
            _ => None,
        });
        module.map(|(name, slot)| (kind, name, slot))
    })?;
    let spec = contract.mechanism_slots.get(slot).filter(|spec| spec.output == ValueType::Boolean)?;
    let (feature, parameter) = akin(contract, &spec.features)?;
    let (consumer, source) = before_choice(contract, parent)?;
    let module = json!({
        "slot": slot, "inputs": [feature, parameter], "output": "boolean",
        "expression": format!("{feature} <= {parameter}"), "tags": ["gentle_motion"],
    });
    let node = json!({
        "slot": "filter", "kind": kind.kind, "settings": {setting: {"mechanism": "gentle"}}, "inputs": [source],
    });
    Some(vec![
        json!({"op": "add", "path": "/mechanism_modules/gentle", "value": module}),
        json!({"op": "add", "path": "/operator_graph/gentle_only", "value": node}),
        json!({"op": "replace", "path": format!("/operator_graph/{consumer}/inputs/0"), "value": "gentle_only"}),
    ])
}

/// A numeric feature and a parameter of the same unit that share a word.
fn akin<'c>(contract: &'c Contract, features: &'c [Feature]) -> Option<(&'c str, &'c str)> {
    let word = |name: &str, other: &str| {
        other.split('_').any(|word| word.len() >= KIN_LETTERS_MIN && name.split('_').any(|own| own == word))
    };
    let units = contract.parameters.iter().filter_map(|(name, spec)| match &spec.domain {
        Domain::Number { unit, .. } if unit != "1" => Some((name.as_str(), unit.as_str())),
        _ => None,
    });
    let numeric = features.iter().filter(|feature| feature.value == ValueType::Number);
    numeric.into_iter().find_map(|feature| {
        let fits = |(name, unit): &(&str, &str)| *unit == feature.unit && word(feature.name, name);
        units.clone().find(fits).map(|(name, _)| (feature.name, name))
    })
}

/// The node that makes the choice from candidates, and the node that feeds it.
fn before_choice<'p>(contract: &Contract, parent: &'p Program) -> Option<(&'p str, &'p str)> {
    let chooses = |node: &&OperatorNode| {
        let spec: Option<&OperatorSpec> =
            contract.operators.get(&node.slot).and_then(|kinds| kinds.iter().find(|kind| kind.kind == node.kind));
        spec.is_some_and(|spec| spec.output == Port::Choice && spec.inputs == [Port::Candidates])
    };
    let (name, node) = parent.operator_graph.iter().find(|(_, node)| chooses(node))?;
    Some((name, node.inputs.first()?))
}

/// A rule on the first scene feature, a parameter and, where a node has a literal or referred number, that setting.
fn rule(contract: &Contract, parent: &Program) -> Option<Value> {
    let feature = contract.scene_features.iter().find(|feature| feature.value == ValueType::Number)?;
    let middle = |domain: &Domain| match domain {
        Domain::Number { low, high, .. } => Some(json!(f64::midpoint(*low, *high))),
        Domain::Integer { low, high, .. } => Some(json!(low.midpoint(*high))),
        _ => None,
    };
    let spec_of = |node: &OperatorNode| contract.operators.get(&node.slot)?.iter().find(|kind| kind.kind == node.kind);
    let (node, setting, name, value) = parent.operator_graph.iter().find_map(|(node, operator)| {
        let spec = spec_of(operator)?;
        operator.settings.iter().find_map(|(setting, value)| match value {
            Setting::Parameter(reference) => {
                let value = middle(&spec.settings.get(setting)?.domain)?;
                Some((node, setting, &reference.parameter, value))
            }
            _ => None,
        })
    })?;
    let other = contract.parameters.iter().filter(|(other, _)| *other != name);
    let used = |other: &&String| {
        let refers = |value: &Setting| matches!(value, Setting::Parameter(found) if found.parameter == ***other);
        parent.operator_graph.values().any(|node| node.settings.values().any(refers))
    };
    let (parameter, changed) =
        other.filter(|(other, _)| used(other)).find_map(|(other, spec)| Some((other, middle(&spec.domain)?)))?;
    Some(json!({"op": "add", "path": "/scenario_conditioned_policy/-", "value": {
        "name": "busy_scenes", "when": format!("{} >= 8", feature.name),
        "parameters": {parameter: changed},
        "operators": {node: {setting: value}},
    }}))
}
