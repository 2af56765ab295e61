//! Quality of a world evaluator on labels that it did not know, the judge's verdict on a change of it, and the record of both
//! (paper, algorithm world_agent_update).

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{attempt::Exchange, ids::FamilyName, world::WorldConfiguration, world_patch::WorldPatch};
use crate::kernel::Digest;

/// The first part of the names of an evaluator's turns, `world/e<epoch>`, and of its draw slots.
pub const WORLD_LINE: &str = "world";

/// Measures of an evaluator over held candidates: each was predicted by a fit to labels of epochs before its own. A candidate that
/// was drawn counts for all those that it stands for. `None` where there is nothing to measure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WorldMeasures {
    /// Held candidates.
    pub held: usize,
    /// Correlation of the ranks by predicted and by labelled gain (attack and realism added) within epochs of lineages, -1..=1.
    pub rank_correlation: Option<f64>,
    /// Root mean squared error of the predicted difference of attack, divided by the error of the guess that a child is like
    /// its parent.
    pub attack_error: Option<f64>,
    /// The same error for realism.
    pub realism_error: Option<f64>,
    /// Labels in their intervals, %; attack and realism count one each.
    pub coverage_pct: Option<f64>,
    /// Candidates that the archive accepts and the rank turns away, of all admitted ones, %.
    pub false_reject_pct: Option<f64>,
}

/// Error that one group of columns leaves unexplained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupAudit {
    /// Name of the group.
    pub group: String,
    /// Number of its columns.
    pub columns: usize,
    /// Number of them that the regression leaves out.
    pub excluded: usize,
    /// The column whose ranks correlate most with the error of the predicted gain, and that correlation.
    pub residual: Option<(String, f64)>,
}

/// Candidates simulated under the decisions of earlier epochs, and the share of them that the archive accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RoutedShare {
    /// Candidates.
    pub candidates: usize,
    /// Accepted ones among them, %.
    pub accepted_pct: Option<f64>,
}

/// a_W: the report to a world agent on the active evaluator. It follows from labels of epochs before `before_epoch` alone.
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
    /// Measures over all held candidates.
    pub measures: WorldMeasures,
    /// Measures of each family.
    pub families: BTreeMap<FamilyName, WorldMeasures>,
    /// Audit of each group of columns.
    pub groups: Vec<GroupAudit>,
    /// Candidates simulated for their rank.
    pub selected: RoutedShare,
    /// Candidates that were drawn.
    pub audited: RoutedShare,
}

/// A rule of the judge. The variants stand in the order in which they are checked.
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
    /// One of the four measures gains, by more than its standard error.
    Gain,
}

/// A rule that speaks against a challenger.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Objection {
    /// Which rule.
    pub rule: JudgeRule,
    /// The objection in words, with its numbers.
    pub says: String,
}

/// Gain of a challenger in one measure, larger is better, with its standard error (epochs of lineages left out one
/// by one).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasureGain {
    /// The measure's rule.
    pub rule: JudgeRule,
    /// Gain, in the measure's unit.
    pub gain: f64,
    /// Standard error, in the same unit; `None` with fewer than three epochs of lineages.
    pub error: Option<f64>,
}

/// j: a challenger against the incumbent on the same held candidates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Judgement {
    /// Measures of the active configuration.
    pub incumbent: WorldMeasures,
    /// Measures of the proposed one.
    pub challenger: WorldMeasures,
    /// Gains or losses of the challenger.
    pub gains: Vec<MeasureGain>,
    /// Why it is not promoted; empty where it is.
    pub objections: Vec<Objection>,
}

impl Judgement {
    /// Returns `true` if the challenger becomes the active configuration.
    pub fn is_accepted(&self) -> bool {
        self.objections.is_empty()
    }
}

/// The evaluator's turn after an epoch: audit, questions, patch, judgement, and the configuration from the next epoch on. The turns
/// of a run are the lineage of its snapshots; rejected ones stay in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorldEvolved {
    /// The epoch that was settled before; a promoted configuration takes effect in the next.
    pub epoch: u32,
    /// Audit that the agent was given.
    pub audit: WorldAudit,
    /// Every question, in order; a patch outside the surface is a refusal here.
    pub exchanges: Vec<Exchange>,
    /// Digest of the configuration that was active, the parent of the challenger.
    pub incumbent: Digest,
    /// The patch that was judged; `None`: no answer was a patch of the surface.
    pub patch: Option<WorldPatch>,
    /// Digest of the configuration that it proposes.
    pub challenger: Option<Digest>,
    /// The judge's verdict on it.
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

    /// Returns `promoted`, `rejected`, or `refused` where there was nothing to judge.
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
