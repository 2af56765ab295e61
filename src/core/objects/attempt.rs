//! The record of one proposal, however it ended. Sealed once, never changed.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{
    ids::{AttemptId, CardId, LineageId, SolutionId},
    patch::ProgramPatch,
    program::{HashedProgram, Program},
    review::{Review, Role},
    score::{Objectives, Score},
};
use crate::kernel::Digest;

/// One proposal from the first prompt to the archive's decision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attempt {
    /// Lineage, epoch and slot in one name.
    pub id: AttemptId,
    /// The lineage that it was proposed in.
    pub lineage: LineageId,
    /// Epoch, from 0.
    pub epoch: u32,
    /// Place among the proposals of its epoch, from 0.
    pub slot: u32,
    /// The program that it wanted to change.
    pub parent: SolutionId,
    /// Hash of that program's content.
    pub parent_hash: Digest,
    /// Target given to the search in this slot.
    pub target: String,
    /// Cards that the actor was shown.
    pub memory_shown: Vec<CardId>,
    /// Questions to the agents and their answers.
    pub proposal: Proposal,
    /// How far it came.
    pub exit: Exit,
}

/// Record of the role loop (paper, algorithm actor_critic_mutation).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Proposal {
    /// Every question that was asked, in order.
    pub exchanges: Vec<Exchange>,
    /// Round 0 is the actor's patch; later ones are repairs.
    pub rounds: Vec<Round>,
    /// How the last patch's constants were set, where it left some free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tuned: Option<Box<Tuned>>,
}

/// One question to a model and the bytes that came back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Exchange {
    /// Role that was asked.
    pub role: Role,
    /// Repair round, from 0: the actor's own proposal is round 0.
    pub round: u32,
    /// Key of the request.
    pub request: Digest,
    /// Digest of the raw response bytes.
    pub response: Digest,
    /// Name of the model as the experiment file has it.
    pub model: String,
    /// Digest of the provider's data about the answer, where it sent any and the recording seals it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub metadata: Option<Digest>,
    /// Texts stripped from around the reply before it was read, where the model's options ask for that.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unwrapped: Vec<String>,
    /// Why the reply could not be used, if so.
    pub refusal: Option<String>,
}

/// One patch and what the critics said about it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// The patch as parsed; `None` where the answer held none.
    pub patch: Option<ProgramPatch>,
    /// One review per critic, in the order in which they were asked; a critic without a readable answer has none.
    pub reviews: Vec<Review>,
}

/// Record of a numeric search over the free constants of a patch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tuned {
    /// The patch with the values that were taken.
    pub patch: ProgramPatch,
    /// Number of scenes that each look took, smallest first. All are evolution scenes outside the epoch's window.
    pub scenes: Vec<usize>,
    /// Settings that were tried, the patch's own first.
    pub draws: Vec<TunedDraw>,
    /// Place among them of the one that was taken.
    pub taken: usize,
    /// Distinct rollouts behind it, those of the parent included.
    pub rollouts: usize,
}

/// One setting of a patch's free constants.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TunedDraw {
    /// Values by name, in the units of their places.
    pub values: BTreeMap<String, f64>,
    /// Attack and realism at each look that it was in; none where a gate refused it.
    pub looks: Vec<Objectives>,
}

impl Proposal {
    /// The last patch that could be parsed, with its constants as they were set.
    pub fn patch(&self) -> Option<&ProgramPatch> {
        let tuned = self.tuned.as_ref().map(|tuned| &tuned.patch);
        tuned.or_else(|| self.rounds.iter().rev().find_map(|round| round.patch.as_ref()))
    }
}

impl Tuned {
    /// The search in a sentence.
    pub fn in_words(&self) -> String {
        let Tuned { scenes, draws, taken, rollouts, .. } = self;
        let looks = scenes.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
        let first = draws.first().map(|draw| &draw.values);
        let values = draws.get(*taken).into_iter().flat_map(|draw| &draw.values).map(|(name, value)| {
            let start = first.and_then(|first| first.get(name)).filter(|start| *start != value);
            format!("{name} {}{value}", start.map_or(String::new(), |start| format!("{start} -> ")))
        });
        let values = values.collect::<Vec<_>>().join(", ");
        let refused = draws.iter().filter(|draw| draw.looks.is_empty()).count();
        let looked = if looks.is_empty() {
            "none was tried, because the budget of rollouts was too small".to_string()
        } else {
            format!("{} settings ({refused} without a label) in {looks} scenes, {rollouts} rollouts", draws.len())
        };
        format!("free constants: {looked}; setting {} was taken: {values}", taken + 1)
    }
}

