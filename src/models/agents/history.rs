//! Past edits with what they did, as prompts show them.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

use super::program_text::part_text;
use super::tables::{BAR, line, within};
use crate::kernel::num;
use crate::objects::{AttemptId, LineageId, Operation, OperationKind, SolutionId};

/// Characters of an operation's value that are shown.
const VALUE_CHARS: usize = 260;
/// The same in detailed questions: what comes behind is the second half of a long expression.
const DETAILED_VALUE_CHARS: usize = 150;
/// Changed diagnostics and clusters that a detailed question names.
const LARGEST: usize = 3;
/// A shorter operation is written out again.
const REPEATED_CHARS: usize = 60;
/// Characters of a hypothesis that are shown.
const HYPOTHESIS_CHARS: usize = 110;
/// Changes of diagnostics and clusters smaller than this are not shown.
const CHANGE_MIN: f64 = 0.002;
/// Scenes won or lost that are named.
const SCENES_NAMED: usize = 6;

/// An earlier attempt of the lineage with its content.
#[derive(Clone, Debug, PartialEq)]
pub struct PastEdit {
    /// Id of the attempt.
    pub attempt: AttemptId,
    /// The program that it edited.
    pub parent: SolutionId,
    /// Present standing of the attempt, in words.
    pub ended: String,
    /// Its last readable patch.
    pub operations: Vec<Operation>,
    /// Purpose of the patch.
    pub hypothesis: String,
    /// Why it was declined or refused, shortened.
    pub problems: Vec<String>,
    /// Change that it made, where it was simulated.
    pub change: Option<Change>,
    /// Comparison that each gate of the acceptance made, where the child was not accepted; only in detailed questions.
    pub verdict: Option<String>,
}

/// Child minus parent on the same scenes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// Number of scenes that attack, realism and coverage are compared on.
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
    /// Near misses of the parent and of the child on its window; only in detailed questions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near: Option<[usize; 2]>,
}

impl PastEdit {
    /// As a prompt about a parent shows it.
    pub fn shown(&self, parent: &SolutionId) -> Value {
        let mut shown = json!({
            "attempt": self.attempt,
            "ended": self.ended,
            "operations": self.operations.iter().map(|of| operation(of, VALUE_CHARS)).collect::<Vec<String>>(),
        });
        if self.parent != *parent {
            shown["parent"] = json!(self.parent);
        }
        if !self.hypothesis.is_empty() {
            shown["hypothesis"] = cut(&self.hypothesis, HYPOTHESIS_CHARS).into();
        }
        if !self.problems.is_empty() {
            shown["problems"] = json!(self.problems);
        }
        if let Some(change) = &self.change {
            shown["change"] = change.shown().into();
        }
        if let Some(verdict) = &self.verdict {
            shown["gates"] = verdict.clone().into();
        }
        shown
    }

    /// The same for a detailed question: an operation whose value stands in the parent is not written out again, and one that another
    /// edit of the list wrote out neither.
    pub fn shown_beside(&self, parent: &SolutionId, parts: &Value, written: &mut BTreeSet<String>) -> Value {
        let mut shown = self.shown(parent);
        if let Some(change) = &self.change {
            shown["change"] = change.most().shown().into();
        }
        shown["operations"] = self.operations_beside(&DETAILED, parts, written).into();
        shown
    }

    /// Its row in the table of a compact question, under [`PastEdit::compact_head`].
    pub fn compact_row(
        &self,
        lineage: &LineageId,
        parent: &SolutionId,
        parts: &Value,
        written: &mut BTreeSet<String>,
    ) -> String {
        let of = if self.parent == *parent { "" } else { within(self.parent.as_str(), lineage) };
        let change = self.change.as_ref().map(Change::cells);
        let own = [within(self.attempt.as_str(), lineage).to_string(), self.ended.clone(), of.into()];
        let problems = self.problems.join("; ");
        let says = [
            self.verdict.clone().unwrap_or(problems),
            in_groups(self.operations_beside(&COMPACT, parts, written)).join("; "),
            cut(&self.hypothesis, HYPOTHESIS_CHARS),
        ];
        line(own.into_iter().chain(change.unwrap_or([const { String::new() }; CHANGE_HEAD.len()])).chain(says))
    }

    /// Heads of the columns of compact rows.
    pub fn compact_head() -> String {
        let change = CHANGE_HEAD.join(BAR);
        format!("attempt|ended|parent, if another|{change}|gates or problems|operations|hypothesis")
    }

