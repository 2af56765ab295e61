//! The measures of a run, whole, by epoch and by family.

use serde::Serialize;
use std::collections::BTreeMap;

use super::{
    case::{self, Case},
    evolution::Evolution,
    quality::{Quality, quality},
};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::LineageId;

/// The measures of a run.
#[derive(Clone, Debug, Serialize)]
pub struct EvaluatorReport {
    /// Over all epochs.
    pub pooled: Quality,
    /// Epoch by epoch.
    pub epochs: BTreeMap<u32, Quality>,
    /// Family by family.
    pub families: BTreeMap<String, Quality>,
    /// Beside another run of the same lineages.
    #[serde(flatten)]
    pub against: Option<Against>,
    /// How the evaluator changed itself; absent without a world agent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evolution: Option<Evolution>,
}

/// A budgeted search beside a full one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Against {
    /// Hypervolume of the fronts after the last epoch, summed over lineages, as a share of the other run's sum. A mean of the
    /// lineages' shares would be decided by those whose fronts are nearly nothing.
    pub hypervolume_share: f64,
    /// Simulated candidates as a share of the other run's.
    pub rollout_share: f64,
    /// Lineages that both runs finished.
    pub lineages: usize,
    /// Mean over lineages of the hypervolume less the other run's of the same lineage, and its standard error.
    pub hypervolume_difference: f64,
    /// `None` for a single lineage.
    pub hypervolume_difference_error: Option<f64>,
    /// Lineages with more hypervolume than in the other run, and with less.
    pub lineages_better: usize,
    pub lineages_worse: usize,
}

/// Measures a run, beside the full search where one is given.
pub fn report(run: &RecordedRun, full: Option<&RecordedRun>) -> EvaluatorReport {
    let cases = case::cases(run);
    let of =
        |wanted: &dyn Fn(&Case) -> bool| quality(&cases.iter().filter(|case| wanted(case)).collect::<Vec<&Case>>());
    let mut epochs: BTreeMap<u32, Quality> = BTreeMap::new();
    let mut families: BTreeMap<String, Quality> = BTreeMap::new();
    for case in &cases {
        epochs.entry(case.epoch).or_insert_with(|| of(&|other| other.epoch == case.epoch));
        families.entry(case.family.to_string()).or_insert_with(|| of(&|other| other.family == case.family));
    }
    let against = full.and_then(|full| against(run, full));
    EvaluatorReport { pooled: of(&|_| true), epochs, families, against, evolution: Evolution::of(run) }
}

fn against(run: &RecordedRun, full: &RecordedRun) -> Option<Against> {
    let last = |run: &RecordedRun| -> BTreeMap<LineageId, f64> {
        run.settled.iter().map(|settled| (settled.lineage.clone(), settled.hypervolume)).collect()
    };
    let simulated = |run: &RecordedRun, lineage: &LineageId| {
        run.attempts.iter().filter(|a| a.lineage == *lineage && a.exit.score().is_some()).count() as f64
    };
    let (own, other) = (last(run), last(full));
    let shared: Vec<&LineageId> =
        own.keys().filter(|lineage| other.get(*lineage).is_some_and(|hv| *hv > 0.0)).collect();
    let sum = |of: &BTreeMap<LineageId, f64>| num::sum(shared.iter().map(|lineage| of[*lineage]));
    let hypervolume_share = sum(&own) / sum(&other);
    let total = |run: &RecordedRun| num::sum(shared.iter().map(|lineage| simulated(run, lineage)));
    let whole = total(full);
    let differences: Vec<f64> = shared.iter().map(|lineage| own[*lineage] - other[*lineage]).collect();
    (whole > 0.0).then(|| Against {
        hypervolume_share,
        rollout_share: total(run) / whole,
        lineages: shared.len(),
        hypervolume_difference: num::mean(&differences).unwrap_or(0.0),
        hypervolume_difference_error: standard_error(&differences),
        lineages_better: differences.iter().filter(|difference| **difference > 0.0).count(),
        lineages_worse: differences.iter().filter(|difference| **difference < 0.0).count(),
    })
}

/// Of the mean of a sample.
fn standard_error(values: &[f64]) -> Option<f64> {
    let (n, mean) = (values.len() as f64, num::mean(values)?);
    let spread = num::sum(values.iter().map(|value| (value - mean) * (value - mean)));
    (values.len() > 1).then(|| (spread / (n * (n - 1.0))).sqrt())
}
