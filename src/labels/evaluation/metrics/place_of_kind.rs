//! Place of its kind: whether the adversary is where road users of its kind do not belong: on foot or on a bicycle on a motorway, or on
//! wheels on another carriageway behind a kerb, a median or a barrier. The worst of the two. `map_validity` sees neither, for both places
//! are lanes.

use super::limits::Limit;
use crate::sim::{AdversaryReport, OfPlace, WithRecording};

/// Its name in weights, scores and tables.
pub const NAME: &str = "place_of_kind";

/// Time on a motorway, s. No time is allowed. The tolerance is that of a level (0.3 s in all).
pub const MOTORWAY_S: Limit = Limit { bound: 0.0, tolerance: 0.3 };
/// Way across an edge, metres.
pub const ACROSS_M: Limit = Limit { bound: 0.5, tolerance: 1.0 };

/// The smaller of the two, each 1 within its limit and 0 one tolerance beyond it.
pub fn diagnostic(report: &AdversaryReport) -> f64 {
    of_account(&report.of_place)
}

/// The same of an account; 1 where it was not asked for.
pub fn of_account(found: &Option<WithRecording<OfPlace>>) -> f64 {
    let motorway = MOTORWAY_S.of_account(found, |motion| motion.motorway_s);
    let across = ACROSS_M.of_account(found, |motion| motion.across_m);
    motorway.min(across)
}
