//! Held-out scenes in which a program that a result names has no label: the driver under test ended there, or the program could not be
//! compiled. Their numbers rest on the other scenes.

use super::RecordedRun;
use crate::objects::event::LineageResult;
use crate::objects::{SceneFailure, SolutionId};

/// One sentence a lineage in which parent or evolved program has no label in some held-out scene; nothing where all are labelled.
pub fn unlabelled(story: &RecordedRun) -> Vec<String> {
    story.result.iter().flat_map(|result| &result.lineages).filter_map(|lineage| told(story, lineage)).collect()
}

fn told(story: &RecordedRun, lineage: &LineageResult) -> Option<String> {
    let failed = |solution: &SolutionId| -> &[SceneFailure] {
        let own = story.held_out.iter().find(|h| h.lineage == lineage.lineage && h.solution == *solution);
        own.map_or(&[], |held_out| held_out.score.failures.as_slice())
    };
    let (parent, evolved) = (failed(&lineage.parent.solution), failed(&lineage.evolved.solution));
    let first = parent.first().or(evolved.first())?;
    let all = lineage.held_out_scenes;
    let [parent, evolved] = [parent, evolved].map(|failed| all.saturating_sub(failed.len()));
    Some(format!(
        "{}: of {all} held-out scenes the parent is labelled in {parent} and the evolved program in {evolved}, and their numbers rest on \
         these alone; {} has none, because {}. A driver that ends where it is in trouble looks safer than it is; `evodrive table` pairs \
         the scenes that both are labelled in.",
        lineage.lineage,
        first.scene,
        on_one_line(&first.reason)
    ))
}

/// Most characters of a reason.
const REASON_CHARS: usize = 300;

/// The end of a long reason says most: it is that of a program's standard error.
fn on_one_line(reason: &str) -> String {
    let words: Vec<char> = reason.split_whitespace().collect::<Vec<_>>().join(" ").chars().collect();
    match words.len().checked_sub(REASON_CHARS) {
        Some(cut) if cut > 0 => format!("..{}", words[cut..].iter().collect::<String>()),
        _ => words.into_iter().collect(),
    }
}
