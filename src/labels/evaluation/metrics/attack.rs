//! a(τ): 1 if the ego failed. The rate over scenes is the paper's Attack (target-failure rate). A contact with an
//! adversary fails the ego if it caused it or could have avoided it, as the experiment file says by class; the readings
//! of published work stand beside it (`docs/OBJECTIVES.md`).

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::outcome_formula::OutcomeFormula;
use crate::objects::{AttackRequirement, Required};
use crate::sim::{Contact, ContactClass, Outcome};

/// Which contacts with an adversary are failures of the ego: the table `[evaluation.attack]`. A class stands in one of
/// the two lists or in none; contacts of a class in none never count.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, try_from = "WrittenOptions")]
pub struct AttackOptions {
    /// Classes that always count, avoidable or not.
    pub counts: BTreeSet<ContactClass>,
    /// Classes that count where the ego could have avoided the contact.
    pub counts_if_avoidable: BTreeSet<ContactClass>,
    /// An expression over the outcome that decides in place of the lists, where the experiment declares one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub when: Option<OutcomeFormula>,
    /// Requirements of a contact besides its class; all of ours where the table does not say.
    #[serde(default, skip_serializing_if = "Required::is_unsaid")]
    pub requires: Required<AttackRequirement>,
}

/// The table as a file may hold it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenOptions {
    #[serde(default)]
    reading: Option<Reading>,
    counts: Vec<ContactClass>,
    counts_if_avoidable: Vec<ContactClass>,
    #[serde(default)]
    when: Option<OutcomeFormula>,
    #[serde(default)]
    requires: Required<AttackRequirement>,
}

/// A reading with a name, in place of an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Reading {
    /// Contacts with an adversary for which the ego is at fault by nuPlan's rule.
    AtFault,
}

/// Expression that `reading = "at_fault"` stands for.
pub const AT_FAULT: &str = "contact_adversary and contact_at_fault";

/// `[evaluation.attack]` that defines no label.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AttackOptionsError {
    /// A class of contact that is named in both lists, or twice in one.
    #[error("evaluation.attack names {0} twice; name a class once, in `counts` or in `counts_if_avoidable`")]
    Twice(&'static str),
    /// No class of contact is named.
    #[error("evaluation.attack counts no class, so no program could ever attack; name at least one")]
    Nothing,
    /// A reading beside an expression, or one that is none.
    #[error("evaluation.attack holds `reading` and `when`, which both decide; leave one of them out")]
    Both,
    /// The expression of a reading cannot be read: a fault of this program.
    #[error("evaluation.attack.reading: {0}")]
    Reading(String),
}

impl TryFrom<WrittenOptions> for AttackOptions {
    type Error = AttackOptionsError;

    fn try_from(written: WrittenOptions) -> Result<AttackOptions, AttackOptionsError> {
        let mut seen = BTreeSet::new();
        let all = written.counts.iter().chain(&written.counts_if_avoidable);
        for class in all {
            if !seen.insert(*class) {
                return Err(AttackOptionsError::Twice(class.name()));
            }
        }
        let when = match (written.reading, written.when) {
            (Some(_), Some(_)) => return Err(AttackOptionsError::Both),
            (Some(Reading::AtFault), None) => {
                let read = OutcomeFormula::try_from(AT_FAULT.to_string());
                Some(read.map_err(|error| AttackOptionsError::Reading(error.to_string()))?)
            }
            (None, when) => when,
        };
        if seen.is_empty() && when.is_none() {
            return Err(AttackOptionsError::Nothing);
        }
        Ok(AttackOptions {
            counts: written.counts.into_iter().collect(),
            counts_if_avoidable: written.counts_if_avoidable.into_iter().collect(),
            when,
            requires: written.requires,
        })
    }
}

impl AttackOptions {
    /// Returns `true` if a contact is a failure of the ego by its class and partner. One that nobody assessed never counts as avoidable.
    pub fn counts(&self, contact: &Contact) -> bool {
        let avoidable = contact.avoidable == Some(true);
        (contact.adversary || !self.requires.has(AttackRequirement::Adversary))
            && (self.counts.contains(&contact.class) || avoidable && self.counts_if_avoidable.contains(&contact.class))
    }
}

/// 1 for a target failure, else 0; with an expression of the experiment's own, its value between 0 and 1.
pub fn attack(outcome: &Outcome, options: &AttackOptions) -> f64 {
    if let Some(when) = &options.when {
        return when.share(outcome);
    }
    let failed = outcome.contact.is_some_and(|contact| options.counts(&contact));
    if failed { 1.0 } else { 0.0 }
}

/// Readings of one rollout in published work, beside our label: a crash counts, whoever caused it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedReadings {
    /// Contact with an adversary, of any class (CAT: the crash with its opponent vehicle).
    pub adversary_contact: bool,
    /// Contact with anyone (MetaDrive's `crash_vehicle`, on which CAT's success flag rests).
    pub any_contact: bool,
}

/// The readings of published work.
pub fn published(outcome: &Outcome) -> PublishedReadings {
    PublishedReadings {
        adversary_contact: outcome.contact.is_some_and(|contact| contact.adversary),
        any_contact: outcome.contact.is_some(),
    }
}
