//! Turns an intervention into plain samples for a worker, which only replays commands. Adversaries that react, by skills or by a law, get
//! the motion that they had in our own simulation of the same ego.

use super::error::{BackendError, NoOutcome};
use crate::ego::Policy;
use crate::sim::{Action, ActorRef, Intervention, Plant, ReportedRollout, tell};

/// The intervention with every reacting action in place of which stand its samples: what another simulator is commanded.
///
/// # Errors
/// A staged scene, which only our own simulator plays, or one that it cannot play.
pub fn lowered(plant: &Plant, intervention: &Intervention, ego: &Policy) -> Result<Intervention, NoOutcome> {
    unstaged(plant, intervention)?;
    if !intervention.actions.iter().any(reacts) {
        return Ok(intervention.clone());
    }
    let reported = tell(plant, intervention, ego.driver().as_mut())?;
    Ok(as_driven(plant, intervention, &reported))
}

/// Refuses scenes and actions that only our own simulator plays, without asking a backend.
pub(super) fn unstaged(plant: &Plant, intervention: &Intervention) -> Result<(), NoOutcome> {
    let staged = intervention.actions.iter().any(|action| matches!(action, Action::Triggered(_)));
    if plant.is_staged() || staged {
        let reason = "is staged for SafeBench, whose rules only our own simulator has; use `backend = \"evodrive\"`";
        return Err(BackendError::Unplayable(format!("scene {} {reason}", plant.scene_id())).into());
    }
    Ok(())
}

fn reacts(action: &Action) -> bool {
    matches!(action, Action::FollowThenReact { .. } | Action::FollowThenObey { .. })
}

/// Returns the intervention with the motion of a reported rollout in place of every reacting action.
pub(super) fn as_driven(plant: &Plant, intervention: &Intervention, reported: &ReportedRollout) -> Intervention {
    let within = reported.contact.is_some_and(|contact| (1..5).contains(&contact.substep));
    let rows = reported.ego.len() - usize::from(within);
    let lower = |action: &Action| match action {
        Action::FollowThenReact { track, from_step, samples, .. }
        | Action::FollowThenObey { track, from_step, samples, .. } => {
            let from = from_step.saturating_sub(plant.first_step());
            let actor = reported.actors.iter().find(|actor| actor.who == ActorRef::Track(*track));
            let driven: Vec<_> =
                (from..rows).map_while(|row| actor.and_then(|actor| actor.at(row)).map(|pose| pose.sample)).collect();
            // A rollout that ends before the action begins leaves it as it is.
            if driven.is_empty() {
                return Action::Follow { track: *track, from_step: *from_step, samples: samples.clone() };
            }
            Action::Follow { track: *track, from_step: from + plant.first_step(), samples: driven }
        }
        other => other.clone(),
    };
    Intervention { actions: intervention.actions.iter().map(lower).collect() }
}
