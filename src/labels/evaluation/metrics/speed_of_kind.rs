//! Speed of its kind: how fast the adversary is beyond what road users of its kind are, m/s. A car's motion with a pedestrian's box is
//! no pedestrian.

use super::limits::Limits;
use crate::sim::AdversaryReport;

/// Its name in weights, scores and tables.
pub const NAME: &str = "speed_of_kind";

/// 1 within the limit, 0 one tolerance beyond it.
pub fn diagnostic(report: &AdversaryReport, limits: &Limits) -> f64 {
    limits.speed_mps.map_or(1.0, |limit| limit.of_account(&report.of_kind, |motion| motion.speed_mps))
}
