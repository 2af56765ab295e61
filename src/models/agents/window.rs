//! The parent's outcome in each scene of the window, as a table that prompts show.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    encounter::{Encounter, short},
    tables::{BAR, BAR_INSIDE, line},
};
use crate::kernel::num;

/// A diagnostic at or above this is not shown.
const SATISFIED: f64 = 0.995;

/// Outcome of the parent in one scene.
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
    /// Outcome, one word.
    pub outcome: &'static str,
    /// Class of the ego's contact, if it met anyone.
    pub contact: Option<String>,
    /// Smallest distance of the ego to an adversary, metres.
    pub nearest_m: Option<f64>,
    /// Note of the compiler, e.g. a filter that refused every candidate.
    pub note: String,
    /// d_j of each diagnostic, 1 = satisfied.
    pub diagnostics: BTreeMap<String, f64>,
    /// Values of the experiment's own metrics.
    pub metrics: BTreeMap<String, f64>,
    /// How it came about; only in detailed questions.
    pub encounter: Option<Encounter>,
}

/// Heads of the table's columns.
const HEAD: &str = "scene | place and tags | adversaries | outcome | nearest_m | below 1";
/// The same in compact questions.
const COMPACT_HEAD: &str = "scene|place|adversaries|outcome|near_m|below 1";
/// Between two cells of a row.
const BETWEEN: &str = " | ";

/// The rows of the table in a prompt, without their head; none where the prompt has no table.
pub fn rows_in(prompt: &str) -> impl Iterator<Item = &str> {
    let behind = prompt.split_once(HEAD).or_else(|| prompt.split_once(COMPACT_HEAD)).map_or("", |(_, behind)| behind);
    behind.lines().skip(1).take_while(|line| line.contains(BETWEEN) || line.contains(BAR))
}

/// The scene of such a row, if it is one of those that are known. A scene's id may hold anything, also what stands between cells; a compact
/// row has another sign for a bar.
pub fn scene_of<'k>(row: &str, known: &BTreeSet<&'k str>) -> Option<&'k str> {
    let mut ends = row.match_indices(BETWEEN).chain(row.match_indices(BAR));
    let known = |id: &str| known.get(id).copied();
    ends.find_map(|(end, _)| known(&row[..end]).or_else(|| known(&row[..end].replace(BAR_INSIDE, BAR))))
}

/// The table of a compact question: what all rows would repeat stands in the head.
pub fn compact_table(rows: &[SceneRow]) -> String {
    let mut head: Vec<&str> = COMPACT_HEAD.split(BAR).chain(Encounter::COMPACT_HEAD).collect();
    let measured = rows.iter().any(|row| !row.metrics.is_empty());
    head.extend(measured.then_some("measured"));
    let row = |row: &SceneRow| {
        let how = row.encounter.clone().unwrap_or_default().cells();
        let measured = measured.then(|| row.measured());
        line(row.cells(|m| m.map_or_else(String::new, short)).into_iter().chain(how).chain(measured))
    };
    [head.join(BAR)].into_iter().chain(rows.iter().map(row)).collect::<Vec<_>>().join("\n")
}

/// The table, a row a line. Detailed rows say in further columns how the scene came about.
pub fn table(rows: &[SceneRow]) -> String {
    let mut head = HEAD.to_string();
    if rows.iter().any(|row| row.encounter.is_some()) {
        head += &format!(" | {}", Encounter::HEAD);
    }
    if rows.iter().any(|row| !row.metrics.is_empty()) {
        head += " | measured";
    }
    [head].into_iter().chain(rows.iter().map(row)).collect::<Vec<_>>().join("\n")
}

impl SceneRow {
    /// The cells that every row has.
    fn cells(&self, nearest: impl Fn(Option<f64>) -> String) -> [String; 6] {
        let row = self;
        let below = row.diagnostics.iter().filter(|(_, value)| **value < SATISFIED);
        let mut below: Vec<String> = below.map(|(name, value)| format!("{name} {}", num::rounded(*value, 2))).collect();
        if !row.note.is_empty() {
            below.push(row.note.clone());
        }
        let tags = row.tags.iter().filter(|tag| **tag != row.cluster).map(String::as_str);
        let place: Vec<&str> = [row.cluster.as_str()].into_iter().chain(tags).collect();
        let contact = row.contact.as_deref().map(|class| format!(" {class}")).unwrap_or_default();
        // Most attacks are 0 or 1, which the outcome says.
        let whole = row.attack <= 0.0 || row.attack >= 1.0;
        let share = if whole { String::new() } else { format!(" {}", num::rounded(row.attack, 3)) };
        let outcome = format!("{}{share}{contact}", row.outcome);
        [row.scene.clone(), place.join(" "), row.actors.join(" "), outcome, nearest(row.nearest_m), below.join("; ")]
    }

    /// Values of the experiment's own metrics.
    fn measured(&self) -> String {
        let measured = self.metrics.iter().map(|(name, value)| format!("{name} {}", num::rounded(*value, 3)));
        measured.collect::<Vec<_>>().join("; ")
    }
}

fn row(row: &SceneRow) -> String {
    let nearest = |m: Option<f64>| m.map_or("-".to_string(), |m| num::rounded(m, 1).to_string());
    let mut line = row.cells(nearest).join(BETWEEN);
    if let Some(encounter) = &row.encounter {
        line += &format!("{BETWEEN}{}", encounter.shown());
    }
    if row.metrics.is_empty() {
        return line;
    }
    format!("{line} | {}", row.measured())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row_of(scene: &str) -> SceneRow {
        SceneRow {
            scene: scene.into(),
            cluster: "junction".into(),
            tags: vec![],
            actors: vec!["7".into()],
            attack: 0.0,
            outcome: "missed",
            contact: None,
            nearest_m: None,
            note: String::new(),
            diagnostics: BTreeMap::new(),
            metrics: BTreeMap::new(),
            encounter: None,
        }
    }

    #[test]
    fn the_rows_of_a_prompt_are_read_back_with_their_scenes_whatever_an_id_holds() {
        let ids = ["synth/merge/7/13", "a | b", "a"];
        let known = BTreeSet::from(["synth/merge/7/13", "a | b"]);
        for table in [table as fn(&[SceneRow]) -> String, compact_table] {
            let prompt = format!("## Window\n```text\n{}\n```\nx | y | z\n", table(&ids.map(row_of)));
            let rows: Vec<&str> = rows_in(&prompt).collect();
            assert_eq!(rows.len(), 3, "{rows:?}");
            let found: Vec<_> = rows.iter().map(|row| scene_of(row, &known)).collect();
            assert_eq!(found, [Some("synth/merge/7/13"), Some("a | b"), None]);
        }
        assert_eq!(rows_in("## Rules\nx | y\n").count(), 0);
    }
}
