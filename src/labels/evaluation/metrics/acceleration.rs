//! Bounded acceleration: how far the level of the filtered acceleration, along and across together, exceeds what is
//! known of traffic, m/s².

use super::limits::Limits;
use crate::sim::AdversaryReport;

/// Its name in weights, scores and tables.
pub const NAME: &str = "bounded_acceleration";

/// 1 within the limit, 0 one tolerance beyond it.
pub fn diagnostic(report: &AdversaryReport, limits: &Limits) -> f64 {
    limits.acceleration_mps2.diagnostic(report, |motion| motion.acceleration_mps2)
}
