//! Bounded jerk: what an adversary's jerk exceeds its bound by; soft, the worst adversary counts.

use super::soft;
use crate::sim::Outcome;

pub fn bounded_jerk(outcome: &Outcome, bound_mps3: f64, tolerance_mps3: f64) -> f64 {
    soft(outcome.adversaries.iter().map(|a| a.motion.jerk_mps3_max - bound_mps3).fold(0.0, f64::max), tolerance_mps3)
}
