//! The report: one self-contained HTML file that opens offline.

mod beside;
mod credit;
mod data;
mod packed;
mod stage;
mod terms;

pub use beside::{Beside, Live};
pub use stage::{Playable, Stage, Unplayed};

use super::figures;
use super::recorded_run::RecordedRun;
use crate::draw::{PLAYER_CSS, PLAYER_JS, script_json};

const PAGE: &str = include_str!("assets/page.html");
const STYLE: &str = include_str!("assets/style.css");
const UNPACK: &str = include_str!("assets/unpack.js");
const SCRIPT: &str = include_str!("assets/report.js");

/// The page. Text from scenes, models and programs goes in as JSON and reaches the page as text nodes only.
pub fn html(run: &RecordedRun, stage: &Stage, beside: &Beside<'_>) -> String {
    let data = script_json(&(data::of(run, beside), packed::stage(stage), figures::of_run(run)));
    // One pass over the page, so that nothing inserted is searched for another mark.
    let parts = [
        ("/*STYLE*/", format!("{PLAYER_CSS}\n{STYLE}")),
        ("/*DATA*/", packed::held(data)),
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
