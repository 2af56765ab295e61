//! Lane direction: metres that the adversary drives against the direction of every lane below it.

use super::diagnostic::{Counts, Diagnostic, Measure, Quantity, WEIGHT, quantity};

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.lane_direction",
    counts: Counts::Always,
    weight: WEIGHT,
    meaning: "way driven against the lanes, m",
    short: "driven against the lanes, m",
    measure: Measure::Soft(&[quantity!(wrong_way_m)]),
};
