//! The bodies of a transcript's events, in the order in which a run writes them. Whoever reads a run (report,
//! lineage, audit) reads these.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{
    attempt::Attempt,
    card::Card,
    ids::{AttemptId, FamilyName, LineageId, SolutionId},
    program::Program,
    score::{Objectives, Score},
};
use crate::kernel::Digest;

/// Kinds of events, as they stand in the transcript.
pub mod kind {
    pub const OPENED: &str = "opened";
    pub const PARENT: &str = "parent";
    pub const COMPOSED: &str = "composed";
    pub const COUNSEL: &str = "counsel";
    pub const FROZEN: &str = "frozen";
    pub const ATTEMPT: &str = "attempt";
    pub const SETTLED: &str = "settled";
    pub const FINALIST: &str = "finalist";
    pub const ROUND: &str = "round";
    pub const HELD_OUT: &str = "held_out";
    pub const SEALED: &str = "sealed";
}

/// First event: what the run is a function of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Opened {
    pub name: String,
    /// Digest of the experiment's content; file paths do not count.
    pub experiment: Digest,
    /// Digest of the scene pool.
    pub pool: Digest,
    /// Scene ids that evolution may see, in pool order, and those that stay closed until it is over.
    pub evolution_scenes: Vec<String>,
    pub held_out_scenes: Vec<String>,
    pub versions: Versions,
    /// Contract digests by family.
    pub contracts: BTreeMap<FamilyName, Digest>,
    /// Label of the model of each role, which opens with the model's kind: what the proposals come from.
    pub models: BTreeMap<String, String>,
}

impl Opened {
    /// Roles that the scripted stand-in answered, by the kind of their models.
    pub fn scripted_roles(&self) -> Vec<&str> {
        let scripted = |label: &str| label.split(' ').next() == Some("scripted");
        self.models.iter().filter(|(_, label)| scripted(label)).map(|(role, _)| role.as_str()).collect()
    }
}

/// Versions of meaning, which are part of every key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Versions {
    pub adapter: u32,
    pub sim: u32,
    pub eval: u32,
}

/// A lineage's initial generator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParentAdopted {
    pub lineage: LineageId,
    pub ego: String,
    pub program: Program,
    pub program_hash: Digest,
}

/// The immutable snapshot z_t that all slots of an epoch see (paper, appendix Parallel Candidate Epochs).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frozen {
    pub epoch: u32,
    pub lineage: LineageId,
    pub parent: SolutionId,
    pub parent_hash: Digest,
    /// Ids of the window's scenes.
    pub window: Vec<String>,
    /// The parent's labels on this window.
    pub parent_score: Score,
    pub world: Digest,
    pub memory_shown: Vec<String>,
    pub slots: u32,
}

/// The state after the epoch's barrier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settled {
    pub epoch: u32,
    pub lineage: LineageId,
    /// The lineage's active program from here on.
    pub active: SolutionId,
    /// The attempt that was promoted, if any.
    pub promoted: Option<AttemptId>,
    pub front: Vec<FrontPoint>,
    pub hypervolume: f64,
    pub cards: Vec<Card>,
    pub world: Digest,
    /// Labels in the world evaluator's calibration set.
    pub world_labels: usize,
    /// One digest over archive, lineage, memory and world.
    pub state: Digest,
}

/// A member of a non-dominated set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrontPoint {
    pub solution: SolutionId,
    pub objectives: Objectives,
}

/// Labels of a finalist on the whole evolution pool: what the final choice rests on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finalist {
    pub lineage: LineageId,
    pub solution: SolutionId,
    pub score: Score,
}

/// Held-out labels of one program, taken after selection was over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    pub lineage: LineageId,
    pub solution: SolutionId,
    /// `parent`, `active`, `endpoint`, `descendant` (several may hold).
    pub roles: Vec<String>,
    pub score: Score,
}

/// Last event: the result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    pub lineages: Vec<LineageResult>,
    pub exits: ExitCounts,
    pub epochs: u32,
    /// Rollouts that the result rests on: distinct requests, cached or not.
    pub rollouts: usize,
}

/// How many attempts left by which exit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExitCounts {
    pub declined: usize,
    pub invalid: usize,
    pub rejected: usize,
    pub evaluated: usize,
}

impl ExitCounts {
    pub fn count(&mut self, attempt: &Attempt) {
        use super::attempt::Exit;
        match attempt.exit {
            Exit::Declined { .. } => self.declined += 1,
            Exit::Invalid { .. } => self.invalid += 1,
            Exit::Rejected { .. } => self.rejected += 1,
            Exit::Evaluated { .. } => self.evaluated += 1,
        }
    }

    pub fn total(&self) -> usize {
        self.declined + self.invalid + self.rejected + self.evaluated
    }
}

/// One row of the main table: parent against evolved, on held-out scenes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineageResult {
    pub lineage: LineageId,
    pub family: FamilyName,
    pub ego: String,
    pub parent: Measured,
    /// The active generator by the realism-constrained rule, chosen on evolution labels.
    pub evolved: Measured,
    /// Why that one.
    pub selection: String,
    /// The best evaluated descendant of the local trace.
    pub endpoint: Option<Measured>,
    /// Matched-budget frontier gain, percent (paper eq. app-pf-area, k = 3).
    pub pf_area_at_3_pct: f64,
    /// In SafeBench's protocol: the same of every group (`family/route`), whose mean it is.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub pf_area_at_3_pct_by_group: BTreeMap<String, f64>,
    /// The evolution front after the last epoch.
    pub front: Vec<FrontPoint>,
    pub hypervolume_by_epoch: Vec<f64>,
    pub exits: ExitCounts,
    pub held_out_scenes: usize,
}

/// A program with its held-out objectives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    pub solution: SolutionId,
    pub objectives: Objectives,
    pub realism_penalty_pct: f64,
}

impl Measured {
    pub fn new(solution: SolutionId, objectives: Objectives) -> Measured {
        Measured { solution, objectives, realism_penalty_pct: objectives.realism_penalty_pct() }
    }
}
