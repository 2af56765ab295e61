//! Rollouts in a few scenes before anybody is ranked, where the experiment asks for them.

use std::collections::BTreeMap;

use super::draft::{Draft, Predicted, Reached};
use crate::epoch::RunError;
use crate::epoch::freeze::Snapshot;
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::Study;
use crate::evaluation::EvaluationError;
use crate::kernel::num;
use crate::objects::{Objectives, Pilot, PilotOptions, SceneScore, Score};
use crate::world::{Router, pilot_order, pilot_places};

/// Simulates every predicted candidate in the scenes of its pilot, and corrects what it is ranked by. Without a pilot in the
/// experiment drafts stay as they are.
pub fn pilot(
    study: &Study,
    snapshot: &Snapshot<'_>,
    router: &Router<'_>,
    drafts: Vec<Result<Draft, RunError>>,
    tools: &Tools<'_>,
) -> Result<Vec<Result<Draft, RunError>>, RunError> {
    let Some(options) = snapshot.world.configuration.routing.pilot else { return Ok(drafts) };
    let order = pilot_order(study.seed, &snapshot.spec.id, snapshot.event.epoch, snapshot.window.len());
    let labelling = Labelling { study, spec: snapshot.spec, counsels: &snapshot.counsels, tools };
    // Pilots do not depend on each other: all are made together, as the labels on the window are.
    let asked: Vec<(&Predicted, Vec<usize>)> = drafts
        .iter()
        .flatten()
        .filter_map(predicted)
        .map(|own| (own, places(snapshot, own, &order, &options)))
        .collect();
    let programs = asked.iter().map(|(own, places)| (&own.candidate.program, places.as_slice()));
    labelling.ahead_at(&programs.collect::<Vec<_>>())?;
    let seen = |draft: Draft| {
        draft.next(|slot, reached| match reached {
            Reached::Predicted { gates, mut predicted } => {
                let places = places(snapshot, &predicted, &order, &options);
                let score = if places.is_empty() {
                    None
                } else {
                    match labelling.score(predicted.candidate.hashed(), &places) {
                        Ok(score) => Some(score),
                        // What no scene can label is found, and said, where it is labelled on the whole window.
                        Err(RunError::Evaluation(EvaluationError::NoLabel(_))) => None,
                        Err(error) => return Err(error),
                    }
                };
                let ids = places.iter().map(|&place| study.scenes[place].scene().id.clone()).collect();
                let shown = shown(ids, score.as_ref(), &snapshot.parent_of(slot).score);
                predicted.prediction = router.after_pilot(predicted.prediction, predicted.row.open_share, &shown);
                predicted.pilot = Some(shown);
                Ok(Reached::Predicted { gates, predicted })
            }
            ended => Ok(ended),
        })
    };
    Ok(drafts.into_iter().map(|draft| draft.and_then(seen)).collect())
}

fn predicted(draft: &Draft) -> Option<&Predicted> {
    match &draft.reached {
        Reached::Predicted { predicted, .. } => Some(predicted),
        _ => None,
    }
}

/// Places in the pool of a candidate's pilot scenes.
fn places(snapshot: &Snapshot<'_>, own: &Predicted, order: &[usize], options: &PilotOptions) -> Vec<usize> {
    pilot_places(order, &own.open, options).into_iter().map(|place| snapshot.window[place]).collect()
}

/// Compares a pilot in these scenes with the parent's labels there.
fn shown(scenes: Vec<String>, score: Option<&Score>, parent: &Score) -> Pilot {
    let before: BTreeMap<&str, &SceneScore> = parent.scenes.iter().map(|label| (label.scene.as_str(), label)).collect();
    let labels = score.map_or(&[][..], |score| &score.scenes);
    let differences: Vec<Objectives> = labels
        .iter()
        .filter_map(|own| {
            let parent = before.get(own.scene.as_str())?;
            Some(Objectives { attack: own.attack - parent.attack, realism: own.realism - parent.realism })
        })
        .collect();
    let mean = |of: fn(&Objectives) -> f64| num::mean(&differences.iter().map(of).collect::<Vec<f64>>()).unwrap_or(0.0);
    let difference = Objectives { attack: mean(|of| of.attack), realism: mean(|of| of.realism) };
    Pilot { scenes, difference, labelled: u32::try_from(differences.len()).unwrap_or(u32::MAX) }
}
