//! Growth of a lineage's front on one set of scenes: the archive's own hypervolume rests on all scenes used so far, so it also moves when
//! scenes are added.

use serde_json::{Value, json};

use super::super::recorded_run::RecordedRun;
use crate::archive::{hypervolume, point};
use crate::objects::{LineageId, SolutionId};

/// Area under the programs that were there after each epoch, from before the first one on. All are measured on the whole evolution pool,
/// so it never falls; `None` where nobody was.
pub fn of(run: &RecordedRun, lineage: &LineageId) -> Option<Value> {
    let epochs = run.settled.iter().filter(|of| of.lineage == *lineage).map(|of| of.epoch).max()?;
    let born = |solution: &SolutionId| -> i64 {
        let made = |attempt: &&crate::objects::Attempt| {
            attempt.exit.candidate().is_some_and(|of| of.program.solution_id == *solution)
        };
        run.attempts.iter().find(made).map_or(-1, |attempt| i64::from(attempt.epoch))
    };
    let measured: Vec<(i64, [f64; 2])> = run
        .finalists
        .iter()
        .filter(|of| of.lineage == *lineage && of.score.coverage > 0.0)
        .map(|of| (born(&of.solution), point(&of.score.objectives)))
        .collect();
    let scenes = run.finalists.iter().find(|of| of.lineage == *lineage)?.score.scenes.len();
    let reference = run.declared.archive.as_ref().map_or([0.0, 0.0], |archive| archive.reference);
    let area = |epoch: i64| {
        let points: Vec<[f64; 2]> =
            measured.iter().filter(|(born, _)| *born <= epoch).map(|(_, point)| *point).collect();
        hypervolume(&points, reference)
    };
    let points: Vec<Value> = (-1..=i64::from(epochs)).map(|epoch| json!([epoch, area(epoch)])).collect();
    Some(json!({"scenes": scenes, "programs": measured.len(), "points": points}))
}
