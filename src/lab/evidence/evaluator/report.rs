//! The measures of a run, whole, by epoch and by family.

use serde::Serialize;
use std::collections::BTreeMap;

use super::{
    case::{self, Case},
    evolution::Evolution,
    quality::{Quality, quality},
};
use crate::archive::{hypervolume, point};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::{Attempt, LineageId, event::Finalist};

/// The measures of a run.
#[derive(Clone, Debug, Serialize)]
pub struct EvaluatorReport {
    /// Over all epochs.
    pub pooled: Quality,
    /// Epoch by epoch.
    pub epochs: BTreeMap<u32, Quality>,
    /// Family by family.
    pub families: BTreeMap<String, Quality>,
    /// Comparison with another run of the same lineages.
    #[serde(flatten)]
    pub against: Option<Against>,
    /// The evaluator's changes to itself; absent without a world agent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evolution: Option<Evolution>,
}

/// A budgeted search beside a full one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Against {
    /// Hypervolume of the fronts after the last epoch, summed over lineages, as a share of the other run's sum. A mean of the
    /// lineages' shares would be decided by those whose fronts are nearly nothing.
    pub hypervolume_share: f64,
    /// Rollouts that candidates got as a share of the other run's: one a candidate and scene of its window or pilot. Those on
    /// earlier windows, which only who gains on its own window gets, are not counted.
    pub rollout_share: f64,
    /// Candidates that were simulated on the whole window, as a share of the other run's.
    pub candidate_share: f64,
    /// Lineages that both runs finished.
    pub lineages: usize,
    /// Mean over lineages of the hypervolume less the other run's of the same lineage, and its standard error.
    pub hypervolume_difference: f64,
    /// `None` for a single lineage.
    pub hypervolume_difference_error: Option<f64>,
    /// Lineages with more hypervolume than in the other run, and with less.
    pub lineages_better: usize,
    pub lineages_worse: usize,
    /// Hypervolume of the parents alone as a share of the other run's: the result of doing nothing. `None` where the windows did not open
    /// the whole evolution pool, on which parents are measured.
    pub parents_share: Option<f64>,
}

impl Against {
    /// Returns the gain over the parents as a share of the other run's gain; `None` where that gain is nothing or unknown.
    pub fn gain_share(&self) -> Option<f64> {
        let parents = self.parents_share.filter(|parents| *parents < 1.0)?;
        Some((self.hypervolume_share - parents) / (1.0 - parents))
    }
}

/// Measures a run, beside the full search where one is given, with the point from which hypervolumes are measured.
pub fn report(run: &RecordedRun, full: Option<(&RecordedRun, [f64; 2])>) -> EvaluatorReport {
    let cases = case::cases(run);
    let of =
        |wanted: &dyn Fn(&Case) -> bool| quality(&cases.iter().filter(|case| wanted(case)).collect::<Vec<&Case>>());
    let mut epochs: BTreeMap<u32, Quality> = BTreeMap::new();
    let mut families: BTreeMap<String, Quality> = BTreeMap::new();
    for case in &cases {
        epochs.entry(case.epoch).or_insert_with(|| of(&|other| other.epoch == case.epoch));
        families.entry(case.family.to_string()).or_insert_with(|| of(&|other| other.family == case.family));
    }
    let against = full.and_then(|(full, reference)| against(run, full, reference));
    EvaluatorReport { pooled: of(&|_| true), epochs, families, against, evolution: Evolution::of(run) }
}

fn against(run: &RecordedRun, full: &RecordedRun, reference: [f64; 2]) -> Option<Against> {
    let last = |run: &RecordedRun| -> BTreeMap<LineageId, f64> {
        run.settled.iter().map(|settled| (settled.lineage.clone(), settled.hypervolume)).collect()
    };
    let (own, other) = (last(run), last(full));
    let shared: Vec<&LineageId> = own.keys().filter(|lineage| other.contains_key(*lineage)).collect();
    let sum = |of: &BTreeMap<LineageId, f64>| num::sum(shared.iter().map(|lineage| of[*lineage]));
    let area = sum(&other);
    let parents = parents(run, reference).filter(|parents| shared.iter().all(|lineage| parents.contains_key(*lineage)));
    let of = |run: &RecordedRun, count: fn(&Attempt) -> usize| -> f64 {
        run.attempts.iter().filter(|attempt| shared.contains(&&attempt.lineage)).map(count).sum::<usize>() as f64
    };
    let (whole, candidates) = (of(full, rollouts), of(full, simulated));
    let differences: Vec<f64> = shared.iter().map(|lineage| own[*lineage] - other[*lineage]).collect();
    (area > 0.0 && whole > 0.0 && candidates > 0.0).then(|| Against {
        hypervolume_share: sum(&own) / area,
        rollout_share: of(run, rollouts) / whole,
        candidate_share: of(run, simulated) / candidates,
        lineages: shared.len(),
        hypervolume_difference: num::mean(&differences).unwrap_or(0.0),
        hypervolume_difference_error: standard_error(&differences),
        lineages_better: differences.iter().filter(|difference| **difference > 0.0).count(),
        lineages_worse: differences.iter().filter(|difference| **difference < 0.0).count(),
        parents_share: parents.map(|parents| sum(&parents) / area),
    })
}

/// Hypervolume of each lineage's parent alone on the whole evolution pool; `None` where the last fronts were measured on less.
fn parents(run: &RecordedRun, reference: [f64; 2]) -> Option<BTreeMap<LineageId, f64>> {
    let pool = run.opened.evolution_scenes.len();
    if run.frozen.last()?.scenes_so_far < pool {
        return None;
    }
    let of = |finalist: &&Finalist| {
        run.parents
            .iter()
            .any(|parent| parent.lineage == finalist.lineage && parent.program.solution_id == finalist.solution)
    };
    let alone =
        |finalist: &Finalist| (finalist.lineage.clone(), hypervolume(&[point(&finalist.score.objectives)], reference));
    Some(run.finalists.iter().filter(of).map(alone).collect())
}

/// Scenes in which a candidate was rolled out: those of its window, or of its pilot where it went no farther.
fn rollouts(attempt: &Attempt) -> usize {
    let pilot = attempt.exit.route().and_then(|route| route.pilot.as_ref());
    attempt.exit.score().map_or(pilot.map_or(0, |pilot| pilot.scenes.len()), |score| score.scenes.len())
}

fn simulated(attempt: &Attempt) -> usize {
    usize::from(attempt.exit.score().is_some())
}

/// Returns the standard error of the mean of a sample.
fn standard_error(values: &[f64]) -> Option<f64> {
    let (n, mean) = (values.len() as f64, num::mean(values)?);
    let spread = num::sum(values.iter().map(|value| (value - mean) * (value - mean)));
    (values.len() > 1).then(|| (spread / (n * (n - 1.0))).sqrt())
}
