//! A race: whoever is to lead must show its gain over its parent (`[archive] race`). It is compared with its parent on all scenes so
//! far, then on twice as many, until the gain is shown, nothing of it is left, or all evolution scenes were seen.
//!
//! A few successes in sixty scenes come by luck, and the best of twenty children has more of it than others. Several looks at one
//! level would let luck in again, so each look gets its part of it (Bonferroni).

use crate::archive::{self, ArchiveOptions};
use crate::epoch::RunError;
use crate::epoch::freeze::{Parent, Snapshot};
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::labelling::measure::measure;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::Study;
use crate::objects::{HashedProgram, Look, Race};

/// Races a child against a parent for a gain at `level`.
pub fn race(
    study: &Study,
    snapshot: &Snapshot<'_>,
    parent: &Parent,
    child: HashedProgram<'_>,
    level: f64,
    tools: &Tools<'_>,
) -> Result<Race, RunError> {
    let labelling = Labelling { study, spec: snapshot.spec, counsels: &snapshot.counsels, tools };
    let order = study.opening_order(snapshot.event.epoch);
    let stages = stages(snapshot.so_far.len(), order.len());
    let level = 1.0 - (1.0 - level) / stages.len() as f64;
    let mut looks = Vec::new();
    for scenes in stages {
        let places = &order[..scenes];
        labelling.ahead(&[child.program, &parent.program], places)?;
        let child = labelling.score(child, places)?;
        let before = labelling.score(parent.hashed(), places)?;
        let measure = measure(study, &[&child, &before], tools)?;
        let beside = archive::Standing { child: &child, parent: &before, front: &[] };
        let at = |level: f64| archive::consider(&beside, &study.archive.at(level), &*measure);
        let gates = Box::new(at(level)?);
        let shown = gates.any();
        looks.push(Look { level, gates });
        if shown || !at(ArchiveOptions::ANY_GAIN)?.any() {
            return Ok(Race { shown, looks });
        }
    }
    Ok(Race { shown: false, looks })
}

/// Returns how many scenes each look takes: those so far, then twice as many, at last all.
fn stages(so_far: usize, all: usize) -> Vec<usize> {
    let doubled = std::iter::successors(Some(so_far.max(1)), |scenes| Some(2 * scenes));
    doubled.take_while(|scenes| *scenes < all).chain([all]).collect()
}

#[cfg(test)]
mod tests {
    use super::stages;

    #[test]
    fn a_race_doubles_its_scenes_and_ends_with_all() {
        assert_eq!(stages(20, 240), [20, 40, 80, 160, 240]);
        assert_eq!(stages(60, 60), [60]);
        assert_eq!(stages(60, 61), [60, 61]);
    }
}
