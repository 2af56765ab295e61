//! Bounded jerk: how far the adversary's longitudinal jerk exceeds the bound, m/s³.

use super::{BoundedDiagnostic, soft};
use crate::sim::AdversaryReport;

pub const NAME: &str = "bounded_jerk";

pub fn diagnostic(report: &AdversaryReport, options: &BoundedDiagnostic) -> f64 {
    soft(report.motion.jerk_mps3_max - options.bound, options.tolerance)
}
