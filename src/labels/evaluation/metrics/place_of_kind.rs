//! Place of its kind: presence of the adversary where road users of its kind do not belong: on foot or on a bicycle on a motorway, or on
//! wheels on another carriageway behind a kerb, a median or a barrier. The worst of the two. `map_validity` sees neither, for both places
//! are lanes.

use super::diagnostic::{Counts, Diagnostic, Measure, Quantity, quantity};
use super::limits::Limit;

/// Time on a motorway, s. No time is allowed. The tolerance is that of a level (0.3 s in all).
const MOTORWAY_S: Limit = Limit { bound: 0.0, tolerance: 0.3 };
/// Way across an edge, metres.
const ACROSS_M: Limit = Limit { bound: 0.5, tolerance: 1.0 };

/// The row.
pub const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.place_of_kind",
    counts: Counts::OfPlace,
    weight: "Weight of being where one's kind does not belong; needs `simulator.of_place`.",
    meaning: "on foot or a bicycle: time on a motorway, s; on wheels: way over a kerb or median onto other lanes, m",
    short: "on foot or a bicycle: on a motorway, s; on wheels: over a kerb or median onto other lanes, m",
    measure: Measure::Soft(&[
        quantity!(of_place.motorway_s, |_| Some(MOTORWAY_S)),
        quantity!(of_place.across_m, |_| Some(ACROSS_M)),
    ]),
};
