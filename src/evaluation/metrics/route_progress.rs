//! Route progress: distance that the adversary drives against the direction of its lane, metres. The paper names the
//! diagnostic without a formula; driving with the lane is what progress along a route means for a road user whose
//! destination is unknown.

use super::soft;
use crate::sim::AdversaryReport;

pub const NAME: &str = "route_progress";

pub fn diagnostic(report: &AdversaryReport, tolerance_m: f64) -> f64 {
    soft(report.wrong_way_m, tolerance_m)
}
