//! One line of descent: its programs, its attempts, and who led when.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use crate::kernel::Digest;
use crate::objects::{Attempt, AttemptId, Exit, FamilyName, LineageId, Program, SolutionId};

/// Everything known of a lineage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lineage {
    pub id: LineageId,
    pub family: FamilyName,
    /// p_0.
    pub parent: SolutionId,
    /// p_t: the program that the next proposals edit; only the even slots', where there is a realism anchor.
    pub active: SolutionId,
    /// The program that the odd slots edit under the rule of two anchors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub realism_anchor: Option<SolutionId>,
    /// Every admitted program, also those that were rejected or not accepted.
    pub solutions: BTreeMap<SolutionId, Program>,
    /// In the order in which they were attached.
    pub attempts: Vec<AttemptRecord>,
    /// In order; empty while p_0 leads.
    pub promotions: Vec<Promotion>,
}

/// Record that a lineage keeps of an attempt; the attempt itself lies sealed in the store.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AttemptRecord {
    pub attempt: AttemptId,
    pub epoch: u32,
    pub slot: u32,
    /// `declined`, `invalid`, `rejected`, `evaluated`.
    pub exit: String,
    pub parent: SolutionId,
    pub parent_hash: Digest,
    /// The admitted program, where there is one.
    pub child: Option<SolutionId>,
    pub patch_hash: Option<Digest>,
    /// True if an acceptance gate held, in its own epoch or later.
    pub accepted: bool,
}

impl Lineage {
    /// Returns `true` if a program may be a leader: the parent, or a child that was accepted.
    pub(super) fn may_lead(&self, solution: &SolutionId) -> bool {
        let accepted = |record: &AttemptRecord| record.child.as_ref() == Some(solution) && record.accepted;
        *solution == self.parent || self.attempts.iter().any(accepted)
    }
}

impl AttemptRecord {
    pub(super) fn of(attempt: &Attempt) -> AttemptRecord {
        let candidate = match &attempt.exit {
            Exit::Rejected { candidate, .. } | Exit::Evaluated { candidate, .. } => Some(candidate),
            Exit::Declined { .. } | Exit::Invalid { .. } => None,
        };
        AttemptRecord {
            attempt: attempt.id.clone(),
            epoch: attempt.epoch,
            slot: attempt.slot,
            exit: attempt.exit.name().to_string(),
            parent: attempt.parent.clone(),
            parent_hash: attempt.parent_hash,
            child: candidate.map(|c| c.program.solution_id.clone()),
            patch_hash: candidate.map(|c| c.patch_hash),
            accepted: matches!(&attempt.exit, Exit::Evaluated { decision, .. } if decision.gates.any()),
        }
    }
}

/// One of a lineage's leaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Leader {
    Active,
    RealismAnchor,
}

/// A change of a leader, made after an epoch's barrier.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Promotion {
    pub epoch: u32,
    pub leader: Leader,
    pub from: SolutionId,
    pub to: SolutionId,
}

/// One program of a chain p_0 -> ... -> p_t.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Link {
    pub solution: SolutionId,
    pub program_hash: Digest,
    pub generation: u32,
    /// The patch that leads to the next link; `None` at the end.
    pub patch_hash: Option<Digest>,
}
