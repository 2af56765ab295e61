//! The schema of a patch closed over one question: the paths that its parent has, the words and numbers that the contract allows there, the
//! cards and clusters that the question shows. A model that a server holds to it cannot name what is not there, which small models do. It
//! offers values, words, mechanisms, rules and new expressions of the parent's modules; new nodes and modules it does not offer. A patch is
//! one edit: of two no schema can say that they are of different places, and a model of 1.5 B edited one place twice in 8 of 16 answers.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use serde_json::{Map, Value, json};

use super::reply;
use crate::adapters::{Contract, Domain, Feature};
use crate::kernel::canon::CanonError;
use crate::llm::Schema;
use crate::objects::{BODY_SETTING, MechanismModule, OperatorNode, Program, Role, Setting, Slot, ValueType};

/// Numbers that a place with bounds is offered, of evenly spaced ones. Servers do not hold a number between bounds, but to a list.
const GRID: u32 = 16;
/// Letters of a hypothesis, of an expression.
const HYPOTHESIS_MAX: u32 = 600;
const EXPRESSION_MAX: u32 = 240;
/// Bounds of a count in a rule's condition.
const COUNTS: [u32; 3] = [2, 4, 8];

/// Parts of a program that patches of a lineage may edit.
#[derive(Clone, Debug)]
pub struct Surface {
    /// I_b of the family.
    pub contract: Contract,
    /// True if patches may edit rules.
    pub rules: bool,
    /// True if patches may edit modules.
    pub modules: bool,
    /// True if no patch may bring in a sort of road user that the parent does not insert.
    pub fixed_bodies: bool,
}

/// Parts of a question that a patch may refer to.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Member of the reply -> the value that it repeats.
    pub repeats: BTreeMap<&'static str, String>,
    /// Ids of the cards.
    pub memory: Vec<String>,
    /// Names of the clusters.
    pub clusters: Vec<String>,
}

/// The closed schemas of a question. Each is made when a model is first held to it: most never are.
#[derive(Clone, Debug)]
pub struct ClosedSchemas {
    /// Parts that may be edited.
    pub surface: Arc<Surface>,
    /// Program that is edited.
    pub parent: Program,
    /// Parts that may be referred to.
    pub shown: Shown,
    /// Of the actor and of the repair, once made.
    pub made: [OnceLock<Schema>; 2],
}

impl ClosedSchemas {
    /// The schema of a role that writes patches; `None` of another one.
    ///
    /// # Errors
    /// A bound of the contract that JSON cannot hold.
    pub fn of(&self, role: Role) -> Result<Option<Schema>, CanonError> {
        let made = match role {
            Role::Actor => &self.made[0],
            Role::Repair => &self.made[1],
            _ => return Ok(None),
        };
        if made.get().is_none() {
            let schema = Schema::new(closed(role, &self.surface, &self.parent, &self.shown))?;
            // Whoever else has made it meanwhile has made the same.
            let _ = made.set(schema);
        }
        Ok(made.get().cloned())
    }
}

/// The schema for an actor or a repair.
fn closed(role: Role, surface: &Surface, parent: &Program, shown: &Shown) -> Value {
    let mut schema = reply::schema(role);
    let Some(members) = schema.pointer_mut("/properties/program_patch/properties").and_then(Value::as_object_mut)
    else {
        return schema;
    };
    for (member, value) in &shown.repeats {
        members.insert((*member).into(), one_of([value.as_str()]));
    }
    members.insert("hypothesis".into(), json!({"type": "string", "minLength": 1, "maxLength": HYPOTHESIS_MAX}));
    if members.contains_key("repair_summary") {
        members.insert("repair_summary".into(), json!({"type": "string", "minLength": 1, "maxLength": HYPOTHESIS_MAX}));
    }
    members.insert("memory_refs_used".into(), some_of(&shown.memory));
    members.insert("cluster_refs_used".into(), some_of(&shown.clusters));
    let edits = edits(surface, parent);
    members
        .insert("operations".into(), json!({"type": "array", "minItems": 1, "maxItems": 1, "items": {"anyOf": edits}}));
    schema
}

