//! Bounded jerk: how far the level of the filtered jerk exceeds what is known of traffic, m/s³.

use super::limits::Limits;
use crate::sim::AdversaryReport;

/// Its name in weights, scores and tables.
pub const NAME: &str = "bounded_jerk";

/// 1 within the limit, 0 one tolerance beyond it.
pub fn diagnostic(report: &AdversaryReport, limits: &Limits) -> f64 {
    limits.jerk_mps3.diagnostic(report, |motion| motion.jerk_mps3)
}
