//! Outcome of each held-out scene under the parent and under the chosen program: the rows of the page's grid of scenes.

use serde_json::{Value, json};

use super::super::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::{SceneScore, event::LineageResult};

/// `[scene, of the parent, of the chosen]`, each side `[attack, realism where it acts, class of the contact, whether with an adversary]` and
/// nothing where a program has no label; scenes and classes are places in lists.
pub fn of(run: &RecordedRun, result: &LineageResult, scenes: &[String], classes: &[String]) -> Vec<Value> {
    let (parent, chosen) =
        (run.held_out_labels(&result.parent.solution), run.held_out_labels(&result.evolved.solution));
    let side = |label: Option<&&SceneScore>| {
        label.map(|label| {
            let class = label.contact.as_ref().and_then(|met| classes.binary_search(&met.class).ok());
            let adversary = label.contact.as_ref().map(|met| u8::from(met.adversary));
            let realism = label.acted.then(|| num::rounded(label.realism, 3));
            json!([num::rounded(label.attack, 3), realism, class, adversary])
        })
    };
    let place = |scene: &str| scenes.binary_search_by(|known| known.as_str().cmp(scene)).ok();
    let known = parent.keys().chain(chosen.keys().filter(|scene| !parent.contains_key(*scene)));
    known.map(|scene| json!([place(scene), side(parent.get(scene)), side(chosen.get(scene))])).collect()
}
