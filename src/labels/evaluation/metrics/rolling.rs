//! Rolling: how far the adversary goes where wheels do not take it, metres: a standing car that slides aside, a turn on the spot.
//! `bounded_slip` sees the speed of a slide, which may be slow; this sees where it ends. Of someone on foot nothing is asked.

use super::limits::Limits;
use crate::sim::AdversaryReport;

/// Its name in weights, scores and tables.
pub const NAME: &str = "rolling";

/// 1 within the limit, 0 one tolerance beyond it.
pub fn diagnostic(report: &AdversaryReport, limits: &Limits) -> f64 {
    limits.unrolled_m.map_or(1.0, |limit| limit.of_account(&report.of_kind, |motion| motion.unrolled_m))
}
