//! Route progress: an adversary makes its way along lanes, not against them. The paper does not define it; here it is
//! the distance driven against the direction of the lane, soft, the worst adversary counts.

use super::soft;
use crate::sim::Outcome;

pub fn route_progress(outcome: &Outcome, tolerance_m: f64) -> f64 {
    soft(outcome.adversaries.iter().map(|a| a.wrong_way_m).fold(0.0, f64::max), tolerance_m)
}
