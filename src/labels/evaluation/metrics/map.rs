//! Map and lane validity: how far a corner of the adversary's box leaves the drivable area, metres.

use super::limits::Limits;
use crate::sim::AdversaryReport;

/// Its name in weights, scores and tables.
pub const NAME: &str = "map_validity";

/// 1 within the limit, 0 one tolerance beyond it.
pub fn diagnostic(report: &AdversaryReport, limits: &Limits) -> f64 {
    limits.off_road_m.diagnostic(report, |motion| motion.off_road_m)
}
