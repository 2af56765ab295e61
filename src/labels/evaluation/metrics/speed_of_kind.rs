//! Speed of its kind: excess of the adversary's speed over that of road users of its kind, m/s. A car's motion with a pedestrian's box is
//! no pedestrian.

use super::diagnostic::{Counts, Diagnostic, Measure, Quantity, quantity};

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.speed_of_kind",
    counts: Counts::OfKind,
    weight: "Weight of being faster than one's kind; likewise.",
    meaning: "its speed, by the bound of its kind of road user, m/s",
    short: "bound of its kind of road user, m/s",
    measure: Measure::Soft(&[quantity!(of_kind.speed_mps, |of| of.speed_mps)]),
};
