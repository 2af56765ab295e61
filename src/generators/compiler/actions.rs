//! Actions that the simulator carries out for a choice of candidates.

use crate::motion::Candidate;
use crate::sim::{Action, Law};
use crate::stage::{Part, Situation};

/// The actions of every part's chosen candidate, in the parts' order.
pub fn actions(situation: &Situation, parts: &[Part], chosen: &[usize]) -> Vec<Action> {
    let mut actions = Vec::with_capacity(parts.len());
    for (part, place) in parts.iter().zip(chosen) {
        let candidate = &part.candidates[*place];
        match &candidate.scripted {
            Some(scripted) => actions.extend_from_slice(&scripted.actions),
            None => actions.push(action(situation, part, candidate)),
        }
    }
    actions
}

/// Returns what the simulator is asked to do for one adversary.
fn action(situation: &Situation, part: &Part, candidate: &Candidate) -> Action {
    let (track, from_step, samples) = (part.actor, part.window.from_step, candidate.samples.clone());
    if let Some(guest) = situation.as_guest(track) {
        let (kind, length_m, width_m) = (guest.kind, guest.length_m, guest.width_m);
        return Action::Insert { kind, length_m, width_m, from_step, samples };
    }
    if let Some(law) = &candidate.law {
        return Action::FollowThenObey { track, from_step, samples, law: Law::clone(law) };
    }
    match candidate.handover_step {
        Some(step) => {
            let handover_step = step.clamp(from_step, from_step + samples.len().saturating_sub(1));
            Action::FollowThenReact { track, from_step, samples, handover_step }
        }
        None => Action::Follow { track, from_step, samples },
    }
}
