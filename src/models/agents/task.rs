//! The inputs of a proposal: the context that all slots and roles of an epoch share, and the task of one slot.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{
    Handbook,
    history::PastEdit,
    tables::{Cluster, FrontPoint},
    window::SceneRow,
};
use crate::{
    kernel::Digest,
    llm::ModelSpec,
    objects::{Card, GatesAsked, LineageId, Objectives, Program, Role, UnreadableCritic, UnreadablePatch},
};

/// Form of a run's questions. Recorded answers are kept under their questions, so an earlier form stays as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Questions {
    /// The first form: what became of each scene in a word.
    #[default]
    Plain,
    /// Says how each scene came about, what nearly happened, why an edit did nothing and why a child was not accepted.
    Detailed,
    /// Says what a detailed question says, in fewer tokens.
    Compact,
}

impl Questions {
    /// Returns `true` if it is the first form.
    pub fn is_plain(&self) -> bool {
        *self == Questions::Plain
    }

    /// Returns `true` if it is the short form of detailed questions.
    pub fn is_compact(&self) -> bool {
        *self == Questions::Compact
    }
}

/// Everything of the frozen snapshot that prompts of one lineage and epoch show. Every slot and every role sees the same.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a> {
    /// Lineage whose epoch it is.
    pub lineage: &'a LineageId,
    /// Epoch, from 0.
    pub epoch: u32,
    /// The active parent p_t.
    pub parent: &'a Program,
    /// Hash of its content.
    pub parent_hash: Digest,
    /// Text that stands before the context in every question.
    pub handbook: &'a Handbook,
    /// The fixed driver, in a sentence.
    pub ego: &'a str,
    /// Cards that causal retrieval chose for this parent.
    pub memory: &'a [Card],
    /// The groups of scenes that a patch may refer to.
    pub clusters: &'a [Cluster],
    /// How the parent did on the window; `None` as long as it has no label.
    pub parent_outcome: Option<&'a ParentOutcome>,
    /// The same scene by scene.
    pub window: &'a [SceneRow],
    /// Past edits of the lineage: of every front member and card, and the latest.
    pub history: &'a [PastEdit],
    /// The lineage's front.
    pub front: &'a [FrontPoint],
    /// Form of the question.
    pub questions: Questions,
    /// Sentence on what became of the attempts that the history leaves out; only in detailed questions.
    pub not_shown: &'a str,
}

/// The parent's labels, summarised over the scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParentOutcome {
    /// F(p) over the evolution scenes.
    pub objectives: Objectives,
    /// Scenes with a label.
    pub scenes: usize,
    /// Scenes without a label.
    pub failures: usize,
    /// Share of labelled scenes that it acts in, 0..1.
    pub coverage: f64,
    /// Mean of each realism diagnostic, 1 = satisfied.
    pub diagnostics: BTreeMap<String, f64>,
    /// Scenes in which an attack nearly came about; only in detailed questions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_misses: Option<usize>,
}

impl ParentOutcome {
    /// The diagnostic with the lowest mean; the first by name among equals.
    pub fn weakest_diagnostic(&self) -> Option<&str> {
        self.diagnostics.iter().min_by(|a, b| a.1.total_cmp(b.1)).map(|(name, _)| name.as_str())
    }
}

/// The search target of a slot (paper: η).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Target {
    /// Kind of the request.
    pub kind: TargetKind,
    /// The request in a sentence, as the prompt shows it and the attempt keeps it.
    pub text: String,
    /// First place for this slot to look, so that the slots of an epoch are different ideas.
    pub instruction: String,
}

/// Kind of a slot's request (paper: search target η).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TargetKind {
    /// More attack.
    RaiseAttack,
    /// More realism.
    RaiseRealism,
    /// A trade-off that the front does not have.
    Diversify,
}

/// One slot's question.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The epoch's context, written out once.
    pub briefing: &'a super::Briefing,
    /// Place among the proposals of the epoch, from 0.
    pub slot: u32,
    /// Request to the search.
    pub target: &'a Target,
    /// The model of each role; the experiment file names them one by one.
    pub models: &'a BTreeMap<Role, ModelSpec>,
    /// The critics who are asked; all four, unless the run does without some.
    pub critics: &'a [Role],
    /// K_r: how many times the patch may be repaired.
    pub max_repair_rounds: u32,
    /// When the gates judge a patch.
    pub gates: GatesAsked,
    /// Treatment of a proposal of which a critic gave no readable review.
    pub unreadable_critic: UnreadableCritic,
    /// Treatment of a proposal whose patch cannot be read.
    pub unreadable_patch: UnreadablePatch,
    /// True if a patch may leave constants free, which a numeric search then sets.
    pub tunes: bool,
}
