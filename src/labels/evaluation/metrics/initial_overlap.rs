//! Initial non-overlap: the adversary overlaps nobody when the intervention begins. Binary.

use super::diagnostic::{Counts, Diagnostic, Measure, WEIGHT};

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.initial_non_overlap",
    counts: Counts::Always,
    weight: WEIGHT,
    meaning: "1 unless it overlaps somebody when it is first moved",
    short: "1 unless it overlaps somebody when first moved",
    measure: Measure::Of(|report| if report.initial_overlap { 0.0 } else { 1.0 }),
};
