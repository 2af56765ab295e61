//! Map and lane validity: distance by which a corner of the adversary's box leaves the drivable area, metres.

use super::diagnostic::{Counts, Diagnostic, Measure, Quantity, WEIGHT, quantity};

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.map_validity",
    counts: Counts::Always,
    weight: WEIGHT,
    meaning: "how far a corner of its box leaves the lanes, m",
    short: "a corner of its box off the lanes, m",
    measure: Measure::Soft(&[quantity!(off_road_m)]),
};
