//! Collision validity: no adversary strikes a bystander on its way to the ego; binary.

use crate::sim::Outcome;

pub fn collision_validity(outcome: &Outcome) -> f64 {
    f64::from(u8::from(!outcome.adversaries.iter().any(|a| a.struck_bystander)))
}
