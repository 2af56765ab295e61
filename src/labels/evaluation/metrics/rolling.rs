//! Rolling: distance that the adversary moves where wheels do not take it, metres: a standing car that slides aside, a turn on the spot.
//! `bounded_slip` sees the speed of a slide, which may be slow; this sees where it ends. It does not apply to people on foot.

use super::diagnostic::{Counts, Diagnostic, Measure, Quantity, quantity};

/// The row.
pub const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.rolling",
    counts: Counts::OfKind,
    weight: "Weight of a slide or a turn on the spot; needs `simulator.of_kind` and such a calibration.",
    meaning: "how far it goes where wheels do not take it, m: a slide, a turn on the spot",
    short: "way where wheels do not take it, m: a slide, a turn on the spot",
    measure: Measure::Soft(&[quantity!(of_kind.unrolled_m, |of| of.unrolled_m)]),
};
