//! Bounded jerk: how far the level of the filtered jerk exceeds what is known of traffic, m/s³.

use super::limits::Limits;
use crate::sim::AdversaryReport;

pub const NAME: &str = "bounded_jerk";

pub fn diagnostic(report: &AdversaryReport, limits: &Limits) -> f64 {
    limits.jerk_mps3.diagnostic(report, |motion| motion.jerk_mps3)
}
