//! Lane direction: metres that the adversary drives against the direction of every lane below it.

use super::limits::Limits;
use crate::sim::AdversaryReport;

pub const NAME: &str = "lane_direction";

pub fn diagnostic(report: &AdversaryReport, limits: &Limits) -> f64 {
    limits.wrong_way_m.diagnostic(report, |motion| motion.wrong_way_m)
}
