//! A bounded edit δ of a program, as agents propose it.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

use super::ids::{FamilyName, SolutionId};
use crate::kernel::{Digest, canon::CanonError};

/// The four parts of a program that a patch may touch.
pub const EDITABLE_SURFACE: [&str; 4] =
    ["/parameters", "/operator_graph", "/scenario_conditioned_policy", "/mechanism_modules"];

/// Edit that agents return (paper, prompt catalog). Unknown fields are refused.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramPatch {
    /// b: the family that the patch is for.
    pub source_baseline: FamilyName,
    /// The program that it changes.
    pub parent_solution_id: SolutionId,
    /// 64 hex digits; text, because a stale or garbled hash is a finding of the parent gate, not a parse error.
    pub parent_program_hash: String,
    /// δ: what it changes, in order.
    pub operations: Vec<Operation>,
    /// The behaviour that the edit is expected to change, and why.
    pub hypothesis: String,
    /// Ids of the memory cards that it rests on.
    #[serde(default)]
    pub memory_refs_used: Vec<String>,
    /// Names of the scene clusters that it rests on.
    #[serde(default)]
    pub cluster_refs_used: Vec<String>,
    /// Only in repaired patches.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repair_summary: Option<String>,
    /// Constants that the patch leaves to a numeric search, by name: values of its operations say `$name` where they stand.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub free: BTreeMap<String, FreeConstant>,
}

/// A constant that a patch leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FreeConstant {
    /// Value by which the gates and the critics judge the patch, and the first that is tried.
    pub start: f64,
    /// Smallest value, in the unit of its place. Without it that of the contract, where the constant is the whole value of a parameter or a
    /// setting.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// Largest value, likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
}

/// Sign in front of a free constant's name.
pub const FREE_SIGN: char = '$';

/// One typed edit at a JSON Pointer path (RFC 6901) of the program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Operation {
    /// Kind of the edit.
    pub op: OperationKind,
    /// Place of the edit: a JSON Pointer into the program.
    pub path: String,
    /// Needed by `add` and `replace`, forbidden in `remove`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<Value>,
}

impl Operation {
    /// Returns the edit as a reader needs it: its kind, its place, and the new value.
    pub fn in_words(&self) -> String {
        let value = self.value.as_ref().map_or(String::new(), |value| format!(" = {value}"));
        let kind = match self.op {
            OperationKind::Add => "add",
            OperationKind::Replace => "replace",
            OperationKind::Remove => "remove",
        };
        format!("{kind} {}{value}", self.path)
    }
}

/// Kind of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OperationKind {
    /// Puts a value where none stands.
    Add,
    /// Puts a value in the place of another.
    Replace,
    /// Takes a value away.
    Remove,
}

impl ProgramPatch {
    /// The patch with numbers in the place of its free constants; it leaves none open. A constant without a value stays as it is written.
    pub fn bound(&self, values: &BTreeMap<String, f64>) -> ProgramPatch {
        let mut bound = ProgramPatch { free: BTreeMap::new(), ..self.clone() };
        for value in bound.operations.iter_mut().filter_map(|operation| operation.value.as_mut()) {
            bind(value, values);
        }
        bound
    }

    /// The patch with the first value of each of its free constants.
    pub fn at_start(&self) -> ProgramPatch {
        self.bound(&self.free.iter().map(|(name, free)| (name.clone(), free.start)).collect())
    }

    /// Names behind the sign of a free constant in its values, each once.
    pub fn constants_used(&self) -> BTreeSet<String> {
        let mut used = BTreeSet::new();
        let texts = self.operations.iter().filter_map(|operation| operation.value.as_ref());
        texts.for_each(|value| each_text(value, &mut |text| used.extend(named(text).into_iter().map(|of| of.1))));
        used
    }

    /// Digest of all that it says, hypothesis and references included.
    pub fn hash(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/patch/1", self)
    }
}

/// Puts numbers where a value names free constants: a text that is only a name becomes a number, within a text the number is written out.
fn bind(value: &mut Value, values: &BTreeMap<String, f64>) {
    match value {
        Value::String(text) => {
            let whole = text.strip_prefix(FREE_SIGN).and_then(|name| values.get(name));
            if let Some(number) = whole {
                *value = json!(number);
                return;
            }
            for (place, name) in named(text).into_iter().rev() {
                if let Some(number) = values.get(&name) {
                    text.replace_range(place..place + FREE_SIGN.len_utf8() + name.len(), &number.to_string());
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| bind(item, values)),
        Value::Object(members) => members.values_mut().for_each(|member| bind(member, values)),
        _ => {}
    }
}

/// Calls a function for each text within a value.
fn each_text<'v>(value: &'v Value, see: &mut impl FnMut(&'v str)) {
    match value {
        Value::String(text) => see(text),
        Value::Array(items) => items.iter().for_each(|item| each_text(item, see)),
        Value::Object(members) => members.values().for_each(|member| each_text(member, see)),
        _ => {}
    }
}

/// Names of free constants in a text, with the byte at which each one's sign stands.
fn named(text: &str) -> Vec<(usize, String)> {
    let name = |(place, sign): (usize, &str)| {
        let letters =
            text[place + sign.len()..].chars().take_while(|letter| letter.is_ascii_alphanumeric() || *letter == '_');
        (place, letters.collect::<String>())
    };
    text.match_indices(FREE_SIGN).map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patch(values: &[Value]) -> ProgramPatch {
        let operation =
            |value: &Value| Operation { op: OperationKind::Add, path: "/x".into(), value: Some(value.clone()) };
        ProgramPatch {
            source_baseline: FamilyName::new("toy"),
            parent_solution_id: SolutionId::new("toy/parent"),
            parent_program_hash: String::new(),
            operations: values.iter().map(operation).collect(),
            hypothesis: String::new(),
            memory_refs_used: Vec::new(),
            cluster_refs_used: Vec::new(),
            repair_summary: None,
            free: BTreeMap::new(),
        }
    }

    #[test]
    fn numbers_take_the_place_of_names_in_values_and_within_expressions() {
        let open = patch(&[json!("$gap"), json!({"when": "gap_m < $gap and ttc_s < $gap_s * 2", "of": ["$other"]})]);
        assert_eq!(open.constants_used().into_iter().collect::<Vec<_>>(), ["gap", "gap_s", "other"]);
        let values = BTreeMap::from([("gap".to_string(), 2.5), ("gap_s".to_string(), -0.125)]);
        let bound = open.bound(&values);
        let found: Vec<&Value> = bound.operations.iter().filter_map(|of| of.value.as_ref()).collect();
        assert_eq!(found[0], &json!(2.5));
        assert_eq!(found[1], &json!({"when": "gap_m < 2.5 and ttc_s < -0.125 * 2", "of": ["$other"]}));
    }

    #[test]
    fn a_patch_without_free_constants_has_the_hash_that_it_had_before_there_were_any() {
        let plain = patch(&[json!(1)]);
        assert!(!serde_json::to_string(&plain).unwrap().contains("free"));
        let mut open = plain.clone();
        open.free.insert("a".into(), FreeConstant { start: 1.0, low: None, high: None });
        assert_ne!(open.hash().unwrap(), plain.hash().unwrap());
        assert_eq!(open.at_start().hash().unwrap(), plain.hash().unwrap());
    }
}
