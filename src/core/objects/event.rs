//! The bodies of a transcript's events, in the order in which a run writes them. Every reader of a run (report,
//! lineage, audit) uses these types.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{
    attempt::{Attempt, Challenge},
    benchmark::HeldOutRun,
    card::Card,
    ids::{AttemptId, FamilyName, LineageId, SolutionId},
    origin::Origin,
    program::Program,
    replay::ReplayRow,
    score::{Objectives, SceneScore, Score},
};
use crate::kernel::Digest;

/// Kinds of events, as they stand in the transcript.
pub mod kind {
    /// Kind of the run's first event, with an [`Opened`](super::Opened) body.
    pub const OPENED: &str = "opened";
    /// Kind of the event of a lineage's parent, with a [`ParentAdopted`](super::ParentAdopted) body.
    pub const PARENT: &str = "parent";
    /// Kind of the event of a composed parent.
    pub const COMPOSED: &str = "composed";
    /// Kind of the event of counsel for a scene.
    pub const COUNSEL: &str = "counsel";
    /// Kind of the event that opens an epoch of a lineage, with a [`Frozen`](super::Frozen) body.
    pub const FROZEN: &str = "frozen";
    /// Kind of the event that seals an attempt.
    pub const ATTEMPT: &str = "attempt";
    /// Kind of the event that closes an epoch of a lineage, with a [`Settled`](super::Settled) body.
    pub const SETTLED: &str = "settled";
    /// Kind of a turn of the world agent, with a [`WorldEvolved`](super::super::world_audit::WorldEvolved) body; none without one.
    pub const WORLD: &str = "world";
    /// Kind of the event of a program that may be selected, with a [`Finalist`](super::Finalist) body.
    pub const FINALIST: &str = "finalist";
    /// Kind of the event of a round in SafeBench's protocol.
    pub const ROUND: &str = "round";
    /// Kind of the event of a held-out label, with a [`HeldOut`](super::HeldOut) body.
    pub const HELD_OUT: &str = "held_out";
    /// Kind of the do-nothing row, with a [`Replayed`](super::super::replay::Replayed) body.
    pub const REPLAY: &str = "replay";
    /// Kind of the last event, with a [`RunResult`](super::RunResult) body.
    pub const SEALED: &str = "sealed";
}

/// First event: the inputs of the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Opened {
    /// Name of the experiment.
    pub name: String,
    /// Digest of the experiment's content; file paths do not count.
    pub experiment: Digest,
    /// Digest of the scene pool.
    pub pool: Digest,
    /// Digest of the origins of the scenes and of the parts left out when they were imported; `None` for generated scenes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Digest>,
    /// Scene ids that evolution may see, in pool order, and those that stay closed until it is over.
    pub evolution_scenes: Vec<String>,
    /// Ids of the scenes on which finalists are chosen; none where that is done on those of evolution.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub selection_scenes: Vec<String>,
    /// Ids of the scenes that stay closed until selection is over.
    pub held_out_scenes: Vec<String>,
    /// Versions of meaning.
    pub versions: Versions,
    /// Contract digests by family.
    pub contracts: BTreeMap<FamilyName, Digest>,
    /// Label of the model of each role, asked or not. It begins with the model's kind.
    pub models: BTreeMap<String, String>,
    /// Which method searches and its budget, where the experiment says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<Searched>,
    /// Parts of the system that the run does without.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<String>,
    /// The experiment's own expression of attack, where it has one: its attack is no other experiment's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attack: Option<String>,
}

/// How a run searches.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Searched {
    /// Name of the method.
    pub method: String,
    /// Distinct rollouts on evolution scenes that a lineage may use; `None` where epochs and slots alone bound it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rollouts: Option<usize>,
}

/// Versions of meaning, which are part of every key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Versions {
    /// `ADAPTER_VERSION`.
    pub adapter: u32,
    /// `SIM_VERSION`.
    pub sim: u32,
    /// `EVAL_VERSION`.
    pub eval: u32,
}

/// Initial generator of a lineage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParentAdopted {
    /// Whose parent.
    pub lineage: LineageId,
    /// The ego that the lineage works against.
    pub ego: String,
    /// The parent.
    pub program: Program,
    /// Hash of its content.
    pub program_hash: Digest,
    /// Runs that it came from, the oldest first, where the experiment names a file; empty for a family's own parent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub origins: Vec<Origin>,
}