    /// Its operations: one whose value stands in the parent is not written out again, and one that another edit of the list wrote out
    /// neither.
    fn operations_beside(&self, style: &Style, parts: &Value, written: &mut BTreeSet<String>) -> Vec<String> {
        let texts = self.operations.iter().map(|of| {
            let whole = (style.whole)(of);
            let again = |how: &str| format!("{} {}{how}", word(of.op), (style.place)(&of.path));
            if of.value.is_some() && of.value.as_ref() == parts.pointer(&of.path) {
                return again(style.as_in_parent);
            }
            if !written.insert(whole.clone()) && whole.len() > REPEATED_CHARS {
                return again(style.as_above);
            }
            whole
        });
        texts.collect()
    }
}

/// How a form of questions writes operations.
struct Style {
    whole: fn(&Operation) -> String,
    place: fn(&str) -> String,
    as_in_parent: &'static str,
    as_above: &'static str,
}

const DETAILED: Style = Style {
    whole: |of| operation(of, DETAILED_VALUE_CHARS),
    place: str::to_string,
    as_in_parent: ": as in the parent",
    as_above: ": as written above",
};

const COMPACT: Style =
    Style { whole: compact_operation, place: short_place, as_in_parent: "=parent", as_above: "=above" };

fn compact_operation(of: &Operation) -> String {
    let value = of.value.as_ref().map(|value| format!(": {}", cut(&part_text(value), DETAILED_VALUE_CHARS)));
    format!("{} {}{}", word(of.op), short_place(&of.path), value.unwrap_or_default())
}

/// Neighbours that do the same to parts of one sort as one: `remove node a b`, `add node a b=parent`.
fn in_groups(operations: Vec<String>) -> Vec<String> {
    let parts = |text: &str| {
        let (head, how) =
            text.split_once('=').filter(|(_, how)| ["parent", "above"].contains(how)).unwrap_or((text, ""));
        let (act, name) = head.rsplit_once(' ')?;
        let bare = !head.contains(':') && (!how.is_empty() || act.starts_with("remove"));
        bare.then(|| (act.to_string(), name.to_string(), how.to_string()))
    };
    let mut groups: Vec<String> = Vec::new();
    let mut open: Option<(String, String)> = None;
    for text in operations {
        let now = parts(&text);
        let key = now.as_ref().map(|(act, _, how)| (act.clone(), how.clone()));
        match (&now, groups.last_mut()) {
            (Some((_, name, how)), Some(last)) if key == open => {
                let how = if how.is_empty() { String::new() } else { format!("={how}") };
                let end = last.len() - how.len();
                last.replace_range(end.., &format!(" {name}{how}"));
            }
            _ => groups.push(text),
        }
        open = key;
    }
    groups
}

/// A path with the part's name in a word.
fn short_place(path: &str) -> String {
    const PARTS: [(&str, &str); 4] = [
        ("/mechanism_modules/", "module "),
        ("/operator_graph/", "node "),
        ("/parameters/", "parameter "),
        ("/scenario_conditioned_policy/", "rule "),
    ];
    let short = PARTS.iter().find_map(|(part, word)| Some(format!("{word}{}", path.strip_prefix(part)?)));
    short.unwrap_or_else(|| path.to_string())
}

/// How a form of questions writes a difference and its standard error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Numbers {
    /// With three decimals.
    Decimals,
    /// In thousandths.
    Thousandths,
}

impl Numbers {
    /// `+0.033 ± 0.041`, or `+33±41`.
    pub fn difference(self, value: f64, error: Option<f64>) -> String {
        match (self, error) {
            (Numbers::Decimals, Some(error)) => format!("{value:+.3} ± {error:.3}"),
            (Numbers::Decimals, None) => format!("{value:+.3}"),
            (Numbers::Thousandths, Some(error)) => format!("{}±{:.0}", thousandths(value), error * 1000.0),
            (Numbers::Thousandths, None) => thousandths(value),
        }
    }
}

fn thousandths(x: f64) -> String {
    format!("{:+}", num::rounded(x * 1000.0, 0) as i64)
}

/// Heads of the columns that a compact row gives a change.
const CHANGE_HEAD: [&str; 9] =
    ["scenes", "attack", "realism", "near misses", "coverage", "diagnostics", "clusters", "won", "lost"];

