//! How good a world evaluator is on labels that it did not know, what a judge made of a change of it, and the record of both
//! (paper, algorithm world_agent_update).

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{attempt::Exchange, ids::FamilyName, world::WorldConfiguration, world_patch::WorldPatch};
use crate::kernel::Digest;

/// The first part of the names of an evaluator's turns, `world/e<epoch>`, and of its draw slots.
pub const WORLD_LINE: &str = "world";

/// Measures of an evaluator over held candidates: each was predicted by a fit to labels of epochs before its own. A candidate that
/// was drawn counts for as many as it stands for. `None` where there is nothing to measure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WorldMeasures {
    /// Held candidates.
    pub held: usize,
    /// Correlation of the ranks by predicted and by labelled gain (attack and realism added) within epochs of lineages, -1..=1.
    pub rank_correlation: Option<f64>,
    /// Root mean squared error of the predicted difference of attack, as a share of what it is for the guess that a child is like
    /// its parent.
    pub attack_error: Option<f64>,
    /// The same of realism.
    pub realism_error: Option<f64>,
    /// Labels in their intervals, %; attack and realism count one each.
    pub coverage_pct: Option<f64>,
    /// Candidates that the archive accepts and the rank turns away, of all admitted ones, %.
    pub false_reject_pct: Option<f64>,
}

/// What one group of columns leaves unexplained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupAudit {
    /// Name of the group.
    pub group: String,
    /// Its columns, and how many of them the regression leaves out.
    pub columns: usize,
    /// How many of them the regression leaves out.
    pub excluded: usize,
    /// The column whose ranks correlate most with what the predicted gain misses, and that correlation.
    pub residual: Option<(String, f64)>,
}

/// Who was simulated under the decisions of earlier epochs, and what the archive accepted of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoutedShare {
    /// Candidates.
    pub candidates: usize,
    /// Accepted ones among them, %.
    pub accepted_pct: Option<f64>,
}

/// a_W: what a world agent is told of the active evaluator. It follows from labels of epochs before `before_epoch` alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorldAudit {
    /// The epoch for which a change would take effect.
    pub before_epoch: u32,
    /// Labelled candidates of earlier epochs.
    pub labels: usize,
    /// Epochs whose candidates were held, each against the epochs before it.
    pub held_epochs: Vec<u32>,
    /// Share of labels that intervals are to hold, as the experiment declares it, %.
    pub level_pct: f64,
    /// Over all held candidates.
    pub measures: WorldMeasures,
    /// Family by family.
    pub families: BTreeMap<FamilyName, WorldMeasures>,
    /// Group of columns by group of columns.
    pub groups: Vec<GroupAudit>,
    /// Simulated for their rank.
    pub selected: RoutedShare,
    /// Drawn.
    pub audited: RoutedShare,
}

/// A rule of the judge, in the order in which they are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JudgeRule {
    /// Enough held candidates.
    Evidence,
    /// The rank correlation is no lower.
    Ranking,
    /// The error of realism is no larger.
    RealismError,
    /// Coverage is no farther from the declared level, beyond the declared slack.
    Coverage,
    /// False rejects are no more.
    FalseRejects,
    /// One of the four gains, by more than its standard error.
    Gain,
}

/// A rule that speaks against a challenger.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Objection {
    /// Which rule.
    pub rule: JudgeRule,
    /// With its numbers.
    pub says: String,
}

/// What a challenger gains in one measure, larger is better, beside the standard error of that (epochs of lineages left out one
/// by one).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasureGain {
    /// The measure's rule.
    pub rule: JudgeRule,
    /// In the measure's unit.
    pub gain: f64,
    /// Of the same unit; `None` with fewer than three epochs of lineages.
    pub error: Option<f64>,
}

/// j: a challenger against the incumbent on the same held candidates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Judgement {
    /// Of the active configuration.
    pub incumbent: WorldMeasures,
    /// Of the proposed one.
    pub challenger: WorldMeasures,
    /// What the challenger gains or loses.
    pub gains: Vec<MeasureGain>,
    /// Why it is not promoted; empty where it is.
    pub objections: Vec<Objection>,
}

impl Judgement {
    /// Whether the challenger becomes the active configuration.
    pub fn is_accepted(&self) -> bool {
        self.objections.is_empty()
    }
}

/// The evaluator's turn after an epoch: audit, questions, patch, judgement, and what is active from the next epoch on. The turns
/// of a run are the lineage of its snapshots; rejected ones stay in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorldEvolved {
    /// The epoch that was settled before; what is promoted takes effect in the next.
    pub epoch: u32,
    /// What the agent was told.
    pub audit: WorldAudit,
    /// Every question, in order; a patch outside the surface is a refusal here.
    pub exchanges: Vec<Exchange>,
    /// Digest of the configuration that was active, the parent of the challenger.
    pub incumbent: Digest,
    /// The patch that was judged; `None`: no answer was a patch of the surface.
    pub patch: Option<WorldPatch>,
    /// Digest of the configuration that it proposes.
    pub challenger: Option<Digest>,
    /// What the judge made of it.
    pub judgement: Option<Judgement>,
    /// The configuration from the next epoch on.
    pub active: WorldConfiguration,
    /// Its digest.
    pub active_digest: Digest,
    /// Digest of the snapshot W_φ of the next epoch: this configuration with its fit.
    pub snapshot: Digest,
}

impl WorldEvolved {
    /// `world/e<epoch>`: its name in commands.
    pub fn name(&self) -> String {
        format!("{WORLD_LINE}/e{}", self.epoch)
    }

    /// `promoted`, `rejected`, or `refused` where there was nothing to judge.
    pub fn verdict(&self) -> &'static str {
        match &self.judgement {
            None => "refused",
            Some(judgement) if judgement.is_accepted() => "promoted",
            Some(_) => "rejected",
        }
    }

    /// Questions whose answer was no patch of the surface.
    pub fn refusals(&self) -> impl Iterator<Item = &str> {
        self.exchanges.iter().filter_map(|exchange| exchange.refusal.as_deref())
    }
}
