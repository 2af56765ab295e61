//! Bounded slip: how fast the adversary moves across its heading where turning does not explain it, m/s. A car follows
//! its wheels; a motion that slides sideways is drawn, not driven. Of someone on foot nothing is asked.

use super::limits::Limits;
use crate::sim::AdversaryReport;

/// Its name in weights, scores and tables.
pub const NAME: &str = "bounded_slip";

/// 1 within the limit, 0 one tolerance beyond it.
pub fn diagnostic(report: &AdversaryReport, limits: &Limits) -> f64 {
    limits.slip_mps.diagnostic(report, |motion| motion.slip_mps)
}
