//! Bounded slip: speed of the adversary across its heading that turning does not explain, m/s. A car follows
//! its wheels; a motion that slides sideways is drawn, not driven. It does not apply to people on foot.

use super::diagnostic::{Counts, Diagnostic, Measure, Quantity, WEIGHT, quantity};

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.bounded_slip",
    counts: Counts::Always,
    weight: WEIGHT,
    meaning: "speed across its heading, m/s",
    short: "speed across its heading, m/s",
    measure: Measure::Soft(&[quantity!(slip_mps)]),
};
