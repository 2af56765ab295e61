//! Random legal patches: what a search does that knows the contract and nothing else. A baseline.

use serde_json::{Value, json};
use std::collections::BTreeMap;

use crate::adapters::{Contract, Domain, OperatorSpec};
use crate::kernel::{Digest, Stream, num};
use crate::objects::{
    Operation, OperationKind, OperatorNode, ParameterValue, Program, ProgramPatch, Setting, ValueType, pointer::within,
};

/// Decimals of a drawn number.
const DECIMALS: u32 = 4;
/// Tries to draw a value that differs from the present one.
const TRIES: usize = 8;

/// Where a random patch may put what.
#[derive(Clone, Copy, Debug)]
pub struct Places<'a> {
    /// I_b of the family.
    pub contract: &'a Contract,
    /// Values that a scene feature has somewhere: thresholds are drawn from them.
    pub values: &'a BTreeMap<&'static str, Vec<f64>>,
    /// Parts of a program that are closed in this run.
    pub closed: &'a [&'static str],
}

/// A patch of 1 to `edits_max` edits at different places, all places alike: a parameter's value, a literal setting of a node, a
/// node's kind (of the same types, where no module is needed), a new rule with a condition over one scene feature.
pub fn random_patch(
    (parent, hash): (&Program, Digest),
    places: &Places<'_>,
    edits_max: usize,
    stream: &mut Stream,
) -> ProgramPatch {
    let mut edits = edits(parent, places);
    let wanted = 1 + stream.below(edits_max.max(1));
    let mut operations = Vec::new();
    while operations.len() < wanted && !edits.is_empty() {
        let edit = edits.swap_remove(stream.below(edits.len()));
        // A node whose kind changes has no other edit: its settings are new.
        if let Some(operation) = operation(parent, places, &edit, stream).filter(|new| apart(new, &operations)) {
            operations.push(operation);
        }
    }
    ProgramPatch {
        source_baseline: parent.source_family.clone(),
        parent_solution_id: parent.solution_id.clone(),
        parent_program_hash: hash.to_hex(),
        operations,
        hypothesis: "none: a random legal edit".into(),
        memory_refs_used: Vec::new(),
        cluster_refs_used: Vec::new(),
        repair_summary: None,
    }
}

/// A place that can be edited.
enum Edit<'a> {
    Parameter(&'a str),
    Setting(&'a str, &'a str),
    Kind(&'a str, &'a OperatorSpec),
    Rule,
}

fn edits<'a>(parent: &'a Program, places: &Places<'a>) -> Vec<Edit<'a>> {
    let Places { contract, closed, .. } = *places;
    let mut edits: Vec<Edit<'a>> = parent.parameters.keys().map(|name| Edit::Parameter(name)).collect();
    for (name, node) in &parent.operator_graph {
        let kinds = contract.operators.get(&node.slot).map(Vec::as_slice).unwrap_or_default();
        let Some(own) = kinds.iter().find(|spec| spec.kind == node.kind) else { continue };
        let literal = |setting: &&String| matches!(node.settings[*setting], Setting::Number(_) | Setting::Choice(_));
        edits.extend(node.settings.keys().filter(literal).map(|setting| Edit::Setting(name, setting)));
        let alike = |spec: &&OperatorSpec| {
            let needs_module = |domain: &Domain| matches!(domain, Domain::Mechanism { .. });
            let plain = !spec.settings.values().any(|setting| setting.required && needs_module(&setting.domain));
            spec.kind != own.kind && spec.inputs == own.inputs && spec.output == own.output && plain
        };
        edits.extend(kinds.iter().filter(alike).map(|spec| Edit::Kind(name, spec)));
    }
    let rules = parent.scenario_conditioned_policy.len();
    if rules < contract.limits.rules && !closed.contains(&"/scenario_conditioned_policy") {
        // As often as a feature: one place among hundreds would never be drawn.
        edits.extend(contract.scene_features.iter().map(|_| Edit::Rule));
    }
    edits
}

