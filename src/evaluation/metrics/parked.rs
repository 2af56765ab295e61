//! Parked obstacles: the adversary drives through nothing that stands all through the recording. Binary.

use crate::sim::AdversaryReport;

pub const NAME: &str = "parked_obstacles";

pub fn diagnostic(report: &AdversaryReport) -> f64 {
    if report.struck_parked { 0.0 } else { 1.0 }
}