/// One alternative a place and sort of edit.
fn edits(surface: &Surface, parent: &Program) -> Vec<Value> {
    let Surface { contract, fixed_bodies, .. } = surface;
    let bodies: Vec<&OperatorNode> =
        parent.operator_graph.values().filter(|node| *fixed_bodies && node.slot == Slot::Actor).collect();
    let names_a_body = |parameter: &str| {
        let reads = |of: &Setting| matches!(of, Setting::Parameter(found) if found.parameter == parameter);
        bodies.iter().any(|node| node.settings.get(BODY_SETTING).is_some_and(reads))
    };
    let free = contract.parameters.iter().filter(|(name, _)| !names_a_body(name));
    let sets: Vec<(&String, Value)> = free
        .filter_map(|(name, spec)| {
            let now = json!(parent.parameters.get(name)?);
            Some((name, values(&spec.domain, Some(&now), parent)?))
        })
        .collect();
    let mut edits: Vec<Value> =
        sets.iter().map(|(name, value)| edit("replace", format!("/parameters/{name}"), value.clone())).collect();
    for (node, operator) in &parent.operator_graph {
        let mut kinds = contract.operators.get(&operator.slot).into_iter().flatten();
        let Some(kind) = kinds.find(|kind| kind.kind == operator.kind) else { continue };
        let is_free = |name: &str| !(*fixed_bodies && operator.slot == Slot::Actor && name == BODY_SETTING);
        for (name, setting) in kind.settings.iter().filter(|(name, _)| is_free(name)) {
            let now = operator.settings.get(name).map(|now| json!(now));
            let op = if now.is_some() { "replace" } else { "add" };
            let place = format!("/operator_graph/{node}/settings/{name}");
            edits.extend(values(&setting.domain, now.as_ref(), parent).map(|value| edit(op, place, value)));
        }
    }
    if surface.modules {
        edits.extend(parent.mechanism_modules.iter().filter_map(|(name, module)| rewritten(contract, name, module)));
    }
    if surface.rules {
        edits.extend(rules(contract, parent, sets));
    }
    edits
}

fn edit(op: &str, path: String, value: Value) -> Value {
    json!({
        "type": "object", "additionalProperties": false, "required": ["op", "path", "value"],
        "properties": {"op": one_of([op]), "path": one_of([path]), "value": value},
    })
}

fn one_of<T: Into<Value>>(words: impl IntoIterator<Item = T>) -> Value {
    json!({"enum": words.into_iter().map(Into::into).collect::<Vec<Value>>()})
}

/// A list of some of these names.
fn some_of(names: &[String]) -> Value {
    match names.len() {
        0 => json!({"type": "array", "maxItems": 0, "items": {"type": "string"}}),
        count => json!({"type": "array", "maxItems": count.min(4), "items": one_of(names.iter().map(String::as_str))}),
    }
}

/// Returns the values that may stand in a place in which `now` stands; `None` where that is the only value.
fn values(domain: &Domain, now: Option<&Value>, parent: &Program) -> Option<Value> {
    let all: Vec<Value> = match domain {
        Domain::Number { low, high, .. } => grid(*low, *high).into_iter().map(Value::from).collect(),
        Domain::Integer { low, high, .. } => whole(*low, *high).into_iter().map(Value::from).collect(),
        Domain::Choice { options } => options.iter().map(|word| word.as_str().into()).collect(),
        Domain::Mechanism { slot } => {
            let fits = |module: &&MechanismModule| module.slot == *slot;
            let modules = parent.mechanism_modules.iter().filter(|(_, module)| fits(module));
            let other =
                modules.filter(|(name, _)| now != Some(&json!({"mechanism": name}))).map(|(name, _)| name.as_str());
            let names: Vec<&str> = other.collect();
            return (!names.is_empty()).then(|| {
                json!({
                    "type": "object", "additionalProperties": false, "required": ["mechanism"],
                    "properties": {"mechanism": one_of(names)},
                })
            });
        }
    };
    let is_now = |value: &Value| match (value.as_f64(), now.and_then(Value::as_f64)) {
        (Some(a), Some(b)) => a == b,
        _ => now == Some(value),
    };
    let other: Vec<Value> = all.into_iter().filter(|value| !is_now(value)).collect();
    (!other.is_empty()).then(|| one_of(other))
}

/// Evenly spaced numbers from `low` to `high`, both among them, the others of three digits.
fn grid(low: f64, high: f64) -> Vec<f64> {
    let short = |x: f64| format!("{x:.2e}").parse().unwrap_or(x);
    let at = |k: u32| low + (high - low) * f64::from(k) / f64::from(GRID);
    let mut all: Vec<f64> = (1..GRID).map(|k| short(at(k))).filter(|x| *x > low && *x < high).collect();
    all.insert(0, low);
    all.push(high);
    all.dedup();
    all
}

/// All whole numbers of a short range, evenly spaced ones of a long one.
fn whole(low: i64, high: i64) -> Vec<i64> {
    let most = i64::from(GRID);
    if high.saturating_sub(low) <= most {
        return (low..=high).collect();
    }
    let wide = i128::from(high) - i128::from(low);
    let at = |k: i64| (i128::from(low) + wide * i128::from(k) / i128::from(most)) as i64;
    (0..=most).map(at).collect()
}

