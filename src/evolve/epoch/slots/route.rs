//! The world evaluator predicts what rollouts would show, candidate by candidate, and says behind the barrier who gets those
//! of the epoch's budget.

use super::draft::{Admitted, Draft, Predicted, Reached, RoutedCandidate};
use crate::epoch::RunError;
use crate::epoch::acceptance::rival;
use crate::epoch::freeze::{Parent, Snapshot};
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::Study;
use crate::objects::{Candidate, Objectives, Route};
use crate::world::{CandidateView, Prediction, Router, SceneView, audit_stream, pair_row, row};

/// A worker's last step: predicts an admitted candidate.
pub fn predict(
    study: &Study,
    snapshot: &Snapshot<'_>,
    router: &Router<'_>,
    draft: Draft,
    tools: &Tools<'_>,
) -> Result<Draft, RunError> {
    draft.next(|slot, reached| match reached {
        Reached::Admitted { gates, admitted } => {
            let parent = snapshot.parent_of(slot);
            let simulated = simulated(study, snapshot, parent, &admitted.candidate, tools)?;
            let predicted = Box::new(predicted(study, snapshot, router, parent, *admitted, simulated)?);
            Ok(Reached::Predicted { gates, predicted })
        }
        ended => Ok(ended),
    })
}

/// Returns what our own simulator shows on the window, candidate less parent, where the evaluator goes by that. `None` elsewhere, and
/// where it can label one of the two in no scene.
fn simulated(
    study: &Study,
    snapshot: &Snapshot<'_>,
    parent: &Parent,
    candidate: &Candidate,
    tools: &Tools<'_>,
) -> Result<Option<Objectives>, RunError> {
    if !study.simulates_before() {
        return Ok(None);
    }
    let labelling = Labelling { study, spec: snapshot.spec, counsels: &snapshot.counsels, tools };
    let own = labelling.predicted(candidate.hashed(), &snapshot.window)?;
    let before = labelling.predicted(parent.hashed(), &snapshot.window)?;
    let difference = own.zip(before).map(|(own, before)| own.objectives.less(&before.objectives));
    Ok(Some(difference.unwrap_or(Objectives { attack: 0.0, realism: 0.0 })))
}

fn predicted(
    study: &Study,
    snapshot: &Snapshot<'_>,
    router: &Router<'_>,
    parent: &Parent,
    Admitted { candidate, patch, probes, in_effect }: Admitted,
    simulated: Option<Objectives>,
) -> Result<Predicted, RunError> {
    let open: Vec<bool> =
        in_effect.iter().zip(&parent.in_effect).map(|(child, parent)| child.digest != parent.digest).collect();
    let scenes = snapshot.window.iter().zip(&open).map(|(&place, &open)| {
        let entry = &study.scenes[place];
        SceneView { id: &entry.scene().id, features: entry.features(), interaction: &entry.interaction, open }
    });
    let view = CandidateView {
        program: &candidate.program,
        parent: &parent.program,
        patch: &patch,
        mechanism_tags: &candidate.mechanism_tags,
        parent_score: &parent.score,
        probes: &probes,
        simulated,
    };
    let (world, scenes) = (&snapshot.world, scenes.collect::<Vec<_>>());
    let row = match world.configuration.pairs {
        Some(_) => pair_row(&world.schema, &view, snapshot.spec.ego.name(), world.fit.as_ref(), &scenes)?,
        None => row(&world.schema, &view, &scenes)?,
    };
    let prediction = router.predict(&row)?;
    Ok(Predicted { candidate, row, prediction, open, pilot: None })
}

/// Gives the rollouts of the epoch's budget to some of the predicted candidates. A draft that failed takes none.
pub fn allot(
    study: &Study,
    snapshot: &Snapshot<'_>,
    router: &Router<'_>,
    drafts: Vec<Result<Draft, RunError>>,
) -> Vec<Result<Draft, RunError>> {
    let prediction = |draft: &Draft| match &draft.reached {
        Reached::Predicted { predicted, .. } => Some(predicted.prediction),
        _ => None,
    };
    let predictions: Vec<Prediction> = drafts.iter().flatten().filter_map(prediction).collect();
    let mut stream = audit_stream(study.seed, &snapshot.spec.id, snapshot.event.epoch);
    let mut routes = router.routes(&predictions, &mut stream).into_iter();
    let mut routed = |draft: Draft| {
        draft.next(|_, reached| match reached {
            Reached::Predicted { gates, predicted } => {
                let Predicted { candidate, row, pilot, .. } = *predicted;
                let missing = || RunError::Study(format!("{} was not routed", candidate.program.solution_id));
                let route = Route { pilot, ..routes.next().ok_or_else(missing)? };
                Ok(Reached::Routed { gates, routed: Box::new(RoutedCandidate { candidate, route, row }) })
            }
            ended => Ok(ended),
        })
    };
    let drafts = drafts.into_iter().map(|draft| draft.and_then(&mut routed)).collect();
    rival::within_budget(study, snapshot, drafts)
}
