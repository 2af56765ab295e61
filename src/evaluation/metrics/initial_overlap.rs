//! Initial non-overlap: no adversary stands in anyone when the intervention begins; binary.

use crate::sim::Outcome;

pub fn initial_non_overlap(outcome: &Outcome) -> f64 {
    f64::from(u8::from(!outcome.adversaries.iter().any(|a| a.initial_overlap)))
}
