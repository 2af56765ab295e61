//! The record of one proposal, however it ended. Sealed once, never changed.

use serde::{Deserialize, Serialize};

use super::{
    ids::{AttemptId, CardId, LineageId, SolutionId},
    patch::ProgramPatch,
    program::Program,
    review::{Review, Role},
    score::{Objectives, Score},
};
use crate::kernel::Digest;

/// One proposal from the first prompt to the archive's decision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attempt {
    pub id: AttemptId,
    pub lineage: LineageId,
    pub epoch: u32,
    pub slot: u32,
    pub parent: SolutionId,
    pub parent_hash: Digest,
    /// What the search was asked for in this slot.
    pub target: String,
    /// Cards that the actor was shown.
    pub memory_shown: Vec<CardId>,
    pub proposal: Proposal,
    pub exit: Exit,
}

/// What the role loop did (paper, algorithm actor_critic_mutation).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Proposal {
    /// Every question that was asked, in order.
    pub exchanges: Vec<Exchange>,
    /// Round 0 is the actor's patch; later ones are repairs.
    pub rounds: Vec<Round>,
}

/// One question to a model and the bytes that came back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Exchange {
    pub role: Role,
    pub round: u32,
    /// Key of the request.
    pub request: Digest,
    /// Digest of the raw response bytes.
    pub response: Digest,
    /// Name of the model as the experiment file has it.
    pub model: String,
    /// Why the reply could not be used, if so.
    pub refusal: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Round {
    pub patch: Option<ProgramPatch>,
    pub reviews: Vec<Review>,
}

impl Proposal {
    /// The last patch that could be parsed.
    pub fn patch(&self) -> Option<&ProgramPatch> {
        self.rounds.iter().rev().find_map(|round| round.patch.as_ref())
    }
}

/// The four exits: how far a patch came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "exit")]
pub enum Exit {
    /// No usable patch came out of the role loop.
    Declined { reason: String },
    /// A gate failed; nothing was simulated.
    Invalid { gates: GateReport },
    /// The world evaluator judged it not worth a rollout.
    Rejected { gates: GateReport, candidate: Box<Candidate>, route: Route },
    /// It has labels from the simulator.
    Evaluated { gates: GateReport, candidate: Box<Candidate>, route: Route, score: Score, decision: Decision },
}

impl Exit {
    pub fn name(&self) -> &'static str {
        match self {
            Exit::Declined { .. } => "declined",
            Exit::Invalid { .. } => "invalid",
            Exit::Rejected { .. } => "rejected",
            Exit::Evaluated { .. } => "evaluated",
        }
    }

    /// The admitted child, where it came that far.
    pub fn candidate(&self) -> Option<&Candidate> {
        match self {
            Exit::Declined { .. } | Exit::Invalid { .. } => None,
            Exit::Rejected { candidate, .. } | Exit::Evaluated { candidate, .. } => Some(candidate),
        }
    }

    pub fn gates(&self) -> Option<&GateReport> {
        match self {
            Exit::Declined { .. } => None,
            Exit::Invalid { gates } | Exit::Rejected { gates, .. } | Exit::Evaluated { gates, .. } => Some(gates),
        }
    }

    pub fn route(&self) -> Option<&Route> {
        match self {
            Exit::Declined { .. } | Exit::Invalid { .. } => None,
            Exit::Rejected { route, .. } | Exit::Evaluated { route, .. } => Some(route),
        }
    }

    pub fn score(&self) -> Option<&Score> {
        match self {
            Exit::Evaluated { score, .. } => Some(score),
            _ => None,
        }
    }

    pub fn decision(&self) -> Option<&Decision> {
        match self {
            Exit::Evaluated { decision, .. } => Some(decision),
            _ => None,
        }
    }
}

/// The seven gates, in the order in which they run (paper eq. app-validation-gates).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    Schema,
    Parent,
    Interface,
    Isolation,
    Protected,
    Mechanism,
    Compile,
}

/// All seven verdicts. A gate that could not run because an earlier one left nothing to look at fails too.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GateReport {
    pub verdicts: Vec<GateVerdict>,
}

impl GateReport {
    pub fn passed(&self) -> bool {
        self.verdicts.len() == 7 && self.verdicts.iter().all(|v| v.problems.is_empty())
    }

    pub fn failed(&self) -> impl Iterator<Item = &GateVerdict> {
        self.verdicts.iter().filter(|v| !v.problems.is_empty())
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GateVerdict {
    pub gate: Gate,
    /// Empty = passed. Each says place, what was found, what is expected.
    pub problems: Vec<String>,
}

/// An admitted child program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    pub program: Program,
    pub program_hash: Digest,
    pub patch_hash: Digest,
    /// Tags of its mechanisms, sorted, without repeats.
    pub mechanism_tags: Vec<String>,
}

/// What the world evaluator predicted and decided (paper eq. method-routing).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Route {
    pub decision: RouteDecision,
    pub reason: String,
    /// Digest of the world snapshot that decided.
    pub snapshot: Digest,
    pub predicted: Objectives,
    pub uncertainty: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RouteDecision {
    Select,
    Reject,
    Audit,
}

/// What the archive decided, with the numbers of each gate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// Whether it becomes the lineage's active parent.
    pub promoted: bool,
    /// Whether it is a member of the non-dominated set after the decision.
    pub on_front: bool,
    pub gates: AcceptanceGates,
}

/// The three acceptance gates (paper, section Simulator Evaluation and Pareto Archive) with what they compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AcceptanceGates {
    pub densification: Densification,
    pub local_push: LocalPush,
    pub parent_tradeoff: ParentTradeoff,
}

impl AcceptanceGates {
    pub fn any(&self) -> bool {
        self.densification.holds || self.local_push.holds || self.parent_tradeoff.holds
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Densification {
    pub holds: bool,
    pub non_dominated: bool,
    pub hypervolume_before: f64,
    pub hypervolume_gain: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LocalPush {
    pub holds: bool,
    /// Largest attack of the front where R >= r0; `None` where that region is empty.
    pub best_attack_at_r0: Option<f64>,
    /// Largest realism of the front where A >= a0; `None` where that region is empty.
    pub best_realism_at_a0: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParentTradeoff {
    pub holds: bool,
    pub attack_change: f64,
    pub realism_change: f64,
}
