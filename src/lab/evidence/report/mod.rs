//! The report: one self-contained HTML file that opens offline.

mod answer;
mod beside;
mod credit;
mod data;
mod growth;
mod headline;
mod manoeuvre;
mod mechanism;
mod others;
mod packed;
mod pairs;
mod spread;
mod stage;
mod terms;
mod trust;

pub use beside::{Beside, Live, Words};
pub use headline::shown;
pub use manoeuvre::{Approach, Gained, Manoeuvre};
pub use mechanism::phrase as patch_in_words;
pub use others::{Other, OtherRow};
pub use stage::{Playable, Stage, Unplayed};

use super::figures;
use super::recorded_run::RecordedRun;
use crate::draw::{PLAYER_CSS, PLAYER_JS, escaped, script_json};
use crate::objects::LineageId;

const PAGE: &str = include_str!("assets/page.html");
const STYLE: &str = include_str!("assets/style.css");
const UNPACK: &str = include_str!("assets/unpack.js");
/// The page's script in the order in which its parts need each other.
const SCRIPT: [&str; 11] = [
    include_str!("assets/tools.js"),
    include_str!("assets/tables.js"),
    include_str!("assets/charts.js"),
    include_str!("assets/player.js"),
    include_str!("assets/answer.js"),
    include_str!("assets/front.js"),
    include_str!("assets/attempts.js"),
    include_str!("assets/scenes.js"),
    include_str!("assets/agreement.js"),
    include_str!("assets/records.js"),
    include_str!("assets/page.js"),
];

/// The page. Text from scenes, models and programs goes in as JSON and reaches the page as text nodes, but for the first
/// screen, which is escaped markup.
pub fn html(run: &RecordedRun, stage: &Stage, beside: &Beside<'_>) -> String {
    let headlines = headline::headlines(run);
    let lineages: Vec<LineageId> = headlines.iter().map(|headline| headline.lineage.clone()).collect();
    let data = script_json(&(
        data::of(run, &headlines, stage, beside),
        packed::stage(stage),
        figures::of_run(run, &lineages, beside.credits),
    ));
    // One pass over the page, so that nothing inserted is searched for another mark.
    let parts = [
        ("/*TITLE*/", format!("{} – EvoDrive report", escaped(&run.opened.name))),
        ("/*STYLE*/", format!("{PLAYER_CSS}\n{STYLE}")),
        ("/*HEADER*/", answer::header(run)),
        ("/*ANSWER*/", answer::html(run, &headlines, stage, beside.selector.realism_min)),
        ("/*DATA*/", packed::held(data)),
        ("/*PLAYER*/", PLAYER_JS.into()),
        ("/*SCRIPT*/", format!("{UNPACK}\n{}", SCRIPT.join("\n"))),
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
