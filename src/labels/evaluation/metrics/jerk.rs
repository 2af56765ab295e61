//! Bounded jerk: excess of the level of the filtered jerk over that of recorded traffic, m/s³.

use super::diagnostic::{Counts, Diagnostic, Measure, Quantity, WEIGHT, quantity};

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.bounded_jerk",
    counts: Counts::Always,
    weight: WEIGHT,
    meaning: "jerk: largest change of acceleration, m/s^3",
    short: "change of acceleration, m/s^3",
    measure: Measure::Soft(&[quantity!(jerk_mps3)]),
};
