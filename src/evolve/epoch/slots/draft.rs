//! A proposal on its way: how far it came. Each step of the epoch takes a draft and hands it on.

use std::collections::BTreeSet;

use crate::candidates::{Admission, Trials};
use crate::epoch::RunError;
use crate::epoch::briefs::in_effect::InScene;
use crate::kernel::Digest;
use crate::objects::{
    Candidate, Exit, GateReport, Pilot, ProbePair, ProgramPatch, Proposal, Route, RouteDecision, Score, WorldRow,
};
use crate::world::Prediction;

/// Verdict of the gates on a patch, and what they learned of its child on the way.
pub struct Verdict {
    pub admission: Admission,
    /// Results of compiling it on probe scenes.
    pub trials: Trials,
    /// Its effect in each scene of the window; empty where the child breaks its contract so far that this cannot be told.
    pub in_effect: Vec<InScene>,
}

/// Parts of a proposal that are known from its first step on.
pub struct Head {
    pub slot: u32,
    /// Request to its slot.
    pub target: String,
    pub proposal: Proposal,
    /// Requests of the rollouts that set its free constants.
    pub tuning: BTreeSet<Digest>,
}

/// A proposal and how far it came.
pub struct Draft {
    pub head: Head,
    pub reached: Reached,
}

/// How far a proposal came. The first three of the four exits can be reached before any rollout.
pub enum Reached {
    Declined {
        reason: String,
    },
    /// With what the gates said of the patch, where they were asked already.
    Proposed {
        patch: Box<ProgramPatch>,
        verdict: Option<Box<Verdict>>,
    },
    Invalid {
        gates: GateReport,
    },
    Admitted {
        gates: GateReport,
        admitted: Box<Admitted>,
    },
    Predicted {
        gates: GateReport,
        predicted: Box<Predicted>,
    },
    Routed {
        gates: GateReport,
        routed: Box<RoutedCandidate>,
    },
    Evaluated {
        gates: GateReport,
        routed: Box<RoutedCandidate>,
        score: Score,
    },
}

/// A candidate that passed the gates, with what they learned of it.
pub struct Admitted {
    pub candidate: Candidate,
    pub patch: Box<ProgramPatch>,
    pub probes: Vec<ProbePair>,
    /// Its effect in each scene of the window.
    pub in_effect: Vec<InScene>,
}

/// An admitted candidate with what the world evaluator expects of it.
pub struct Predicted {
    pub candidate: Candidate,
    /// Row that the prediction rests on and that a label will be learned from.
    pub row: WorldRow,
    pub prediction: Prediction,
    /// For each scene of the window, true if it may differ from its parent there.
    pub open: Vec<bool>,
    /// Result of its pilot, where there is one.
    pub pilot: Option<Pilot>,
}

/// An admitted candidate with what the world evaluator decided about it.
pub struct RoutedCandidate {
    pub candidate: Candidate,
    pub route: Route,
    /// Row that a label will be learned from.
    pub row: WorldRow,
}

impl Head {
    /// A proposal before its constants are set.
    pub fn new(slot: u32, target: String, proposal: Proposal) -> Head {
        Head { slot, target, proposal, tuning: BTreeSet::new() }
    }
}

impl RoutedCandidate {
    pub fn is_rejected(&self) -> bool {
        self.route.decision == RouteDecision::Reject
    }
}

/// A proposal that was judged: which of the four exits it took.
pub struct Considered {
    pub head: Head,
    pub exit: Exit,
}

impl Draft {
    /// Takes the next step, which leaves alone what ended before it.
    pub fn next(self, step: impl FnOnce(u32, Reached) -> Result<Reached, RunError>) -> Result<Draft, RunError> {
        let reached = step(self.head.slot, self.reached)?;
        Ok(Draft { head: self.head, reached })
    }
}
