//! Trajectory continuity: jumps in the places of the adversary. The worst of three, in metres:
//!
//! - a step that the velocities at its ends do not explain (velocities and places contradict each other);
//! - a step that the step before it does not explain (a teleport, whatever the velocity);
//! - jitter that the filter of the derivatives takes away, so that none above its cut-off stays hidden.

use super::diagnostic::{Counts, Diagnostic, Measure, Quantity, WEIGHT, quantity};

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.trajectory_continuity",
    counts: Counts::Always,
    weight: WEIGHT,
    meaning: "the worst of jumps, kinks and roughness of its places, m",
    short: "worst of its places' jumps, kinks, roughness, m",
    measure: Measure::Soft(&[quantity!(jump_m), quantity!(kink_m), quantity!(roughness_m)]),
};
