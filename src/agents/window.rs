//! The parent's outcome in each scene of the window, as a table that prompts show.

use serde_json::{Value, json};
use std::collections::BTreeMap;

use crate::kernel::num;

/// A diagnostic at or above this is not shown.
const SATISFIED: f64 = 0.995;

/// What the parent did in one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneRow {
    /// Id of the scene.
    pub scene: String,
    /// The group of scenes that it belongs to.
    pub cluster: String,
    /// Words for the place and its traffic that not nearly every scene has.
    pub tags: Vec<String>,
    /// Ids of the adversaries.
    pub actors: Vec<String>,
    /// The label, 0..=1.
    pub attack: f64,
    /// What became of it, one word.
    pub outcome: &'static str,
    /// Class of the ego's contact, if it met anyone.
    pub contact: Option<String>,
    /// Smallest distance of the ego to an adversary, metres.
    pub nearest_m: Option<f64>,
    /// What the compiler has to say, e.g. a filter that refused every candidate.
    pub note: String,
    /// d_j of each diagnostic, 1 = satisfied.
    pub diagnostics: BTreeMap<String, f64>,
}

const COLUMNS: [&str; 9] =
    ["scene", "cluster", "tags", "adversaries", "attack", "outcome", "contact", "nearest_m", "below_1"];

/// The table, its rows one a line.
pub fn table(rows: &[SceneRow]) -> Value {
    json!({"columns": COLUMNS, "rows": rows.iter().map(row).collect::<Vec<Value>>()})
}

fn row(row: &SceneRow) -> Value {
    let below = row.diagnostics.iter().filter(|(_, value)| **value < SATISFIED);
    let mut below: Vec<String> = below.map(|(name, value)| format!("{name} {}", num::rounded(*value, 2))).collect();
    if !row.note.is_empty() {
        below.push(row.note.clone());
    }
    json!([
        row.scene,
        row.cluster,
        row.tags.join(" "),
        row.actors.join(" "),
        num::rounded(row.attack, 3),
        row.outcome,
        row.contact.as_deref().unwrap_or("none"),
        row.nearest_m.map(|m| num::rounded(m, 1)),
        below.join("; "),
    ])
}
