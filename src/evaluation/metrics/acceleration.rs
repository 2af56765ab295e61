//! Bounded acceleration: how far the adversary's acceleration, along or across, exceeds the bound, m/s².

use super::{BoundedDiagnostic, soft};
use crate::sim::AdversaryReport;

pub const NAME: &str = "bounded_acceleration";

pub fn diagnostic(report: &AdversaryReport, options: &BoundedDiagnostic) -> f64 {
    let motion = &report.motion;
    let largest =
        motion.acceleration_mps2_max.max(motion.deceleration_mps2_max).max(motion.lateral_acceleration_mps2_max);
    soft(largest - options.bound, options.tolerance)
}
