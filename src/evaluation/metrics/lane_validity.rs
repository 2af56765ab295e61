//! Map and lane validity: how far an adversary's box went beyond the drivable area; soft, the worst adversary counts.

use super::soft;
use crate::sim::Outcome;

pub fn lane_validity(outcome: &Outcome, tolerance_m: f64) -> f64 {
    soft(outcome.adversaries.iter().map(|a| a.off_road_m_max).fold(0.0, f64::max), tolerance_m)
}
