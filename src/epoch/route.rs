//! A worker's last step: the world evaluator predicts what rollouts would show and says whether they are worth their cost.

use super::{
    RunError,
    draft::{Draft, Reached, RoutedCandidate},
    freeze::Snapshot,
    study::Study,
};
use crate::objects::{AttemptId, Candidate, ProgramPatch};
use crate::world::{Router, candidate_features, features, monitor_stream};

/// Routes an admitted candidate.
pub fn route(study: &Study, snapshot: &Snapshot<'_>, router: &Router<'_>, draft: Draft) -> Result<Draft, RunError> {
    draft.next(|slot, reached| match reached {
        Reached::Admitted { gates, candidate, patch } => {
            let routed = Box::new(routed(study, snapshot, router, slot, *candidate, &patch)?);
            Ok(Reached::Routed { gates, routed })
        }
        ended => Ok(ended),
    })
}

fn routed(
    study: &Study,
    snapshot: &Snapshot<'_>,
    router: &Router<'_>,
    slot: u32,
    candidate: Candidate,
    patch: &ProgramPatch,
) -> Result<RoutedCandidate, RunError> {
    let schema = &snapshot.world.schema;
    let of_candidate = candidate_features(
        schema,
        &candidate.program,
        &snapshot.parent_of(slot).program,
        patch,
        &candidate.mechanism_tags,
    )?;
    let mut pairs = Vec::with_capacity(snapshot.window.len());
    for &place in &snapshot.window {
        let entry = &study.scenes[place];
        pairs.push(features(schema, &of_candidate, &entry.scene().id, entry.features(), &entry.interaction)?);
    }
    let attempt = AttemptId::at(&snapshot.spec.id, snapshot.event.epoch, slot);
    let routed = router.route(&pairs, &mut monitor_stream(study.seed, &attempt))?;
    Ok(RoutedCandidate { candidate, route: routed.route, pairs, monitored: routed.monitored })
}
