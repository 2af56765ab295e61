//! Trajectory continuity: the largest step of the adversary that its own velocity does not explain, metres.

use super::soft;
use crate::sim::AdversaryReport;

pub const NAME: &str = "trajectory_continuity";

pub fn diagnostic(report: &AdversaryReport, tolerance_m: f64) -> f64 {
    soft(report.jump_m_max, tolerance_m)
}
