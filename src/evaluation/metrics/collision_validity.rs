//! Collision validity: the adversary touches no moving road user on its way to the ego. Binary. A pair that overlaps already in
//! the recording does not count.

use crate::sim::AdversaryReport;

pub const NAME: &str = "collision_validity";

pub fn diagnostic(report: &AdversaryReport) -> f64 {
    if report.struck_bystander { 0.0 } else { 1.0 }
}