impl Change {
    /// Its largest changes alone.
    fn most(&self) -> Change {
        let largest = |all: &BTreeMap<String, f64>| {
            let mut sorted: Vec<(&String, &f64)> = all.iter().collect();
            sorted.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(b.0)));
            sorted.into_iter().take(LARGEST).map(|(name, x)| (name.clone(), *x)).collect()
        };
        let first = |all: &[String]| match all.len() {
            0 => Vec::new(),
            count => vec![format!("{count}, e.g. {}", all[0])],
        };
        Change {
            diagnostics: largest(&self.diagnostics),
            clusters: largest(&self.clusters),
            won: first(&self.won),
            lost: first(&self.lost),
            ..self.clone()
        }
    }

    /// Its largest changes as cells under [`CHANGE_HEAD`].
    fn cells(&self) -> [String; CHANGE_HEAD.len()] {
        let most = self.most();
        let of = |(value, error): (f64, Option<f64>)| Numbers::Thousandths.difference(value, error);
        let moved = |all: &BTreeMap<String, f64>| {
            let moved = all.iter().filter(|(_, change)| change.abs() >= CHANGE_MIN);
            moved.map(|(name, x)| format!("{name}{}", thousandths(*x))).collect::<Vec<_>>().join(" ")
        };
        let scenes = |all: &[String]| all.first().map(|first| format!("{} {first}", all.len())).unwrap_or_default();
        let coverage = if self.coverage.abs() < CHANGE_MIN { String::new() } else { thousandths(self.coverage) };
        [
            self.scenes.to_string(),
            of(self.attack),
            of(self.realism),
            self.near.map(|[before, after]| format!("{before}>{after}")).unwrap_or_default(),
            coverage,
            moved(&most.diagnostics),
            moved(&most.clusters),
            scenes(&self.won),
            scenes(&self.lost),
        ]
    }

    /// In one line: what is 0 is left out.
    fn shown(&self) -> String {
        let (attack, realism) = (with_error(self.attack.0, self.attack.1), with_error(self.realism.0, self.realism.1));
        let mut text = format!("{} scenes: attack {attack}, realism {realism}", self.scenes);
        if let Some([before, after]) = self.near {
            text.push_str(&format!(", near misses {before} -> {after}"));
        }
        if self.coverage.abs() >= CHANGE_MIN {
            text.push_str(&format!(", coverage {}", signed(self.coverage)));
        }
        for (title, all) in [("diagnostics", &self.diagnostics), ("clusters", &self.clusters)] {
            let moved = all.iter().filter(|(_, change)| change.abs() >= CHANGE_MIN);
            let moved: Vec<String> = moved.map(|(name, x)| format!("{name} {}", signed(*x))).collect();
            if !moved.is_empty() {
                text.push_str(&format!("; {title} {}", moved.join(", ")));
            }
        }
        for (title, scenes) in [("won", &self.won), ("lost", &self.lost)] {
            if !scenes.is_empty() {
                text.push_str(&format!("; {title} {}", named(scenes)));
            }
        }
        text
    }
}

fn named(scenes: &[String]) -> String {
    let mut text = scenes.iter().take(SCENES_NAMED).cloned().collect::<Vec<_>>().join(", ");
    if scenes.len() > SCENES_NAMED {
        text.push_str(&format!(" and {} more", scenes.len() - SCENES_NAMED));
    }
    text
}

fn word(op: OperationKind) -> &'static str {
    match op {
        OperationKind::Add => "add",
        OperationKind::Replace => "replace",
        OperationKind::Remove => "remove",
    }
}

fn operation(operation: &Operation, chars: usize) -> String {
    let word = word(operation.op);
    match &operation.value {
        Some(value) => format!("{word} {} {}", operation.path, cut(&value_text(value), chars)),
        None => format!("{word} {}", operation.path),
    }
}

/// A module, a node or a rule in words; anything else as JSON.
fn value_text(value: &Value) -> String {
    let field = |name: &str| value[name].as_str().unwrap_or_default();
    let list = |name: &str| {
        let items = value[name].as_array().into_iter().flatten();
        items.filter_map(Value::as_str).collect::<Vec<_>>().join(" ")
    };
    if value.get("expression").is_some() {
        return format!("{}, tags {}: {}", field("slot"), list("tags"), field("expression"));
    }
    if value.get("kind").is_some() {
        let settings = settings(&value["settings"], "");
        return format!("{} {}, inputs {}{settings}", field("slot"), field("kind"), list("inputs"));
    }
    if value.get("when").is_some() {
        let nodes = value["operators"].as_object().into_iter().flatten();
        let nodes = nodes.map(|(node, own)| settings(own, &format!("{node}.")));
        let parameters = settings(&value["parameters"], "");
        return format!("{} when {}{parameters}{}", field("name"), field("when"), nodes.collect::<String>());
    }
    value.as_str().map_or_else(|| value.to_string(), str::to_string)
}

/// `, name = value` for each setting, without those that are the parameter of their name.
fn settings(all: &Value, before: &str) -> String {
    let one = |(name, value): (&String, &Value)| {
        let of = |kind: &str| value[kind].as_str();
        match (of("parameter"), of("mechanism")) {
            (Some(parameter), _) if parameter == name => String::new(),
            (Some(referred), _) | (_, Some(referred)) => format!(", {before}{name} = {referred}"),
            _ => format!(", {before}{name} = {}", value_text(value)),
        }
    };
    all.as_object().into_iter().flatten().map(one).collect()
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

fn with_error(x: f64, error: Option<f64>) -> String {
    match error {
        Some(error) => format!("{} ± {error:.3}", signed(x)),
        None => signed(x),
    }
}
