//! Bounded acceleration: what an adversary's acceleration, braking or lateral acceleration exceeds its bound by; soft,
//! the worst counts.

use super::soft;
use crate::sim::Outcome;

pub fn bounded_acceleration(outcome: &Outcome, bound_mps2: f64, lateral_bound_mps2: f64, tolerance_mps2: f64) -> f64 {
    let excess = outcome.adversaries.iter().map(|a| {
        let along = a.motion.acceleration_mps2_max.max(a.motion.deceleration_mps2_max) - bound_mps2;
        along.max(a.motion.lateral_acceleration_mps2_max - lateral_bound_mps2)
    });
    soft(excess.fold(0.0, f64::max), tolerance_mps2)
}
