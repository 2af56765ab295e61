//! The report: one self-contained HTML file that opens offline.

mod data;
mod packed;

use std::collections::BTreeMap;

use super::recorded_run::RecordedRun;
use crate::draw::{Actor, Contact, Drawing, PLAYER_CSS, PLAYER_JS, script_json};
use crate::objects::cost::RunCost;

const PAGE: &str = include_str!("assets/page.html");
const STYLE: &str = include_str!("assets/style.css");
const UNPACK: &str = include_str!("assets/unpack.js");
const SCRIPT: &str = include_str!("assets/report.js");

/// Rollouts to play, and the scenes in which they happened.
#[derive(Clone, Debug, Default)]
pub struct Stage {
    /// Scene id -> the scene as it was recorded.
    pub scenes: BTreeMap<String, Drawing>,
    pub rollouts: Vec<Playable>,
}

/// A rollout as what it changed: actors not named here move as recorded.
#[derive(Clone, Debug)]
pub struct Playable {
    pub solution: String,
    /// `parent`, `active`, `front`, ...
    pub role: String,
    pub scene: String,
    pub changed: Vec<Actor>,
    pub contact: Option<Contact>,
    /// One line on how it ended.
    pub caption: String,
}

/// The page. Text from scenes, models and programs goes in as JSON and reaches the page as text nodes only.
/// `cost` is what the run cost, where that is known.
pub fn html(story: &RecordedRun, stage: &Stage, cost: Option<&RunCost>) -> String {
    let data = script_json(&(data::of(story, cost), packed::stage(stage)));
    // One pass over the page, so that nothing inserted is searched for another mark.
    let parts = [
        ("/*STYLE*/", format!("{PLAYER_CSS}\n{STYLE}")),
        ("/*DATA*/", data),
        ("/*PLAYER*/", PLAYER_JS.into()),
        ("/*SCRIPT*/", format!("{UNPACK}\n{SCRIPT}")),
    ];
    let mut page = String::with_capacity(PAGE.len() + parts.iter().map(|(_, text)| text.len()).sum::<usize>());
    let mut rest = PAGE;
    for (mark, text) in parts {
        let (before, after) = rest.split_once(mark).unwrap_or((rest, ""));
        page.push_str(before);
        page.push_str(&text);
        rest = after;
    }
    page.push_str(rest);
    page
}
