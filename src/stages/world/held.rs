//! Held evidence: for every labelled candidate, what a configuration predicts when it is fitted to labels of earlier epochs only. Audit
//! and judge use nothing else.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{
    calibration::snapshot,
    configuration::validate,
    measures::{Compared, centred_ranks, coverage_pct, gain, loss_ratio},
    router::{Router, RouterError},
    verdict::{Prediction, is_weak},
};
use crate::kernel::{Threads, num};
use crate::objects::{
    FeatureSchema, LineageId, Objectives, RoutingOptions, WorldConfiguration, WorldLabel, WorldMeasures,
};

/// `[world_agent]`: what the experiment declares of the evaluator's self-evolution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldAgentOptions {
    /// Most questions of a turn: the first, and one after each answer that is no patch of the surface.
    pub rounds: u32,
    /// Labelled candidates of earlier epochs from which on an epoch is held.
    pub fit_labels_min: u32,
    /// Held candidates below which nobody is asked and nothing is promoted.
    pub held_labels_min: u32,
    /// How much farther from the declared level coverage may come to lie, percentage points; also how much nearer it must come to
    /// be a gain.
    pub coverage_slack_pct: f64,
    /// Number of its standard errors that a gain must exceed.
    pub gain_errors: f64,
    /// Ends between which `audit_share` may be changed.
    pub audit_share: [f64; 2],
}

/// A labelled candidate with where it came from and for how many it stands.
#[derive(Clone, Copy, Debug)]
pub struct Evidence<'a> {
    /// Row and labels.
    pub label: &'a WorldLabel,
    /// Its lineage.
    pub lineage: &'a LineageId,
    /// The inverse of the probability with which it came to be simulated, >= 1.
    pub weight: f64,
}

/// Conditions that all configurations are held against.
#[derive(Clone, Copy, Debug)]
pub struct Judging<'a> {
    /// Columns of the rows.
    pub schema: &'a FeatureSchema,
    /// The configuration of the experiment file: its budget, audits and level hold for every configuration, so that a change of
    /// these earns nothing by itself.
    pub founding: &'a WorldConfiguration,
    /// Options that the experiment declares.
    pub options: &'a WorldAgentOptions,
    /// Labels of this epoch and of later ones are not looked at.
    pub before: u32,
}

/// A held candidate.
#[derive(Clone, Copy, Debug)]
pub struct Held<'a> {
    /// The candidate.
    pub evidence: Evidence<'a>,
    /// Prediction of it.
    pub prediction: Prediction,
    /// True if it would be turned away even where the budget has room.
    pub weak: bool,
}

/// Predicts every candidate of earlier epochs by a fit to the epochs before its own, for all epochs before which there are enough
/// labels. Which candidates are held does not depend on the configuration.
///
/// # Errors
/// A configuration that cannot be used; rows of another schema.
pub fn held<'a>(
    judging: &Judging<'_>,
    configuration: &WorldConfiguration,
    evidence: &[Evidence<'a>],
    threads: &Threads,
) -> Result<Vec<Held<'a>>, RouterError> {
    validate(configuration, judging.schema)?;
    let epochs: Vec<u32> = (0..judging.before).collect();
    let held = threads.map(&epochs, |_, &epoch| held_of(judging, configuration, evidence, epoch, threads));
    Ok(held.into_iter().collect::<Result<Vec<_>, RouterError>>()?.into_iter().flatten().collect())
}

/// The candidates of one epoch; nobody where too little was known before it.
fn held_of<'a>(
    judging: &Judging<'_>,
    configuration: &WorldConfiguration,
    evidence: &[Evidence<'a>],
    epoch: u32,
    threads: &Threads,
) -> Result<Vec<Held<'a>>, RouterError> {
    let earlier: Vec<&WorldLabel> = evidence.iter().map(|e| e.label).filter(|label| label.epoch < epoch).collect();
    let mut own = evidence.iter().filter(|evidence| evidence.label.epoch == epoch).peekable();
    if earlier.len() < judging.options.fit_labels_min as usize || own.peek().is_none() {
        return Ok(Vec::new());
    }
    let fitted = snapshot(judging.schema, configuration, &earlier, threads);
    let router = Router::new(&fitted)?;
    let held = |evidence: &Evidence<'a>| {
        let prediction = router.predict(&evidence.label.row)?;
        Ok(Held { evidence: *evidence, prediction, weak: is_weak(&prediction, &configuration.routing) })
    };
    own.map(held).collect()
}