/// The immutable snapshot z_t that all slots of an epoch see (paper, appendix Parallel Candidate Epochs).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frozen {
    /// Epoch, from 0.
    pub epoch: u32,
    /// Whose epoch.
    pub lineage: LineageId,
    /// The active parent p_t.
    pub parent: SolutionId,
    /// Hash of its content.
    pub parent_hash: Digest,
    /// Ids of the window's scenes.
    pub window: Vec<String>,
    /// The parent's labels on this window.
    pub parent_score: Score,
    /// The program that the odd slots edit, under the rule of two anchors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub realism_anchor: Option<FrozenParent>,
    /// Another member of the front, which the slots that widen it edit, where one program leads and the front has more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub portfolio: Option<FrozenParent>,
    /// Under a method that draws parents: the one of each slot.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drawn: Vec<FrozenParent>,
    /// The front as measured on the scenes of all windows so far.
    pub front: Vec<FrontPoint>,
    /// Number of scenes in all windows so far.
    pub scenes_so_far: usize,
    /// Digest of the world evaluator's snapshot φ_t.
    pub world: Digest,
    /// Ids of the memory cards that the prompts show.
    pub memory_shown: Vec<String>,
    /// Proposals of the epoch.
    pub slots: u32,
}

impl Frozen {
    /// Returns the place of a slot's parent among those of the epoch: 0 for the first one.
    pub fn parent_place(&self, slot: u32) -> usize {
        if self.drawn.is_empty() { usize::from(self.second_parent(slot).is_some()) } else { slot as usize + 1 }
    }

    /// Returns the second parent that a slot edits; `None` where it edits the first. Under the rule of two anchors the odd slots edit
    /// the second; otherwise every third slot, whose target is to widen the front, edits the portfolio's member.
    pub fn second_parent(&self, slot: u32) -> Option<&FrozenParent> {
        if !self.drawn.is_empty() {
            return self.drawn.get(slot as usize);
        }
        match &self.realism_anchor {
            Some(anchor) => Some(anchor).filter(|_| slot % 2 == 1),
            None => self.portfolio.as_ref().filter(|_| slot % 3 == 2),
        }
    }
}

/// A second parent of an epoch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrozenParent {
    /// Its id.
    pub parent: SolutionId,
    /// Its program hash.
    pub parent_hash: Digest,
    /// Its labels on the window.
    pub parent_score: Score,
    /// Ids of the memory cards that its slots' prompts show.
    pub memory_shown: Vec<String>,
}

/// The state after the epoch's barrier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settled {
    /// Epoch, from 0.
    pub epoch: u32,
    /// Whose epoch.
    pub lineage: LineageId,
    /// The lineage's active program from here on.
    pub active: SolutionId,
    /// The program that the odd slots edit from here on, under the rule of two anchors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub realism_anchor: Option<SolutionId>,
    /// The first attempt that was promoted, if any.
    pub promoted: Option<AttemptId>,
    /// The front after the epoch.
    pub front: Vec<FrontPoint>,
    /// Its hypervolume.
    pub hypervolume: f64,
    /// Cards that the epoch added to memory.
    pub cards: Vec<Card>,
    /// Digest of the world evaluator's next snapshot.
    pub world: Digest,
    /// Labels in the world evaluator's calibration set.
    pub world_labels: usize,
    /// Later looks of this epoch at children of earlier ones, where the archive has challengers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub challenges: Vec<Challenge>,
    /// One digest over archive, lineage, memory and world.
    pub state: Digest,
}

/// A member of a non-dominated set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrontPoint {
    /// Which program.
    pub solution: SolutionId,
    /// F(c).
    pub objectives: Objectives,
}

/// Labels of a finalist on the whole evolution pool: the basis of the final choice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finalist {
    /// Whose finalist.
    pub lineage: LineageId,
    /// Which program.
    pub solution: SolutionId,
    /// Its score on the scenes on which finalists are chosen: those of selection, or the whole evolution pool.
    pub score: Score,
}

/// Held-out labels of one program, taken after selection was over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// Whose program.
    pub lineage: LineageId,
    /// Which program.
    pub solution: SolutionId,
    /// `parent`, `active`, `endpoint`, `descendant` (several may hold).
    pub roles: Vec<String>,
    /// Its score on the held-out scenes.
    pub score: Score,
    /// SafeBench's protocol: the runs that the score's rows are taken from, in the order of the scenes. Empty in the other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub runs: Vec<HeldOutRun>,
}