/// The four exits: how far a patch came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "exit")]
pub enum Exit {
    /// No usable patch came out of the role loop.
    Declined {
        /// Why there is no usable patch.
        reason: String,
    },
    /// A gate failed; nothing was simulated.
    Invalid {
        /// Verdict of each gate.
        gates: GateReport,
    },
    /// The world evaluator judged it not worth a rollout.
    Rejected {
        /// Verdict of each gate.
        gates: GateReport,
        /// The admitted child.
        candidate: Box<Candidate>,
        /// Why the world evaluator judged a rollout not worth its cost.
        route: Route,
    },
    /// It has labels from the simulator.
    Evaluated {
        /// Verdict of each gate.
        gates: GateReport,
        /// The admitted child.
        candidate: Box<Candidate>,
        /// Why it was simulated.
        route: Route,
        /// Measurements of the rollouts.
        score: Score,
        /// The archive's decision on the score.
        decision: Decision,
    },
}

impl Exit {
    /// Returns the word for it in events, reports and counts.
    pub fn name(&self) -> &'static str {
        match self {
            Exit::Declined { .. } => "declined",
            Exit::Invalid { .. } => "invalid",
            Exit::Rejected { .. } => "rejected",
            Exit::Evaluated { .. } => "evaluated",
        }
    }

    /// Returns the admitted child; `None` if the gates did not admit one.
    pub fn candidate(&self) -> Option<&Candidate> {
        match self {
            Exit::Declined { .. } | Exit::Invalid { .. } => None,
            Exit::Rejected { candidate, .. } | Exit::Evaluated { candidate, .. } => Some(candidate),
        }
    }

    /// Returns the gates' verdicts; `None` where no gate was reached.
    pub fn gates(&self) -> Option<&GateReport> {
        match self {
            Exit::Declined { .. } => None,
            Exit::Invalid { gates } | Exit::Rejected { gates, .. } | Exit::Evaluated { gates, .. } => Some(gates),
        }
    }

    /// Returns the world evaluator's routing; `None` before that stage.
    pub fn route(&self) -> Option<&Route> {
        match self {
            Exit::Declined { .. } | Exit::Invalid { .. } => None,
            Exit::Rejected { route, .. } | Exit::Evaluated { route, .. } => Some(route),
        }
    }

    /// Returns the measurements of the rollouts; `None` where there were none.
    pub fn score(&self) -> Option<&Score> {
        match self {
            Exit::Evaluated { score, .. } => Some(score),
            _ => None,
        }
    }

    /// Returns the archive's decision; `None` without a score.
    pub fn decision(&self) -> Option<&Decision> {
        match self {
            Exit::Evaluated { decision, .. } => Some(decision),
            _ => None,
        }
    }
}

/// The gates, in the order in which they run: the paper's seven (eq. app-validation-gates), and one that turns away a child
/// that does what its parent does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    /// The patch has the required fields, with values of the right type.
    Schema,
    /// The patch names this parent and its hash.
    Parent,
    /// The child obeys its family's contract (I_b).
    Interface,
    /// Nothing in the patch belongs to another family.
    Isolation,
    /// The patch touches nothing that is protected: ego, scenes, metrics, acceptor.
    Protected,
    /// Every mechanism of the child can be parsed, typed and bounded.
    Mechanism,
    /// The child compiles on the probe scenes.
    Compile,
    /// The compiled interventions differ from the parent's on some probe scene.
    Effect,
}

impl Gate {
    /// Number of gates: the paper's seven, and the no-effect gate.
    pub const COUNT: usize = 8;

    /// Returns the gate's name for people.
    pub fn name(self) -> &'static str {
        match self {
            Gate::Schema => "schema",
            Gate::Parent => "parent",
            Gate::Interface => "interface",
            Gate::Isolation => "isolation",
            Gate::Protected => "protected",
            Gate::Mechanism => "mechanism",
            Gate::Compile => "compile",
            Gate::Effect => "effect",
        }
    }
}

/// All verdicts. A gate that could not run because an earlier one left nothing to check fails too, except for the last,
/// which judges only what was compiled.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GateReport {
    /// One verdict per gate, in the order in which the gates ran.
    pub verdicts: Vec<GateVerdict>,
}

impl GateReport {
    /// Returns `true` if every gate passed.
    pub fn passed(&self) -> bool {
        self.verdicts.len() == Gate::COUNT && self.verdicts.iter().all(|v| v.problems.is_empty())
    }

    /// Returns the verdicts of the gates that did not pass, in their order.
    pub fn failed(&self) -> impl Iterator<Item = &GateVerdict> {
        self.verdicts.iter().filter(|v| !v.problems.is_empty())
    }
}

/// Verdict of one gate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GateVerdict {
    /// Which gate.
    pub gate: Gate,
    /// Empty = passed. Each says place, what was found, what is expected.
    pub problems: Vec<String>,
}

