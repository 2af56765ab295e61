//! Past edits with what they did, as prompts show them.

use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

use crate::kernel::num;
use crate::objects::{AttemptId, Operation, OperationKind, SolutionId};

/// Characters of an operation's value that are shown.
const VALUE_CHARS: usize = 420;
/// Characters of a hypothesis that are shown.
const HYPOTHESIS_CHARS: usize = 180;
/// Changes of diagnostics and clusters smaller than this are not shown.
const CHANGE_MIN: f64 = 0.002;
/// Scenes won or lost that are named.
const SCENES_NAMED: usize = 6;

/// An earlier attempt of the lineage with its content.
#[derive(Clone, Debug, PartialEq)]
pub struct PastEdit {
    /// Which attempt.
    pub attempt: AttemptId,
    /// The program that it edited.
    pub parent: SolutionId,
    /// Where it stands now, in words.
    pub ended: String,
    /// Its last readable patch.
    pub operations: Vec<Operation>,
    /// What it was to do.
    pub hypothesis: String,
    /// Why it was declined or refused, shortened.
    pub problems: Vec<String>,
    /// What it did, where it was simulated.
    pub change: Option<Change>,
}

/// Child minus parent on the same scenes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Change {
    /// How many scenes attack, realism and coverage are compared on.
    pub scenes: usize,
    /// Change of attack and its standard error, 1.
    pub attack: (f64, Option<f64>),
    /// Change of realism and its standard error, 1.
    pub realism: (f64, Option<f64>),
    /// Change of coverage, 1.
    pub coverage: f64,
    /// Change of each diagnostic over the scenes of its window in which both act, 1.
    pub diagnostics: BTreeMap<String, f64>,
    /// Change of attack in each cluster of its window, 1.
    pub clusters: BTreeMap<String, f64>,
    /// Scenes of its window with more attack than the parent's.
    pub won: Vec<String>,
    /// Scenes of its window with less.
    pub lost: Vec<String>,
}

impl PastEdit {
    /// As a prompt shows it.
    pub fn shown(&self) -> Value {
        let mut shown = json!({
            "attempt": self.attempt,
            "parent": self.parent,
            "ended": self.ended,
            "operations": self.operations.iter().map(operation).collect::<Vec<String>>(),
        });
        if !self.hypothesis.is_empty() {
            shown["hypothesis"] = cut(&self.hypothesis, HYPOTHESIS_CHARS).into();
        }
        if !self.problems.is_empty() {
            shown["problems"] = json!(self.problems);
        }
        if let Some(change) = &self.change {
            shown["change"] = change.shown();
        }
        shown
    }
}

impl Change {
    fn shown(&self) -> Value {
        let mut shown = json!({
            "scenes": self.scenes,
            "attack": with_error(self.attack),
            "realism": with_error(self.realism),
            "coverage": signed(self.coverage),
        });
        for (title, all) in [("diagnostics", &self.diagnostics), ("clusters", &self.clusters)] {
            let moved = all.iter().filter(|(_, change)| change.abs() >= CHANGE_MIN);
            let moved: Map<String, Value> = moved.map(|(name, x)| (name.clone(), signed(*x).into())).collect();
            if !moved.is_empty() {
                shown[title] = moved.into();
            }
        }
        for (title, scenes) in [("won", &self.won), ("lost", &self.lost)] {
            if !scenes.is_empty() {
                shown[title] = named(scenes).into();
            }
        }
        shown
    }
}

fn named(scenes: &[String]) -> String {
    let mut text = scenes.iter().take(SCENES_NAMED).cloned().collect::<Vec<_>>().join(", ");
    if scenes.len() > SCENES_NAMED {
        text.push_str(&format!(" and {} more", scenes.len() - SCENES_NAMED));
    }
    text
}

fn operation(operation: &Operation) -> String {
    let word = match operation.op {
        OperationKind::Add => "add",
        OperationKind::Replace => "replace",
        OperationKind::Remove => "remove",
    };
    match &operation.value {
        Some(value) => format!("{word} {} {}", operation.path, cut(&value.to_string(), VALUE_CHARS)),
        None => format!("{word} {}", operation.path),
    }
}

fn cut(text: &str, chars: usize) -> String {
    match text.char_indices().nth(chars) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_string(),
    }
}

fn signed(x: f64) -> String {
    format!("{:+.3}", num::rounded(x, 3))
}

fn with_error((x, error): (f64, Option<f64>)) -> String {
    match error {
        Some(error) => format!("{} ± {error:.3}", signed(x)),
        None => signed(x),
    }
}
