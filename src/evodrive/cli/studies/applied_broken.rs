//! `apply --scenes-broken`: where the driver under test meets somebody, without a program, under the parent, under the program, and
//! the command that plays each.

use serde_json::{Value, json};
use std::collections::BTreeMap;

use crate::cli::terminal::shell::quoted;
use crate::cli::terminal::width::table_width;
use crate::evidence::aligned::Aligned;
use crate::evidence::tables::prevented;
use crate::objects::replay::Replayed;
use crate::objects::{SceneFailure, Score};
use crate::sim::{Fault, avoided_in_words};
use crate::text::counted;

/// A scene in which somebody is met.
pub struct Broken {
    scene: String,
    /// Without a program, under the parent, under the program.
    cells: [String; 3],
    command: String,
}

/// Scenes with a contact in any of the three, in their order.
pub fn broken(scenes: &[String], replay: &Replayed, parent: &Score, program: &Score, command: &str) -> Vec<Broken> {
    let plain: BTreeMap<&str, String> = replay
        .scenes
        .iter()
        .map(|of| (of.scene.as_str(), if of.contact { "contact".to_string() } else { NOBODY.to_string() }))
        .chain(unlabelled(&replay.failures))
        .collect();
    let [parent, program] = [parent, program].map(met);
    let row = |scene: &String| {
        let cell = |of: &BTreeMap<&str, String>| of.get(scene.as_str()).cloned().unwrap_or_else(|| "no label".into());
        let cells = [cell(&plain), cell(&parent), cell(&program)];
        let breaks = cells.iter().any(|cell| cell != NOBODY && !NO_LABEL.contains(&cell.as_str()));
        breaks.then(|| Broken {
            scene: scene.clone(),
            cells,
            command: format!("{command} --scene {} --out played", quoted(scene)),
        })
    };
    scenes.iter().filter_map(row).collect()
}

const NOBODY: &str = "-";
/// Texts for scenes in which nobody knows whether somebody would have been met.
const NO_LABEL: [&str; 3] = ["no label", "too slow", "abandoned"];

fn unlabelled(failures: &[SceneFailure]) -> impl Iterator<Item = (&str, String)> {
    failures.iter().map(|of| {
        let why = usize::from(of.too_slow) + 2 * usize::from(of.abandoned);
        (of.scene.as_str(), NO_LABEL[why].to_string())
    })
}

/// Returns the contact of each scene: its class, who was met, whether it is preventable, and at fault by nuPlan's rule.
fn met(score: &Score) -> BTreeMap<&str, String> {
    let of = score.scenes.iter().map(|label| {
        let text = label.contact.as_ref().map_or(NOBODY.to_string(), |met| {
            let who = if met.adversary { "" } else { ", a bystander" };
            let preventable = match prevented(met) {
                Some(true) => ", preventable",
                Some(false) => ", not preventable",
                None => "",
            };
            let is_at_fault = met.fault.as_deref().and_then(Fault::named).is_some_and(Fault::is_egos);
            let fault = if is_at_fault { ", at fault" } else { "" };
            let jury = met.avoided_by.map(|of| format!(", {}", avoided_in_words(of)));
            format!("{}{who}{preventable}{fault}{}", met.class, jury.unwrap_or_default())
        });
        (label.scene.as_str(), text)
    });
    of.chain(unlabelled(&score.failures)).collect()
}

pub fn text(broken: &[Broken], scenes: usize, ego: &str) -> String {
    let mut table = Aligned {
        labels: 1,
        words: 3,
        heads: ["scene", "without", "parent", "program"].map(String::from).to_vec(),
        ..Aligned::default()
    };
    for of in broken {
        table.rows.push(std::iter::once(of.scene.clone()).chain(of.cells.clone()).collect());
    }
    let mut text = format!("{ego} meets somebody in {} of {}\n", broken.len(), counted(scenes, "scene"));
    if broken.is_empty() {
        return text + "\n";
    }
    text.push_str(&table.text(table_width()));
    text.push_str("to play each (played/player.html):\n");
    broken.iter().for_each(|of| text.push_str(&format!("  {}\n", of.command)));
    text + "\n"
}

pub fn to_json(broken: &[Broken]) -> Value {
    let row = |of: &Broken| {
        let [without, parent, program] = &of.cells;
        json!({"scene": of.scene, "without": without, "parent": parent, "program": program, "command": of.command})
    };
    broken.iter().map(row).collect()
}
