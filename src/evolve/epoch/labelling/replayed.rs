//! The recorded scenes without a program, against every ego of the study: what all numbers of a run are compared with.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::ego::Policy;
use crate::epoch::RunError;
use crate::epoch::setting::desk::Desk;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::evaluation::{EvaluationError, Playing, replay_row};
use crate::objects::event::kind;
use crate::objects::replay::{ReplayRow, Suite};
use crate::scene::PreparedScene;

/// Records the row of both suites for every ego, in the order of the egos' names.
pub fn record(study: &Study, desk: &mut Desk<'_>) -> Result<Vec<ReplayRow>, RunError> {
    let drivers = study.lineages.iter().flat_map(LineageSpec::by_ego);
    let egos: BTreeMap<&str, &Policy> = drivers.map(|spec| (spec.ego.name(), &spec.ego)).collect();
    let mut rows = Vec::new();
    for ego in egos.into_values() {
        for (suite, places) in [(Suite::Evolution, &study.evolution), (Suite::HeldOut, &study.held_out)] {
            let scenes: Vec<Arc<PreparedScene>> =
                places.iter().map(|&place| study.scenes[place].prepared.clone()).collect();
            let playing = Playing {
                ego,
                simulator: &study.simulator,
                backend: desk.tools.backend,
                seed: study.seed,
                evaluation: &study.evaluation,
            };
            let replayed = replay_row(&scenes, suite, &playing, desk.tools.threads).map_err(EvaluationError::from)?;
            if let Some(replayed) = replayed {
                desk.log.append(kind::REPLAY, &replayed)?;
                rows.push(replayed.row);
            }
        }
    }
    Ok(rows)
}
