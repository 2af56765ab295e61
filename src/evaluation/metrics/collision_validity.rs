//! Collision validity: the adversary touches nobody who moves on its way to the ego. Binary. A pair that overlaps in the
//! recording already is none.

use crate::sim::AdversaryReport;

pub const NAME: &str = "collision_validity";

pub fn diagnostic(report: &AdversaryReport) -> f64 {
    if report.struck_bystander { 0.0 } else { 1.0 }
}
