//! Lane direction: metres that the adversary drives against the direction of every lane below it.

use super::limits::Limits;
use crate::sim::AdversaryReport;

/// Its name in weights, scores and tables.
pub const NAME: &str = "lane_direction";

/// 1 within the limit, 0 one tolerance beyond it.
pub fn diagnostic(report: &AdversaryReport, limits: &Limits) -> f64 {
    limits.wrong_way_m.diagnostic(report, |motion| motion.wrong_way_m)
}
