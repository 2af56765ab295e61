//! Scenes in which a program that a result names, or was chosen from, has no label: the driver under test ended there, or the program
//! could not be compiled. Their numbers rest on the other scenes.

use std::collections::BTreeMap;

use super::RecordedRun;
use crate::objects::event::LineageResult;
use crate::objects::{SceneFailure, SolutionId, abandoned, too_slow};
use crate::text::counted;

/// One sentence a lineage in which parent or evolved program has no label in some held-out scene, and one in which somebody who was
/// compared for the choice has none in some evolution scene; nothing where all are labelled.
pub fn unlabelled(run: &RecordedRun) -> Vec<String> {
    let lineages = || run.result.iter().flat_map(|result| &result.lineages);
    let (held_out, chosen) =
        (lineages().filter_map(|of| note(run, of)), lineages().filter_map(|of| note_on_choice(run, of)));
    held_out.chain(chosen).collect()
}

fn note_on_choice(run: &RecordedRun, lineage: &LineageResult) -> Option<String> {
    let own = run.finalists.iter().filter(|of| of.lineage == lineage.lineage);
    let failures: BTreeMap<&str, &str> =
        own.flat_map(|of| &of.score.failures).map(|of| (of.scene.as_str(), of.reason.as_str())).collect();
    let (scene, reason) = failures.first_key_value()?;
    Some(format!(
        "{}: in {} of {} a program that was compared for the choice has no label, for example in {scene}, because {}. \
         `evodrive data` lists them (table unlabelled).",
        lineage.lineage,
        failures.len(),
        counted(run.opened.evolution_scenes.len(), "evolution scene"),
        on_one_line(reason)
    ))
}

fn note(run: &RecordedRun, lineage: &LineageResult) -> Option<String> {
    let failed = |solution: &SolutionId| -> &[SceneFailure] {
        let own = run.held_out.iter().find(|h| h.lineage == lineage.lineage && h.solution == *solution);
        own.map_or(&[], |held_out| held_out.score.failures.as_slice())
    };
    let (parent, evolved) = (failed(&lineage.parent.solution), failed(&lineage.evolved.solution));
    let first = parent.first().or(evolved.first())?;
    let all = lineage.held_out_scenes;
    let apart = |did: &str, counts: [usize; 2]| match counts {
        [0, 0] => String::new(),
        [parent, evolved] => {
            format!(" The driver {did}, which is neither a crash nor a success, in {parent} and {evolved} of them.")
        }
    };
    let slow = apart("was too slow", [parent, evolved].map(too_slow));
    let gave_up = apart("abandoned the scene", [parent, evolved].map(abandoned));
    let [parent, evolved] = [parent, evolved].map(|failed| all.saturating_sub(failed.len()));
    Some(format!(
        "{}: of {} the parent is labelled in {parent} and the evolved program in {evolved}, and their numbers are \
         over these scenes only; {} has no label, because {}. A driver that fails in difficult scenes looks safer than it is; `evodrive table` \
         pairs the scenes in which both have labels, `evodrive data` lists the others (table unlabelled).{slow}{gave_up}",
        lineage.lineage,
        counted(all, "held-out scene"),
        first.scene,
        on_one_line(&first.reason)
    ))
}

/// Most characters of a reason.
const REASON_CHARS: usize = 300;

/// Shortens a reason from its beginning: the end of a long one says most, being that of a program's standard error.
fn on_one_line(reason: &str) -> String {
    let words: Vec<char> = reason.split_whitespace().collect::<Vec<_>>().join(" ").chars().collect();
    match words.len().checked_sub(REASON_CHARS) {
        Some(cut) if cut > 0 => format!("..{}", words[cut..].iter().collect::<String>()),
        _ => words.into_iter().collect(),
    }
}
