//! Collision validity: the adversary drives through nobody on its way to the ego. Binary.

use crate::sim::AdversaryReport;

pub const NAME: &str = "collision_validity";

pub fn diagnostic(report: &AdversaryReport) -> f64 {
    if report.struck_bystander { 0.0 } else { 1.0 }
}
