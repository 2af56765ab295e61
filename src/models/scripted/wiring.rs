//! Parts of a program: new modules, the settings of an operator kind, a filter put into the graph. All legal by the contract.

use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

use super::{
    constants::kinship,
    contract::{Domain, Kind},
    edit,
    forms::{self, Mechanism, Purpose},
    names::names_in,
    reader::{Node, Program, PromptView},
};
use crate::kernel::{Stream, num};

/// An edit in the making.
#[derive(Clone, Debug, Default)]
pub struct Draft {
    pub operations: Vec<Value>,
    /// Tags of the mechanisms that it brings in.
    pub tags: Vec<String>,
    pub clusters: Vec<String>,
    names: BTreeSet<String>,
}

impl Draft {
    /// A name that neither the program nor this draft uses.
    pub fn fresh<'a>(&mut self, base: &str, taken: impl Iterator<Item = &'a String>) -> String {
        let taken: BTreeSet<&String> = taken.collect();
        let base: String = base.chars().take(40).collect();
        let free = |name: &String| !taken.contains(name) && !self.names.contains(name);
        let numbered = (2..).map(|n| format!("{base}_{n}"));
        let name = std::iter::once(base.clone()).chain(numbered).find(free).unwrap_or(base.clone());
        self.names.insert(name.clone());
        name
    }

    pub fn uses(&mut self, mechanism: &Mechanism) {
        self.tags.extend(mechanism.tags.iter().cloned());
        self.clusters.extend(mechanism.clusters.iter().cloned());
    }
}

/// A module as JSON, its inputs read off the expression.
pub fn module_json(page: &PromptView, slot: &str, expression: &str, tags: &[String]) -> Value {
    let output = page.contract.mechanism_slots.get(slot).map_or("number", |spec| spec.output.as_str());
    let tags: BTreeSet<&String> = tags.iter().rev().take(6).collect();
    json!({
        "slot": slot,
        "inputs": names_in(expression),
        "output": output,
        "expression": expression,
        "tags": tags,
    })
}

/// Adds a new module of the slot; gives its name.
pub fn new_module(
    page: &PromptView,
    program: &Program,
    slot: &str,
    draft: &mut Draft,
    stream: &mut Stream,
) -> Option<String> {
    let mechanism = forms::invent(page, slot, stream)?;
    let base = mechanism.tags.first().map_or("mechanism", String::as_str);
    let name = draft.fresh(base, program.mechanism_modules.keys());
    let module = module_json(page, slot, &mechanism.expression, &mechanism.tags);
    draft.operations.push(edit::add(format!("/mechanism_modules/{name}"), module));
    draft.uses(&mechanism);
    Some(name)
}

/// A reference to a module of the slot: sometimes one that the program has, otherwise a new one.
pub fn mechanism(
    page: &PromptView,
    program: &Program,
    slot: &str,
    draft: &mut Draft,
    stream: &mut Stream,
) -> Option<Value> {
    let present: Vec<&String> =
        program.mechanism_modules.iter().filter(|(_, module)| module.slot == slot).map(|(name, _)| name).collect();
    if stream.chance(0.3)
        && let Some(name) = stream.pick(&present)
    {
        return Some(json!({"mechanism": name}));
    }
    Some(json!({"mechanism": new_module(page, program, slot, draft, stream)?}))
}

/// Settings for a node of this kind: those of the old node where they fit, otherwise drawn.
pub fn settings(
    page: &PromptView,
    program: &Program,
    kind: &Kind,
    old: Option<&Node>,
    draft: &mut Draft,
    stream: &mut Stream,
) -> Option<BTreeMap<String, Value>> {
    let old_kind = old.and_then(|node| page.kind(&node.slot, &node.kind));
    let mut filled = BTreeMap::new();
    for (name, domain) in &kind.settings {
        let kept = old.and_then(|node| node.settings.get(name));
        let same_kind = old_kind
            .and_then(|kind| kind.settings.get(name))
            .is_some_and(|d| d.kind == domain.kind && d.slot == domain.slot);
        let value = match kept.filter(|_| same_kind) {
            Some(value) => value.clone(),
            None if !domain.required && !stream.chance(0.4) => continue,
            None => setting(page, program, name, domain, draft, stream)?,
        };
        filled.insert(name.clone(), value);
    }
    // A node all of whose settings may be left out does nothing without one.
    if filled.is_empty()
        && let Some((name, domain)) = kind.settings.iter().next()
    {
        filled.insert(name.clone(), setting(page, program, name, domain, draft, stream)?);
    }
    Some(filled)
}

/// A value for one setting.
pub fn setting(
    page: &PromptView,
    program: &Program,
    name: &str,
    domain: &Domain,
    draft: &mut Draft,
    stream: &mut Stream,
) -> Option<Value> {
    if let Some(slot) = &domain.slot {
        return mechanism(page, program, slot, draft, stream);
    }
    if stream.chance(0.6)
        && let Some(parameter) = akin_parameter(page, name, domain)
    {
        return Some(json!({"parameter": parameter}));
    }
    literal(domain, stream)
}