impl Held<'_> {
    /// The candidate's epoch of its lineage: what it was ranked within.
    pub fn group(&self) -> (&LineageId, u32) {
        (self.evidence.lineage, self.evidence.label.epoch)
    }

    fn compared(&self) -> Compared {
        let (label, weight) = (self.evidence.label.difference(), self.evidence.weight);
        Compared { predicted: self.prediction.difference, half_width: self.prediction.half_width, label, weight }
    }
}

/// The measures of held candidates. `declared` says how much of an epoch goes by rank.
pub fn measures(of: &[&Held<'_>], declared: &RoutingOptions) -> WorldMeasures {
    let compared: Vec<Compared> = of.iter().map(|held| held.compared()).collect();
    let error = |read: fn(&Objectives) -> f64| loss_ratio(&compared, &|error| read(error) * read(error)).map(f64::sqrt);
    let groups = grouped(of);
    WorldMeasures {
        held: of.len(),
        rank_correlation: rank_correlation(&groups),
        attack_error: error(|error| error.attack),
        realism_error: error(|error| error.realism),
        coverage_pct: coverage_pct(&compared),
        false_reject_pct: false_reject_pct(&groups, declared),
    }
}

fn grouped<'h, 'a>(of: &[&'h Held<'a>]) -> Vec<Vec<&'h Held<'a>>> {
    let mut groups: BTreeMap<(&LineageId, u32), Vec<&'h Held<'a>>> = BTreeMap::new();
    of.iter().for_each(|held| groups.entry(held.group()).or_default().push(held));
    groups.into_values().collect()
}

/// Only an order within an epoch decides who is simulated, so ranks are taken there; a prediction that tells lineages apart and no
/// candidates of one has none.
fn rank_correlation(groups: &[Vec<&Held<'_>>]) -> Option<f64> {
    let (mut both, mut own, mut other) = (0.0, 0.0, 0.0);
    for group in groups {
        let list = |read: &dyn Fn(&Held<'_>) -> f64| group.iter().map(|held| read(held)).collect::<Vec<f64>>();
        let weights = list(&|held| held.evidence.weight);
        let ranks = centred_ranks(&list(&|held| held.prediction.rank_score), &weights);
        let gains = centred_ranks(&list(&|held| gain(&held.evidence.label.difference())), &weights);
        for ((weight, x), y) in weights.iter().zip(&ranks).zip(&gains) {
            (both, own, other) = (both + weight * x * y, own + weight * x * x, other + weight * y * y);
        }
    }
    (own > 0.0 && other > 0.0).then(|| both / (own * other).sqrt())
}

/// Of all admitted candidates, those that the archive accepts and that the rank leaves out. A drawn one stands for its weight, so
/// it may be in the budget with a part of it. Turning more away never lowers this.
fn false_reject_pct(groups: &[Vec<&Held<'_>>], declared: &RoutingOptions) -> Option<f64> {
    let (mut missed, mut admitted) = (0.0, 0.0);
    for group in groups {
        let mut order: Vec<&&Held<'_>> = group.iter().collect();
        order.sort_by(|a, b| b.prediction.rank_score.total_cmp(&a.prediction.rank_score));
        let mut places = f64::from(declared.rollout_budget) * (1.0 - declared.audit_share);
        for held in order {
            let weight = held.evidence.weight;
            let kept = if held.weak { 0.0 } else { places.min(weight) };
            places -= kept;
            missed += if held.evidence.label.accepted { weight - kept } else { 0.0 };
        }
        admitted += num::sum(group.iter().map(|held| held.evidence.weight));
    }
    (admitted > 0.0).then(|| 100.0 * missed / admitted)
}
