//! Collision validity: the adversary touches no moving road user on its way to the ego. Binary. A pair that overlaps already in
//! the recording does not count.

use crate::sim::AdversaryReport;

/// Its name in weights, scores and tables.
pub const NAME: &str = "collision_validity";

/// 1 or 0.
pub fn diagnostic(report: &AdversaryReport) -> f64 {
    if report.struck_bystander { 0.0 } else { 1.0 }
}
