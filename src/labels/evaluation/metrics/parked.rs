//! Parked obstacles: the adversary drives through nothing that stands throughout the recording. Binary.

use super::diagnostic::{Counts, Diagnostic, Measure, WEIGHT};

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.parked_obstacles",
    counts: Counts::Always,
    weight: WEIGHT,
    meaning: "1 unless it touches something that stands",
    short: "1 unless it touches what stands",
    measure: Measure::Of(|report| if report.struck_parked { 0.0 } else { 1.0 }),
};
