//! Map and lane validity: how far a corner of the adversary's box leaves the drivable area, metres.

use super::limits::Limits;
use crate::sim::AdversaryReport;

pub const NAME: &str = "map_validity";

pub fn diagnostic(report: &AdversaryReport, limits: &Limits) -> f64 {
    limits.off_road_m.diagnostic(report, |motion| motion.off_road_m)
}
