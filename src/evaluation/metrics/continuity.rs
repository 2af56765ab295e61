//! Trajectory continuity: no step that the adversary's own velocity does not explain; soft, the worst counts.

use super::soft;
use crate::sim::Outcome;

pub fn continuity(outcome: &Outcome, tolerance_m: f64) -> f64 {
    soft(outcome.adversaries.iter().map(|a| a.jump_m_max).fold(0.0, f64::max), tolerance_m)
}