fn operation(parent: &Program, places: &Places<'_>, edit: &Edit<'_>, stream: &mut Stream) -> Option<Operation> {
    let contract = places.contract;
    let replace = |path: String, value: Value| Operation { op: OperationKind::Replace, path, value: Some(value) };
    match edit {
        Edit::Parameter(name) => {
            let now = json!(parent.parameters[*name]);
            let value = another(&contract.parameters.get(*name)?.domain, &now, stream)?;
            Some(replace(within("/parameters", name), value))
        }
        Edit::Setting(node, setting) => {
            let of = &parent.operator_graph[*node];
            let spec = contract.operators.get(&of.slot)?.iter().find(|spec| spec.kind == of.kind)?;
            let value = another(&spec.settings.get(*setting)?.domain, &json!(of.settings[*setting]), stream)?;
            let place = within(&within("/operator_graph", node), "settings");
            Some(replace(within(&place, setting), value))
        }
        Edit::Kind(node, spec) => {
            let OperatorNode { slot, inputs, .. } = &parent.operator_graph[*node];
            let mut settings = serde_json::Map::new();
            for (name, setting) in spec.settings.iter().filter(|(_, setting)| setting.required) {
                settings.insert(name.clone(), drawn(&setting.domain, stream)?);
            }
            let value = json!({"slot": slot, "kind": spec.kind, "settings": settings, "inputs": inputs});
            Some(replace(within("/operator_graph", node), value))
        }
        Edit::Rule => {
            let names: Vec<&String> = parent.parameters.keys().collect();
            let name = *stream.pick(&names)?;
            let value = another(&contract.parameters.get(name)?.domain, &json!(parent.parameters[name]), stream)?;
            let rule = json!({
                "name": format!("random_{}", stream.below(1_000_000)),
                "when": condition(places, stream)?,
                "parameters": {name.as_str(): value},
                "operators": {},
            });
            let path = "/scenario_conditioned_policy/-".to_string();
            Some(Operation { op: OperationKind::Add, path, value: Some(rule) })
        }
    }
}

/// Whether an edit is neither at the place of another one nor within it. Two rules are apart.
fn apart(new: &Operation, others: &[Operation]) -> bool {
    let inside = |inner: &str, outer: &str| inner == outer || inner.starts_with(&format!("{outer}/"));
    new.op == OperationKind::Add
        || !others.iter().any(|other| inside(&new.path, &other.path) || inside(&other.path, &new.path))
}

/// One scene feature, alone where it is a truth value, or on one side of a value that some scene has.
fn condition(places: &Places<'_>, stream: &mut Stream) -> Option<String> {
    let feature = stream.pick(&places.contract.scene_features)?;
    if feature.value == ValueType::Boolean {
        return Some(if stream.chance(0.5) { feature.name.into() } else { format!("not {}", feature.name) });
    }
    let threshold = num::rounded(*stream.pick(places.values.get(feature.name)?)?, DECIMALS);
    Some(format!("{} {} {threshold}", feature.name, if stream.chance(0.5) { "<=" } else { ">" }))
}

/// A value other than the present one; `None` where the domain seems to have no other.
fn another(domain: &Domain, now: &Value, stream: &mut Stream) -> Option<Value> {
    (0..TRIES).find_map(|_| drawn(domain, stream).filter(|value| value != now))
}

/// All values alike; `None` where only a module would do.
fn drawn(domain: &Domain, stream: &mut Stream) -> Option<Value> {
    let value = match domain {
        Domain::Number { low, high, .. } => {
            ParameterValue::Number(num::rounded(stream.uniform(*low, *high), DECIMALS).clamp(*low, *high))
        }
        Domain::Integer { low, high, .. } => {
            let count = usize::try_from(high - low + 1).ok()?;
            ParameterValue::Number((*low + stream.below(count.max(1)) as i64) as f64)
        }
        Domain::Choice { options } => ParameterValue::Choice(stream.pick(options)?.clone()),
        Domain::Mechanism { .. } => return None,
    };
    Some(json!(value))
}
