//! The inputs of a proposal: the context that all slots and roles of an epoch share, and the task of one slot.

use serde::Serialize;
use std::collections::BTreeMap;

use crate::{
    adapters::Contract,
    kernel::Digest,
    llm::ModelSpec,
    objects::{AttemptId, Card, LineageId, Objectives, Program, Role, SolutionId},
};

/// Everything of the frozen snapshot that prompts of one lineage and epoch show. Every slot and every role sees the same.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a> {
    /// Whose epoch it is.
    pub lineage: &'a LineageId,
    /// Epoch, from 0.
    pub epoch: u32,
    /// The active parent p_t.
    pub parent: &'a Program,
    /// Hash of its content.
    pub parent_hash: Digest,
    /// Interface I_b of its family.
    pub contract: &'a Contract,
    /// The contract as `contract_text` writes it.
    pub contract_text: &'a str,
    /// Private words of the run's other families: using one is an isolation failure.
    pub foreign_vocabulary: &'a [String],
    /// The fixed driver, in a sentence.
    pub ego: &'a str,
    /// Cards that causal retrieval chose for this parent.
    pub memory: &'a [Card],
    /// The groups of scenes that a patch may refer to.
    pub clusters: &'a [Cluster],
    /// How the parent and the latest attempts did.
    pub outcomes: &'a Outcomes,
    /// The lineage's front.
    pub front: &'a [FrontPoint],
}

/// A group of scenes of the evolution split that patches may refer to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cluster {
    /// The name by which `cluster_refs_used` cites it.
    #[serde(rename = "ref")]
    pub name: String,
    /// Number of scenes in the group.
    pub scenes: usize,
    /// What the scenes have in common, in words.
    pub describes: String,
    /// Share of these scenes in which the parent's attack succeeded, 0..1.
    pub attacked_share: Option<f64>,
    /// Mean of scene features in the group: feature name -> value, units as in the contract.
    pub features: BTreeMap<String, f64>,
}

/// The results of the parent and of the latest attempts of its lineage.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Outcomes {
    /// `None` as long as the parent has no label.
    pub parent: Option<ParentOutcome>,
    /// Newest last.
    pub recent: Vec<RecentAttempt>,
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
    /// Share of labelled scenes with attack above zero, 0..1.
    pub attacked_share: f64,
    /// Share of labelled scenes in which the program intervened, 0..1.
    pub intervened_share: f64,
    /// Mean of each realism diagnostic, 1 = satisfied.
    pub diagnostics: BTreeMap<String, f64>,
}

impl ParentOutcome {
    /// The diagnostic with the lowest mean; the first by name among equals.
    pub fn weakest_diagnostic(&self) -> Option<&str> {
        self.diagnostics.iter().min_by(|a, b| a.1.total_cmp(b.1)).map(|(name, _)| name.as_str())
    }
}

/// How an earlier attempt of the lineage ended.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecentAttempt {
    /// Which attempt.
    pub attempt: AttemptId,
    /// `declined`, `invalid`, `rejected` or `evaluated`.
    pub exit: String,
    /// Tags of its mechanisms.
    pub mechanism_tags: Vec<String>,
    /// Reason of the decline or problems of the gates, shortened.
    pub problems: Vec<String>,
    /// F(c), where it was evaluated.
    pub objectives: Option<Objectives>,
}

/// A member of the lineage's non-dominated set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrontPoint {
    /// Which program.
    pub solution: SolutionId,
    /// F(c).
    pub objectives: Objectives,
}

/// The search target of a slot (paper: η).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Target {
    /// What is asked for.
    pub kind: TargetKind,
    /// The request in a sentence, as the prompt shows it and the attempt keeps it.
    pub text: String,
}

/// What is asked for (paper: search target η).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TargetKind {
    /// More attack at high realism.
    RaiseAttack,
    /// More realism at the attack that there is.
    RaiseRealism,
    /// A trade-off that the front does not have.
    Diversify,
}

impl Target {
    /// More attack where realism stays at or above `realism_min`, 0..1.
    pub fn raise_attack(realism_min: f64) -> Target {
        let text = format!("Raise attack while realism stays at or above {realism_min:.3}.");
        Target { kind: TargetKind::RaiseAttack, text }
    }

    /// More realism at an attack of at least `attack_min`, 0..1.
    pub fn raise_realism(attack_min: f64) -> Target {
        let text = format!("Raise realism while attack stays at or above {attack_min:.3}.");
        Target { kind: TargetKind::RaiseRealism, text }
    }

    /// The request for another trade-off.
    pub fn diversify() -> Target {
        let text = "Reach a part of the front that no member covers, by a mechanism that the lineage has not tried.";
        Target { kind: TargetKind::Diversify, text: text.into() }
    }
}

/// One slot's question.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The epoch's context, written out once.
    pub briefing: &'a super::Briefing,
    /// Place among the proposals of the epoch, from 0.
    pub slot: u32,
    /// What the search is asked for.
    pub target: &'a Target,
    /// The model of each role; the experiment file names them one by one.
    pub models: &'a BTreeMap<Role, ModelSpec>,
    /// K_r: how many times the patch may be repaired.
    pub max_repair_rounds: u32,
}
