//! The null search in which labels say nothing of the program they stand beside (`search.method = "shuffled_labels"`): what remains
//! of a gain there is what the last choice among finalists finds in programs that were kept blindly.

use std::collections::BTreeMap;

use super::search::stream;
use crate::archive::search::Method;
use crate::epoch::freeze::Snapshot;
use crate::epoch::setting::study::Study;
use crate::epoch::slots::draft::{Draft, Reached};
use crate::objects::{Score, SolutionId};

/// Program and labels on the window that stand in for a slot's own, by slot.
pub type Swapped = BTreeMap<u32, (SolutionId, Score)>;

/// Draws whose labels each labelled candidate of an epoch is judged by: another candidate's, where there is another one, else its
/// parent's, by which nobody gains. Empty under every other method.
pub fn swapped(study: &Study, snapshot: &Snapshot<'_>, drafts: &[Draft]) -> Swapped {
    if study.method() != Method::ShuffledLabels {
        return Swapped::new();
    }
    let labelled = |draft: &Draft| match &draft.reached {
        Reached::Evaluated { routed, score, .. } => {
            Some((draft.head.slot, (routed.candidate.program.solution_id.clone(), score.clone())))
        }
        _ => None,
    };
    let mut all: Vec<(u32, (SolutionId, Score))> = drafts.iter().filter_map(labelled).collect();
    if let [(slot, _)] = all.as_slice() {
        let parent = snapshot.parent_of(*slot);
        return Swapped::from([(*slot, (parent.program.solution_id.clone(), parent.score.clone()))]);
    }
    // Everybody gets the labels of the next one in a drawn order, so nobody keeps its own.
    stream(study, snapshot.spec, snapshot.event.epoch, 0, "labels").shuffle(&mut all);
    let next = all.iter().cycle().skip(1);
    all.iter().zip(next).map(|((slot, _), (_, of))| (*slot, of.clone())).collect()
}
