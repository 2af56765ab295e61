//! Reads a prompt: the JSON blocks under its headings. Only what the rules need is kept.

use serde::{Deserialize, de::DeserializeOwned};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

use super::{
    compact,
    contract::{Contract, Kind},
    free,
    refusal::unanswerable,
};
use crate::llm::{ModelError, Request};

/// A parsed request.
#[derive(Debug)]
pub struct PromptView {
    pub identity: Identity,
    pub contract: Contract,
    pub foreign: Vec<String>,
    /// The parent's four editable parts as JSON.
    pub parts: Value,
    pub program: Program,
    pub memory: Vec<Card>,
    pub clusters: Vec<Cluster>,
    pub outcome: Option<ParentOutcome>,
    pub history: Vec<PastEdit>,
    pub asked: Asked,
    /// The patch of a critic or of a repair, free constants at their first values.
    pub patch: Option<Value>,
    /// True if a patch may leave constants free.
    pub tunes: bool,
    pub reviews: Vec<Review>,
    /// Problems that the gates have with the patch, by the gate's name.
    pub refused: BTreeMap<String, Vec<String>>,
    /// True if the prompt says that a chain of terms is one level of an expression's depth.
    pub chains_are_one_level: bool,
    /// The text that a repair could not be shown as a patch.
    pub unreadable: Option<String>,
}

#[derive(Debug, Deserialize)]
pub struct Identity {
    #[serde(rename = "source_baseline")]
    pub source_family: String,
    pub parent_solution_id: String,
    pub parent_program_hash: String,
}

/// The parts of a program that may be edited, as every prompt says.
pub const EDITABLE: [&str; 4] =
    ["/parameters", "/operator_graph", "/scenario_conditioned_policy", "/mechanism_modules"];

