//! Map and lane validity: how far a corner of the adversary's box leaves the drivable area, metres.

use super::soft;
use crate::sim::AdversaryReport;

pub const NAME: &str = "map_validity";

pub fn diagnostic(report: &AdversaryReport, tolerance_m: f64) -> f64 {
    soft(report.off_road_m_max, tolerance_m)
}