/// Last event: the result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// The recorded scenes without a program, by ego and suite: the baseline of every number below.
    pub replay: Vec<ReplayRow>,
    /// One result per lineage, in the experiment's order.
    pub lineages: Vec<LineageResult>,
    /// Number of attempts that left by each exit.
    pub exits: ExitCounts,
    /// Epochs that were run.
    pub epochs: u32,
    /// Rollouts that the result rests on: distinct requests, cached or not.
    pub rollouts: usize,
}

/// Number of attempts that left by each exit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExitCounts {
    /// No usable patch.
    pub declined: usize,
    /// A gate failed.
    pub invalid: usize,
    /// The router judged a rollout not worth its cost.
    pub rejected: usize,
    /// Labels exist.
    pub evaluated: usize,
}

impl ExitCounts {
    /// Counts one more attempt.
    pub fn count(&mut self, attempt: &Attempt) {
        use super::attempt::Exit;
        match attempt.exit {
            Exit::Declined { .. } => self.declined += 1,
            Exit::Invalid { .. } => self.invalid += 1,
            Exit::Rejected { .. } => self.rejected += 1,
            Exit::Evaluated { .. } => self.evaluated += 1,
        }
    }

    /// All attempts.
    pub fn total(&self) -> usize {
        self.declined + self.invalid + self.rejected + self.evaluated
    }
}

/// One row of the main table: parent against evolved, on held-out scenes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineageResult {
    /// Which lineage.
    pub lineage: LineageId,
    /// The lineage of the experiment file that this one repeats.
    pub group: LineageId,
    /// Which repetition it is, from 0.
    pub replica: u32,
    /// Its family.
    pub family: FamilyName,
    /// Its ego.
    pub ego: String,
    /// The family's parent on the held-out scenes.
    pub parent: Measured,
    /// The active generator by the realism-constrained rule, chosen on evolution labels.
    pub evolved: Measured,
    /// Why that one.
    pub selection: String,
    /// Descendants that the budget of finalists left out, the most promising first.
    pub cut: Vec<SolutionId>,
    /// The best evaluated descendant of the local trace.
    pub endpoint: Option<Measured>,
    /// Programs that the rule chooses at other values of `realism_min`, that of the active generator among them, in rising order;
    /// empty where the experiment declares none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub at_realism: Vec<AtRealism>,
    /// Matched-budget frontier gain, percent (paper eq. app-pf-area, k = 3).
    pub pf_area_at_3_pct: f64,
    /// In SafeBench's protocol: the gain of every group (`family/route`); the field above is their mean.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub pf_area_at_3_pct_by_group: BTreeMap<String, f64>,
    /// The evolution front after the last epoch.
    pub front: Vec<FrontPoint>,
    /// Hypervolume of the front after each epoch. `[epochs]`
    pub hypervolume_by_epoch: Vec<f64>,
    /// Number of attempts that left by each exit.
    pub exits: ExitCounts,
    /// Number of held-out scenes that were labelled.
    pub held_out_scenes: usize,
}

/// The program that the rule chooses at one value of `realism_min`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AtRealism {
    /// Least realism on evolution scenes, 1.
    pub realism_min: f64,
    /// True if it reaches that realism; otherwise it is the most realistic one.
    pub reached: bool,
    /// The program on the held-out scenes. It may be the parent.
    pub chosen: Measured,
}

/// A program with its held-out objectives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Which program.
    pub solution: SolutionId,
    /// F(c) on the held-out scenes.
    pub objectives: Objectives,
    /// RP = 100 (1 - R), per cent.
    pub realism_penalty_pct: f64,
    /// Share of the held-out scenes that the program acts in, 0..=1.
    pub coverage: f64,
    /// Share of the held-out scenes in which the ego meets anyone, 0..=1: attack as published work reads it.
    pub any_contact: f64,
}

impl Measured {
    /// Reads the numbers off a score.
    pub fn new(solution: SolutionId, score: &Score) -> Measured {
        let alone = || score.scenes.iter().flat_map(SceneScore::each);
        let met = alone().filter(|label| label.contact.is_some()).count();
        Measured {
            solution,
            objectives: score.objectives,
            realism_penalty_pct: score.objectives.realism_penalty_pct(),
            coverage: score.coverage,
            any_contact: if met == 0 { 0.0 } else { met as f64 / alone().count() as f64 },
        }
    }
}
