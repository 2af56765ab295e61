//! Trajectory continuity: whether the places of the adversary make one motion. The worst of three, in metres:
//!
//! - a step that the velocities at its ends do not explain (the velocity says something else than the places);
//! - a step that the step before it does not explain (a teleport, whatever the velocity says);
//! - jitter that the filter of the derivatives takes away, so that nothing can be hidden from it above its cut-off.

use super::limits::Limits;
use crate::sim::AdversaryReport;

/// Its name in weights, scores and tables.
pub const NAME: &str = "trajectory_continuity";

/// The smallest of the three, each 1 within its limit and 0 one tolerance beyond it.
pub fn diagnostic(report: &AdversaryReport, limits: &Limits) -> f64 {
    let jump = limits.jump_m.diagnostic(report, |motion| motion.jump_m);
    let kink = limits.kink_m.diagnostic(report, |motion| motion.kink_m);
    let roughness = limits.roughness_m.diagnostic(report, |motion| motion.roughness_m);
    jump.min(kink).min(roughness)
}
