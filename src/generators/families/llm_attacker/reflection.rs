//! Why an attack failed, from what the rollout told: the codes by which the next round is chosen.

use crate::kernel::num;
use crate::motion::Candidate;
use crate::objects::counsel::Failure;
use crate::scene::Sample;
use crate::sim::Outcome;
use crate::stage::Situation;

/// An attacker that stays farther away than this never came close, metres.
const CLOSE_M: f64 = 10.0;
/// The ego has yielded when it braked harder than this, m/s².
const YIELDING_MPS2: f64 = 2.5;
/// Steps that lie between early and late.
const EVEN_STEPS: usize = 2;
/// Paths are compared at every this many samples.
const STRIDE: usize = 2;

/// Result of an attack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    pub contact: bool,
    pub distance_m_min: f64,
    /// `None` after a contact.
    pub failure: Option<Failure>,
}

/// Reads an outcome. `timing` tells whether the leader came late or early; asked only where that is what went wrong.
pub fn evaluate(situation: &Situation, outcome: &Outcome, timing: impl FnOnce() -> Failure) -> Evaluation {
    let contact = outcome.contact.is_some_and(|contact| contact.adversary);
    let distance_m_min = if contact { 0.0 } else { outcome.distance_m_min.unwrap_or(f64::INFINITY) };
    let blocked = outcome.adversaries.iter().any(|adversary| adversary.struck_bystander || adversary.struck_parked);
    let calm_mps2 = situation.ego_deceleration_mps2_max;
    let failure = if contact {
        None
    } else if blocked {
        Some(Failure::Blocked)
    } else if distance_m_min > CLOSE_M {
        Some(Failure::NeverClose)
    } else if outcome.ego.deceleration_mps2_max > YIELDING_MPS2.max(calm_mps2 + 1.0) {
        Some(Failure::EgoYielded)
    } else {
        Some(timing())
    };
    Evaluation { contact, distance_m_min, failure }
}

/// Returns whether the way, sampled from `from_step` on, passes the place where the paths come nearest after the ego or before it.
pub fn timing(situation: &Situation, from_step: usize, way: &[Sample]) -> Failure {
    let mut best = (f64::INFINITY, 0, 0);
    for (k, sample) in way.iter().enumerate().step_by(STRIDE) {
        for step in situation.ego.steps().filter(|step| *step >= from_step).step_by(STRIDE) {
            let Some(ego) = situation.ego.at(step) else { continue };
            let apart = (ego.position - sample.position).norm_squared();
            if apart < best.0 {
                best = (apart, from_step + k, step);
            }
        }
    }
    let (_, own, ego) = best;
    if own > ego + EVEN_STEPS { Failure::Late } else { Failure::Early }
}

/// Mean speed along a candidate, m/s: what "faster" and "slower" mean.
pub fn mean_speed_mps(candidate: &Candidate) -> f64 {
    let speeds = candidate.samples.iter().map(|sample| sample.speed_mps());
    num::sum(speeds) / candidate.samples.len().max(1) as f64
}
