//! Parked obstacles: the adversary drives through nothing that stands all through the recording. Binary.

use crate::sim::AdversaryReport;

/// Its name in weights, scores and tables.
pub const NAME: &str = "parked_obstacles";

/// 1 or 0.
pub fn diagnostic(report: &AdversaryReport) -> f64 {
    if report.struck_parked { 0.0 } else { 1.0 }
}
