//! A bounded edit δ of a program, as agents propose it.

use serde::{Deserialize, Serialize};

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
}

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
    pub value: Option<serde_json::Value>,
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
    /// Digest of all that it says, hypothesis and references included.
    pub fn hash(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/patch/1", self)
    }
}
