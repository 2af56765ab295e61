//! Collision validity: the adversary touches no moving road user on its way to the ego. Binary. A pair that overlaps already in
//! the recording does not count.

use super::diagnostic::{Counts, Diagnostic, Measure, WEIGHT};

pub(super) const ROW: Diagnostic = Diagnostic {
    key: "evaluation.realism.weights.collision_validity",
    counts: Counts::Always,
    weight: WEIGHT,
    meaning: "1 unless it touches another moving road user than the ego",
    short: "1 unless it touches a moving road user but the ego",
    measure: Measure::Of(|report| if report.struck_bystander { 0.0 } else { 1.0 }),
};