/// An admitted child program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// The child.
    pub program: Program,
    /// Hash of the child's content.
    pub program_hash: Digest,
    /// Digest of the patch that made it.
    pub patch_hash: Digest,
    /// Tags of its mechanisms, sorted, without repeats.
    pub mechanism_tags: Vec<String>,
}

impl Candidate {
    /// The child with its hash.
    pub fn hashed(&self) -> HashedProgram<'_> {
        HashedProgram { program: &self.program, hash: self.program_hash }
    }
}

/// Prediction and decision of the world evaluator (paper eq. method-routing).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Route {
    /// d_φ: simulate or not.
    pub decision: RouteDecision,
    /// Why, in words for people.
    pub reason: RouteReason,
    /// Digest of the world snapshot that decided.
    pub snapshot: Digest,
    /// The parent's labels with the predicted difference (paper F̂_φ).
    pub predicted: Objectives,
    /// Û_φ: half width of the wider one of the two intervals around that prediction.
    pub uncertainty: f64,
    /// Half widths of the intervals for attack and realism.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_width: Option<Objectives>,
    /// Score that candidates are ranked by: the predicted gain against the parent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rank_score: Option<f64>,
    /// For a candidate that was simulated because it was drawn: number of candidates in the drawing that it stands for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    /// Result of a pilot before candidates were ranked; the rank score includes it, the prediction does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pilot: Option<Pilot>,
}

/// Why a candidate is simulated or not; recorded as its words alone.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum RouteReason {
    /// The rank left it out, and it was drawn to check whether that was wrong; the text holds the remaining words.
    Monitored(String),
    /// Anything else, in words.
    Other(String),
}

/// Prefix of the words of a monitored candidate.
const MONITORED: &str = "audit: left out by the rank, drawn at random";

impl RouteReason {
    /// Appends more words.
    pub fn with(mut self, more: &str) -> RouteReason {
        let (RouteReason::Monitored(words) | RouteReason::Other(words)) = &mut self;
        words.push_str(more);
        self
    }
}

/// Recorded words are read only here.
impl From<String> for RouteReason {
    fn from(words: String) -> RouteReason {
        match words.strip_prefix(MONITORED) {
            Some(besides) => RouteReason::Monitored(besides.into()),
            None => RouteReason::Other(words),
        }
    }
}

impl From<RouteReason> for String {
    fn from(reason: RouteReason) -> String {
        match reason {
            RouteReason::Monitored(besides) => format!("{MONITORED}{besides}"),
            RouteReason::Other(words) => words,
        }
    }
}

/// Rollouts of a candidate in a few scenes, made before candidates are ranked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pilot {
    /// Ids of the scenes that were simulated, in the order in which the pilot takes them.
    pub scenes: Vec<String>,
    /// Mean over those that have labels of candidate and parent: attack and realism less the parent's; 0 where none has.
    pub difference: Objectives,
    /// Number of scenes that have both labels.
    pub labelled: u32,
}

/// d_φ: what the world evaluator does with a candidate (paper eq. method-routing).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RouteDecision {
    /// Ranked within the budget: simulate.
    Select,
    /// Not worth a rollout: do not simulate.
    Reject,
    /// Drawn at random: simulate, to learn and to check the evaluator.
    Audit,
}

/// Decision of the archive, with the numbers of each gate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// True if it becomes the lineage's active parent.
    pub promoted: bool,
    /// True if it is a member of the non-dominated set after the decision.
    pub on_front: bool,
    /// The acceptance gates.
    pub gates: Box<AcceptanceGates>,
    /// Result of the race that decides whether it may lead; `None` where no race was run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub race: Option<Race>,
}

/// A child beside its parent on more and more evolution scenes, until its gain is shown or nothing is left to show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Race {
    /// True if the gain was shown.
    pub shown: bool,
    /// Each comparison, on the scenes of the one before it and further ones.
    pub looks: Vec<Look>,
}

/// A later look at a child with a gain that its epoch measured and could not show.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Challenge {
    /// The child.
    pub solution: SolutionId,
    /// Which look it was, from 1; its own epoch's does not count.
    pub looks: u32,
    /// What became of it.
    pub verdict: ChallengeVerdict,
    /// Comparison with the leader and the front, on all windows so far.
    pub gates: Box<AcceptanceGates>,
    /// Its race, where it was to lead and a race was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub race: Option<Race>,
}

/// What became of a challenger.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChallengeVerdict {
    /// Its gain is shown: from now on it is an accepted child.
    Accepted,
    /// Its gain is measured still and not shown.
    Stays,
    /// Nothing of its gain is left, or its looks are used up.
    Dropped,
}

