//! Bounded acceleration: excess of the level of the filtered acceleration, along and across together, over that of
//! recorded traffic, m/s².

use super::diagnostic::{Counts, Diagnostic, Measure, Quantity, WEIGHT, quantity};

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.bounded_acceleration",
    counts: Counts::Always,
    weight: WEIGHT,
    meaning: "largest acceleration or braking along its heading, m/s^2",
    short: "along its heading, either sign, m/s^2",
    measure: Measure::Soft(&[quantity!(acceleration_mps2)]),
};
