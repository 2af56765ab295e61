//! a(τ): whether the ego was struck or struck someone (paper eq. prelim-objectives; CAT's attack success).

use serde::{Deserialize, Serialize};

use crate::sim::Outcome;

/// Whose contact counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AttackTarget {
    /// Contact with an adversary only.
    Adversary,
    /// Contact with anyone, as CAT's protocol counts.
    Anyone,
}

/// 1 for a contact that counts, else 0.
pub fn attack(outcome: &Outcome, target: AttackTarget) -> f64 {
    let counts = outcome.contact.is_some_and(|c| target == AttackTarget::Anyone || c.adversary);
    f64::from(u8::from(counts))
}