/// Another expression for a module: the names that it may read are those of its slot.
fn rewritten(contract: &Contract, name: &str, module: &MechanismModule) -> Option<Value> {
    let inputs = contract.mechanism_scope(&module.slot)?;
    let value = json!({
        "type": "object", "additionalProperties": false, "required": ["slot", "inputs", "output", "expression", "tags"],
        "properties": {
            "slot": one_of([module.slot.as_str()]),
            "inputs": {"type": "array", "minItems": 1, "maxItems": 6, "items": one_of(inputs.names())},
            "output": {"enum": [module.output]},
            "expression": {"type": "string", "minLength": 1, "maxLength": EXPRESSION_MAX},
            "tags": {"type": "array", "minItems": 1, "maxItems": module.tags.len().max(1), "items": one_of(module.tags.iter().map(String::as_str))},
        },
    });
    (!module.tags.is_empty()).then(|| edit("replace", format!("/mechanism_modules/{name}"), value))
}

/// Rules that set one parameter where a plain condition holds; `sets` are the values of each.
fn rules(contract: &Contract, parent: &Program, sets: Vec<(&String, Value)>) -> Option<Value> {
    let policy = &parent.scenario_conditioned_policy;
    if policy.len() >= contract.limits.rules {
        return None;
    }
    let conditions: Vec<String> = contract.scene_features.iter().flat_map(conditions).collect();
    let name = (1..).map(|n| format!("where_{n}")).find(|name| policy.iter().all(|rule| rule.name != *name))?;
    if conditions.is_empty() || sets.is_empty() {
        return None;
    }
    let set = |(parameter, values): (&String, Value)| {
        let of = Map::from_iter([(parameter.clone(), values)]);
        json!({"type": "object", "additionalProperties": false, "required": [parameter], "properties": of})
    };
    let sets: Vec<Value> = sets.into_iter().map(set).collect();
    let value = json!({
        "type": "object", "additionalProperties": false, "required": ["name", "when", "parameters"],
        "properties": {"name": one_of([name]), "when": one_of(conditions), "parameters": {"anyOf": sets}},
    });
    Some(edit("add", "/scenario_conditioned_policy/-".into(), value))
}

/// Conditions on one feature: a truth value as it is or not, a count from some number on.
fn conditions(feature: &Feature) -> Vec<String> {
    match (feature.value, feature.unit) {
        (ValueType::Boolean, _) => vec![feature.name.to_string(), format!("not {}", feature.name)],
        (ValueType::Number, "1") if feature.name.ends_with("_count") => {
            COUNTS.iter().map(|least| format!("{} >= {least}", feature.name)).collect()
        }
        (ValueType::Number, _) => vec![],
    }
}

#[cfg(test)]
mod tests {
    use super::super::example::Example;
    use super::*;

    #[test]
    fn a_grid_holds_both_ends_and_short_numbers_between_them() {
        assert_eq!(grid(0.0, 1.6)[..4], [0.0, 0.1, 0.2, 0.3]);
        for (low, high) in [(0.5, 30.0), (-3.0, 3.0), (0.001, 0.002), (1.0, 1.0), (0.0, 1e6), (-180.0, -20.0)] {
            let all = grid(low, high);
            assert_eq!((all[0], all[all.len() - 1]), (low, high));
            assert!(all.windows(2).all(|w| w[0] < w[1]) && all.len() <= GRID as usize + 1, "{all:?}");
            let inner = all.iter().filter(|x| **x != low && **x != high);
            assert!(inner.into_iter().all(|x| format!("{x:.2e}").parse() == Ok(*x)), "{all:?}");
        }
        assert_eq!(whole(1, 4), [1, 2, 3, 4]);
        let long = whole(-100, 10_000);
        assert_eq!((long[0], long[16], long.len()), (-100, 10_000, 17));
    }

    #[test]
    fn a_question_without_cards_lets_none_be_named() {
        let example = Example::toy();
        let repeats = BTreeMap::from([("source_baseline", "toy".to_string())]);
        let shown = Shown { repeats, memory: vec![], clusters: vec!["cluster:dense".into()] };
        let surface = Surface { contract: example.contract.clone(), rules: true, modules: true, fixed_bodies: false };
        let schema = closed(Role::Repair, &surface, &example.parent, &shown);
        let members = &schema["properties"]["program_patch"]["properties"];
        assert_eq!(members["memory_refs_used"]["maxItems"], 0);
        assert_eq!(members["cluster_refs_used"]["items"], json!({"enum": ["cluster:dense"]}));
        assert_eq!(members["source_baseline"], json!({"enum": ["toy"]}));
        assert!(members["repair_summary"]["maxLength"].is_u64());
    }
}