#[derive(Clone, Debug, Deserialize)]
pub struct Program {
    pub parameters: BTreeMap<String, Value>,
    pub operator_graph: BTreeMap<String, Node>,
    pub scenario_conditioned_policy: Vec<Rule>,
    pub mechanism_modules: BTreeMap<String, Module>,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Node {
    pub slot: String,
    pub kind: String,
    #[serde(default)]
    pub settings: BTreeMap<String, Value>,
    #[serde(default)]
    pub inputs: Vec<String>,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Rule {
    pub name: String,
    pub when: String,
    #[serde(default)]
    pub parameters: BTreeMap<String, Value>,
    #[serde(default)]
    pub operators: BTreeMap<String, BTreeMap<String, Value>>,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Module {
    pub slot: String,
    pub inputs: Vec<String>,
    pub output: String,
    pub expression: String,
    #[serde(default)]
    pub tags: Vec<String>,
}

#[derive(Debug, Deserialize)]
pub struct Card {
    pub id: String,
    pub kind: String,
    #[serde(default)]
    pub mechanism_tags: Vec<String>,
}

#[derive(Debug)]
pub struct Cluster {
    pub name: String,
    pub attacked_share: Option<f64>,
    pub features: BTreeMap<String, f64>,
}

#[derive(Debug, Deserialize)]
pub struct ParentOutcome {
    pub diagnostics: BTreeMap<String, f64>,
    pub weakest_diagnostic: Option<String>,
}

/// An earlier patch of the lineage.
#[derive(Debug, Deserialize)]
pub struct PastEdit {
    /// As text.
    pub operations: Vec<String>,
    /// Change that it made against its parent, where it was simulated.
    pub change: Option<PastChange>,
}

/// `14 scenes: attack -0.071 ± 0.071, realism -0.006 ± 0.014, ..`.
#[derive(Debug, Deserialize)]
#[serde(transparent)]
pub struct PastChange(String);

impl PastEdit {
    /// Returns `true` if a module that it wrote has the tag.
    pub fn has_tag(&self, tag: &str) -> bool {
        let tags = self.operations.iter().filter_map(|text| text.split_once(", tags ")?.1.split_once(": "));
        tags.into_iter().any(|(tags, _)| tags.split(' ').any(|other| other == tag))
    }
}

impl PastChange {
    pub fn realism(&self) -> f64 {
        let said = self.0.split_once("realism ").and_then(|(_, rest)| rest.split([' ', ',', ';']).next());
        said.and_then(|text| text.parse().ok()).unwrap_or(0.0)
    }
}

#[derive(Debug, Deserialize)]
pub struct Asked {
    pub response_id: String,
    pub target: Target,
}

#[derive(Debug, Deserialize)]
pub struct Target {
    /// `raise_attack`, `raise_realism` or `diversify`.
    pub kind: String,
}

#[derive(Debug, Deserialize)]
pub struct Review {
    pub decision: String,
    pub blockers: Vec<String>,
    pub repair_hints: Vec<String>,
}

impl PromptView {
    pub fn read(request: &Request) -> Result<PromptView, ModelError> {
        let mut blocks: BTreeMap<String, Value> = request.messages.iter().flat_map(|m| blocks(&m.text)).collect();
        if compact::is_compact(&blocks) {
            compact::at_length(&mut blocks, &request.messages)?;
        }
        let contract = Contract::read(&take::<String>(&blocks, "Family contract")?)?;
        let parts = whole(take(&blocks, "Parent program")?, &contract);
        Ok(PromptView {
            identity: take(&blocks, "Identity")?,
            contract,
            foreign: foreign(&blocks),
            program: typed("Parent program", &parts)?,
            parts,
            memory: take(&blocks, "Memory")?,
            clusters: clusters(&take::<String>(&blocks, "Scene clusters")?)?,
            outcome: take(&blocks, "Outcomes")?,
            history: take(&blocks, "Edit history")?,
            asked: take(&blocks, "Task")?,
            patch: blocks.get("Patch").cloned().map(free::bound),
            tunes: blocks.contains_key("Free constants"),
            reviews: blocks.get("Reviews").map(|value| typed("Reviews", value)).transpose()?.unwrap_or_default(),
            refused: refused(&blocks),
            chains_are_one_level: request.messages.iter().any(|message| message.text.contains("one level of depth")),
            unreadable: blocks.get("Unreadable reply").and_then(|v| v["text"].as_str()).map(String::from),
        })
    }

    /// The reply object around a patch or a review.
    pub fn answer(&self, field: &str, content: Value) -> Value {
        json!({"response_id": self.asked.response_id, field: content})
    }

    pub fn target(&self) -> &str {
        &self.asked.target.kind
    }

    /// Tags of mechanisms that memory calls failed and not also successful.
    pub fn failed_tags(&self) -> BTreeSet<&str> {
        let good = self.tags_of("success");
        self.tags_of("failure").into_iter().filter(|tag| !good.contains(tag)).collect()
    }

    pub fn tags_of(&self, kind: &str) -> BTreeSet<&str> {
        let cards = self.memory.iter().filter(|card| card.kind == kind);
        cards.flat_map(|card| card.mechanism_tags.iter().map(String::as_str)).collect()
    }

    /// Names that a module of the slot may read. Conditions have no slot and read scene features and parameters only.
    pub fn readable(&self, slot: Option<&str>) -> BTreeSet<&str> {
        let numeric = self.contract.parameters.iter().filter(|(_, domain)| domain.is_numeric());
        let of_slot = slot.and_then(|slot| self.contract.mechanism_slots.get(slot)).map(|slot| &slot.reads);
        let features = self.contract.scene_features.iter().chain(of_slot.into_iter().flatten());
        features.chain(numeric.map(|(name, _)| name)).map(String::as_str).collect()
    }

    pub fn kind(&self, slot: &str, kind: &str) -> Option<&Kind> {
        self.contract.operators.get(slot)?.kinds.get(kind)
    }

    /// A numeric parameter's value in the parent.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.program.parameters.get(name)?.as_f64()
    }

    /// The weakest realism diagnostic of the outcomes, if it is below 1.
    pub fn weakest(&self) -> Option<(&str, f64)> {
        let parent = self.outcome.as_ref()?;
        let name = parent.weakest_diagnostic.as_deref()?;
        parent.diagnostics.get(name).filter(|value| **value < 1.0).map(|value| (name, *value))
    }
}

/// The parent with the settings that the prompt does not show: those that refer to the parameter of their name.
fn whole(mut parts: Value, contract: &Contract) -> Value {
    for node in parts["operator_graph"].as_object_mut().into_iter().flatten().map(|(_, node)| node) {
        let slot = node["slot"].as_str().and_then(|slot| contract.operators.get(slot));
        let kind = slot.zip(node["kind"].as_str()).and_then(|(slot, kind)| slot.kinds.get(kind));
        let hidden = kind.into_iter().flat_map(|kind| &kind.settings);
        let hidden = hidden.filter(|(name, domain)| domain.required && contract.parameters.contains_key(*name));
        for (name, _) in hidden {
            if node["settings"].get(name).is_none() {
                node["settings"][name] = json!({"parameter": name});
            }
        }
    }
    parts
}

/// Words of other families; a run of one family shows none.
fn foreign(blocks: &BTreeMap<String, Value>) -> Vec<String> {
    let words = blocks.get("Words of other families").and_then(Value::as_str).unwrap_or_default();
    words.split_whitespace().map(str::to_string).collect()
}

/// The gates of the findings that did not pass, with their problems.
fn refused(blocks: &BTreeMap<String, Value>) -> BTreeMap<String, Vec<String>> {
    let gates = blocks.get("Findings").and_then(|findings| findings["gates"].as_object());
    let problems = |said: &Value| {
        let texts = said.as_array()?.iter().filter_map(Value::as_str);
        Some(texts.map(str::to_string).collect::<Vec<String>>())
    };
    gates.into_iter().flatten().filter_map(|(gate, said)| Some((gate.clone(), problems(said)?))).collect()
}

/// The table of clusters: `ref | scenes | attacked | <feature> | .. | describes`, the first line its head.
fn clusters(text: &str) -> Result<Vec<Cluster>, ModelError> {
    let mut rows = text.lines().map(|line| line.split(" | ").collect::<Vec<&str>>());
    let head = rows.next().unwrap_or_default();
    let row = |cells: Vec<&str>| {
        let named = || head.iter().copied().zip(cells.iter().copied());
        let name = named().find(|(title, _)| *title == "ref").map(|(_, name)| name.to_string());
        let numbers = named().filter_map(|(title, cell)| Some((title, cell.parse::<f64>().ok()?)));
        let mut features: BTreeMap<String, f64> = numbers.map(|(title, x)| (title.to_string(), x)).collect();
        features.remove("scenes");
        let attacked_share = features.remove("attacked");
        name.map(|name| Cluster { name, attacked_share, features })
    };
    let read: Option<Vec<Cluster>> = rows.map(row).collect();
    read.ok_or_else(|| unanswerable("the prompt's block `Scene clusters` has no column `ref`"))
}

/// `## title` followed by a fenced block, for every such pair: JSON, or a text that stays one. Prompts put no raw line break inside a
/// JSON string, so a line that begins with a fence ends the block.
pub fn blocks(text: &str) -> Vec<(String, Value)> {
    let mut edits = vec![];
    let (mut title, mut body, mut is_json) = (None::<String>, None::<String>, false);
    for line in text.lines() {
        match (&mut body, line) {
            (Some(open), "```") => {
                let value = if is_json { serde_json::from_str(open).ok() } else { Some(Value::from(open.as_str())) };
                edits.extend(title.clone().zip(value));
                body = None;
            }
            (Some(open), _) => {
                open.push_str(line);
                open.push('\n');
            }
            (None, "```json" | "```text") => (body, is_json) = (Some(String::new()), line == "```json"),
            (None, _) => title = line.strip_prefix("## ").map(str::to_string).or(title),
        }
    }
    edits
}

pub fn take<T: DeserializeOwned>(blocks: &BTreeMap<String, Value>, title: &str) -> Result<T, ModelError> {
    let value = blocks.get(title).ok_or_else(|| unanswerable(format!("the prompt has no JSON block `{title}`")))?;
    typed(title, value)
}

fn typed<T: DeserializeOwned>(title: &str, value: &Value) -> Result<T, ModelError> {
    T::deserialize(value).map_err(|error| unanswerable(format!("the prompt's block `{title}`: {error}")))
}
