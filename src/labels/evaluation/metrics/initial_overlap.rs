//! Initial non-overlap: the adversary overlaps nobody when the intervention begins. Binary.

use crate::sim::AdversaryReport;

/// Its name in weights, scores and tables.
pub const NAME: &str = "initial_non_overlap";

/// 1 or 0.
pub fn diagnostic(report: &AdversaryReport) -> f64 {
    if report.initial_overlap { 0.0 } else { 1.0 }
}
