//! Route completion of the adversary: the part of its own recorded way that it does not drive in the same time, as a
//! share. A road user that stands still to be hit, or leaves for another road, does not complete its route. The paper names route
//! completion among the checks without a formula; the recorded way is the only route that is known of another road user.
//! One without such a way, such as an inserted one, completes it.

use super::diagnostic::{Counts, Diagnostic, Measure, WEIGHT};
use super::soft::soft;

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.route_completion",
    counts: Counts::Always,
    weight: WEIGHT,
    meaning: "share of its own recorded way that it drove by then",
    short: "driven share of its recorded way",
    // Violation `1 - completion` with tolerance 1.
    measure: Measure::Of(|report| report.route_completion.map_or(1.0, |share| soft(1.0 - share, 1.0))),
};