/// The numeric parameter whose whole range fits the setting, with its unit and the most words in common with its name.
pub fn akin_parameter<'a>(page: &'a PromptView, name: &str, domain: &Domain) -> Option<&'a String> {
    let [low, high] = domain.range?;
    let fits = |spec: &Domain| {
        spec.unit == domain.unit
            && (domain.kind == "number" || spec.kind == "integer")
            && spec.range.is_some_and(|[l, h]| l >= low && h <= high)
    };
    let fitting = page.contract.parameters.iter().filter(|(_, spec)| spec.is_numeric() && fits(spec));
    let near = fitting.map(|(parameter, _)| (kinship(parameter, name), parameter)).filter(|(kin, _)| *kin > 0);
    near.max_by_key(|(kin, _)| *kin).map(|(_, parameter)| parameter)
}

/// A literal of the domain, away from its ends.
pub fn literal(domain: &Domain, stream: &mut Stream) -> Option<Value> {
    match (domain.kind.as_str(), domain.range) {
        ("choice", _) => stream.pick(&domain.options).map(|option| Value::from(option.as_str())),
        (kind, Some([low, high])) => {
            let x = low + (high - low) * stream.uniform(0.15, 0.75);
            Some(number(kind, x.clamp(low, high), low, high))
        }
        _ => None,
    }
}

/// A number in the form that its domain wants, inside the range after rounding.
pub fn number(kind: &str, x: f64, low: f64, high: f64) -> Value {
    match kind {
        "integer" => Value::from(x.round().clamp(low, high) as i64),
        _ => Value::from(num::rounded(x, if high - low < 1.0 { 4 } else { 2 }).clamp(low, high)),
    }
}

/// Inserts one more filter between two connected nodes: a kind whose output has the type of its input. Returns the
/// kind.
pub fn insert_filter(page: &PromptView, program: &Program, draft: &mut Draft, stream: &mut Stream) -> Option<String> {
    let mut places = vec![];
    for (slot, spec) in &page.contract.operators {
        let count = program.operator_graph.values().filter(|node| node.slot == *slot).count();
        if spec.nodes[0] == 0 && count < spec.nodes[1] && program.operator_graph.len() < page.contract.limits.nodes {
            let passing = spec.kinds.iter().filter(|(_, kind)| kind.inputs.len() == 1 && kind.inputs[0] == kind.output);
            places.extend(passing.map(|(name, kind)| (slot, name, kind)));
        }
    }
    let present = |kind: &String| program.operator_graph.values().any(|node| node.kind == *kind);
    let weakest = page.weakest().map_or("", |(name, _)| name);
    let weights: Vec<f64> = places
        .iter()
        .map(|(_, name, kind)| {
            let wanted =
                kind.settings.iter().any(|(setting, _)| kinship(weakest, setting) > 0) || kinship(weakest, name) > 0;
            let guards = kind
                .settings
                .values()
                .any(|domain| domain.slot.as_deref().is_some_and(|s| Purpose::of(page, s) == Some(Purpose::Guard)));
            let base = if wanted {
                3.0
            } else if guards {
                1.5
            } else {
                1.0
            };
            if present(name) && !guards { base * 0.15 } else { base }
        })
        .collect();
    let (slot, name, kind) = *places.get(forms::weighted(&weights, stream)?)?;
    let (consumer, at, source) = edge(page, program, &kind.output, stream)?;
    let node = draft.fresh(name, program.operator_graph.keys());
    let filled = settings(page, program, kind, None, draft, stream)?;
    let value = json!({"slot": slot, "kind": name, "settings": filled, "inputs": [source]});
    draft.operations.push(edit::add(format!("/operator_graph/{node}"), value));
    draft.operations.push(edit::replace(format!("/operator_graph/{consumer}/inputs/{at}"), Value::from(node)));
    Some(name.clone())
}

/// A consumer, the place among its inputs and the source, for an edge on which this type flows; the later of two as a rule, where the
/// consumer makes something else of it.
fn edge(page: &PromptView, program: &Program, port: &str, stream: &mut Stream) -> Option<(String, usize, String)> {
    let mut edges = vec![];
    for (name, node) in &program.operator_graph {
        let Some(kind) = page.kind(&node.slot, &node.kind) else { continue };
        for (at, input) in node.inputs.iter().enumerate() {
            if kind.inputs.get(at).is_some_and(|wanted| wanted == port) {
                let weight = if kind.output == port { 0.4 } else { 1.0 };
                edges.push(((name.clone(), at, input.clone()), weight));
            }
        }
    }
    let weights: Vec<f64> = edges.iter().map(|(_, weight)| *weight).collect();
    let index = forms::weighted(&weights, stream)?;
    edges.into_iter().nth(index).map(|(edge, _)| edge)
}