/// One comparison of a race.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Look {
    /// Confidence at which it had to show the gain, 1.
    pub level: f64,
    /// Verdicts of the gates on it beside its parent alone.
    pub gates: Box<AcceptanceGates>,
}

/// The three acceptance gates (paper, section Simulator Evaluation and Pareto Archive) with what they compared, and the two
/// conditions before them. Differences are paired: child, parent and front are compared on the same scenes, and every
/// difference stands beside its standard error.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AcceptanceGates {
    /// Gate for a child that makes the front denser.
    pub densification: Densification,
    /// Gate for a child that pushes the front in a region of high realism or high attack.
    pub local_push: LocalPush,
    /// Gate for a child that improves on its parent at a bounded loss.
    pub parent_tradeoff: ParentTradeoff,
    /// Condition that it acts in enough scenes.
    pub coverage: CoverageFloor,
    /// Paired scenes in which the child's labels are not its parent's.
    pub differing_scenes: usize,
    /// True if it may be accepted without any such scene.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub may_do_as_parent: bool,
    /// Number of paired scenes that every difference here rests on.
    pub scenes: usize,
    /// Verdict of the method that decides in place of the three gates, if one does. The gates above are recorded all the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<MethodVerdict>,
    /// Groups whose archives accept it, where each group of family and route has its own archive. The gates above are of all runs and
    /// are recorded all the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub groups: Option<Vec<String>>,
    /// Under shuffled labels: the candidate of the same epoch whose labels were compared in its place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub labels_of: Option<SolutionId>,
}

/// Verdict on a child of a search method other than the gates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MethodVerdict {
    /// Name of the method.
    pub method: String,
    /// True if it keeps the child.
    pub holds: bool,
    /// The child's score under the method, 1; `None` where it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub score: Option<f64>,
}

impl AcceptanceGates {
    /// Returns `true` if the child is accepted: by one of the three gates, if it acts often enough and, unless that is waived, differs
    /// from its parent; by the archive of some group, where groups have their own; or by the method that decides in their place, if it
    /// acts at all.
    pub fn any(&self) -> bool {
        if let Some(verdict) = &self.method {
            return verdict.holds && self.coverage.coverage > 0.0;
        }
        if let Some(groups) = &self.groups {
            return !groups.is_empty();
        }
        let by_a_gate = self.densification.holds || self.local_push.holds || self.parent_tradeoff.holds;
        self.coverage.holds && (self.differing_scenes > 0 || self.may_do_as_parent) && by_a_gate
    }
}

/// A difference of two programs on the same scenes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// The first program's mean minus the second's.
    pub value: f64,
    /// Standard error; `None` of a single scene.
    pub uncertainty: Option<f64>,
}

/// Frontier densification: non-dominated, with a gain of hypervolume.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Densification {
    /// True if the gate accepts.
    pub holds: bool,
    /// True if no member of the front dominates it.
    pub non_dominated: bool,
    /// Hypervolume of the front without it.
    pub hypervolume_before: f64,
    /// ΔHV(c): hypervolume with it minus hypervolume without it.
    pub hypervolume_gain: f64,
    /// Standard error of the gain; `None` of a single scene.
    pub uncertainty: Option<f64>,
}

/// Local frontier push: better attack at high realism, or better realism at high attack.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LocalPush {
    /// True if the gate accepts.
    pub holds: bool,
    /// Largest attack of the front where R >= r0; `None` where that region is empty.
    pub best_attack_at_r0: Option<f64>,
    /// Largest realism of the front where A >= a0; `None` where that region is empty.
    pub best_realism_at_a0: Option<f64>,
    /// Attack beyond that best one, of a child in the region; `None` elsewhere.
    pub attack_push: Option<Difference>,
    /// Realism beyond that best one, of a child in the region; `None` elsewhere.
    pub realism_push: Option<Difference>,
}

/// Parent trade-off push: one objective better, the other not worse than a tolerance allows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParentTradeoff {
    /// True if the gate accepts.
    pub holds: bool,
    /// A(c) - A(p).
    pub attack_change: f64,
    /// Standard error of the change; `None` of a single scene.
    pub attack_uncertainty: Option<f64>,
    /// R(c) - R(p).
    pub realism_change: f64,
    /// Standard error of the change; `None` of a single scene.
    pub realism_uncertainty: Option<f64>,
}

/// Condition that a program acts about as often as its parent. Coverage is the share of scenes in which a program acts, 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CoverageFloor {
    /// True if the child acts often enough.
    pub holds: bool,
    /// The child's coverage.
    pub coverage: f64,
    /// Its parent's coverage.
    pub parent: f64,
    /// Least coverage that is accepted.
    pub floor: f64,
}
