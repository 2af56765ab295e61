//! a(τ): whether the ego failed. The rate over scenes is the paper's Attack (target-failure rate).

use serde::{Deserialize, Serialize};

use crate::sim::Outcome;

/// What counts as a target failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AttackTarget {
    /// Contact of the ego with anyone, as MetaDrive's `crash_vehicle` and CAT's success flag.
    AnyContact,
    /// Contact with one of the intervention's adversaries only.
    AdversaryContact,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AttackOptions {
    pub target: AttackTarget,
}

/// 1 for a target failure, else 0.
pub fn attack(outcome: &Outcome, options: &AttackOptions) -> f64 {
    let failed = outcome.contact.is_some_and(|contact| match options.target {
        AttackTarget::AnyContact => true,
        AttackTarget::AdversaryContact => contact.adversary,
    });
    if failed { 1.0 } else { 0.0 }
}
