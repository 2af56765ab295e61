//! Trajectory continuity: whether the places of the adversary make one motion. The worst of three, in metres:
//!
//! - a step that the velocities at its ends do not explain (the velocity says something else than the places);
//! - a step that the step before it does not explain (a teleport, whatever the velocity says);
//! - jitter that the filter of the derivatives takes away, so that nothing can be hidden from it above its cut-off.

use super::diagnostic::{Counts, Diagnostic, Measure, Quantity, WEIGHT, quantity};

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.trajectory_continuity",
    counts: Counts::Always,
    weight: WEIGHT,
    meaning: "the worst of jumps, kinks and roughness of its places, m",
    short: "worst of its places' jumps, kinks, roughness, m",
    measure: Measure::Soft(&[quantity!(jump_m), quantity!(kink_m), quantity!(roughness_m)]),
};
