//! The measures of a run, whole, by epoch and by family.

use serde::Serialize;
use std::collections::BTreeMap;

use super::{
    case::{self, Case},
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
    EvaluatorReport { pooled: of(&|_| true), epochs, families, against: full.and_then(|full| against(run, full)) }
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
    (whole > 0.0).then(|| Against { hypervolume_share, rollout_share: total(run) / whole, lineages: shared.len() })
}
