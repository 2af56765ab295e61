//! Counts over lineages that no table shows, with the interval that the tables use: drawn over the repetitions of each search and over
//! what is counted within one.

use std::collections::BTreeMap;

use crate::evidence::evaluator::order::epochs;
use crate::evidence::recorded_run::RecordedRun;
use crate::evidence::tables::{Estimate, INTERVENED, PerScene, REPAIRED, REVIEWED, STOPPED, Search, estimates};
use crate::kernel::Digest;
use crate::objects::{Attempt, LineageId, Surface, edit_categories};

/// Among the first of how many candidates of an epoch useful ones are counted.
const FIRST_K: usize = 6;

/// Values of each lineage.
type Counted = BTreeMap<LineageId, Vec<f64>>;

/// A measure: its name and what it counts, each with its lineage.
type Measure = (&'static str, fn(&RecordedRun) -> Counted);

const MEASURES: [Measure; 9] = [
    ("edits_structural_pct", |run| over(run, |of| of.exit.score().and(structural(of)))),
    ("edits_parameters_only_pct", |run| over(run, |of| of.exit.score().and(structural(of).map(|share| 100.0 - share)))),
    ("chain_structural_pct", chains),
    ("critics_intervened_pct", |run| over(run, |of| REVIEWED(of).then(|| pct(INTERVENED(of))))),
    ("critics_repaired_pct", |run| over(run, |of| REVIEWED(of).then(|| pct(REPAIRED(of))))),
    ("critics_stopped_pct", |run| over(run, |of| REVIEWED(of).then(|| pct(STOPPED(of))))),
    ("order_evaluations_saved", |run| order(run, &|epoch| epoch.evaluations_to(1).map(|[rank, random]| random - rank))),
    ("order_yield_gain", |run| order(run, &|epoch| epoch.yield_at(FIRST_K).map(|[rank, random]| rank - random))),
    ("order_rank_correlation", |run| order(run, &|epoch| epoch.spearman)),
];

/// Returns `true` if there is a measure of that name.
pub fn known(name: &str) -> bool {
    MEASURES.iter().any(|(known, _)| *known == name)
}

/// All names, for errors.
pub fn names() -> String {
    MEASURES.map(|(name, _)| name).join(", ")
}

/// A measure of these runs over lineages of these families (all where none is named); `None` where nothing is counted.
pub fn measured(name: &str, runs: &[&RecordedRun], families: &[String]) -> Option<Estimate> {
    let (_, count) = MEASURES.iter().find(|(known, _)| *known == name)?;
    let mut searches: BTreeMap<String, Vec<PerScene>> = BTreeMap::new();
    for run in runs {
        let mut counted = count(run);
        let wanted = |lineage: &LineageId| {
            let parent = run.parents.iter().find(|parent| parent.lineage == *lineage);
            let family = parent.map(|parent| parent.program.source_family.to_string());
            families.is_empty() || family.is_some_and(|family| families.contains(&family))
        };
        counted.retain(|lineage, values| wanted(lineage) && !values.is_empty());
        for (lineage, values) in counted {
            let suite = Digest::of_bytes(lineage.as_str().as_bytes());
            let values = values.into_iter().map(Some).collect();
            searches.entry(group(run, &lineage)).or_default().push(PerScene { suite, values });
        }
    }
    let search = |(id, seeds): (String, Vec<PerScene>)| Search { id: Digest::of_bytes(id.as_bytes()), seeds };
    let quantity: Vec<Search> = searches.into_iter().map(search).collect();
    if quantity.is_empty() {
        return None;
    }
    estimates(&[quantity]).pop().flatten()
}

/// The search that a lineage repeats.
fn group(run: &RecordedRun, lineage: &LineageId) -> String {
    let results = run.result.iter().flat_map(|result| &result.lineages);
    let own = results.into_iter().find(|result| result.lineage == *lineage);
    own.map_or(lineage, |result| &result.group).to_string()
}

fn pct(holds: bool) -> f64 {
    if holds { 100.0 } else { 0.0 }
}

fn over(run: &RecordedRun, value: impl Fn(&Attempt) -> Option<f64>) -> Counted {
    let mut counted = Counted::new();
    for attempt in &run.attempts {
        if let Some(value) = value(attempt) {
            counted.entry(attempt.lineage.clone()).or_default().push(value);
        }
    }
    counted
}

/// 100 where a patch edits more than parameters, else 0; `None` without a patch.
fn structural(attempt: &Attempt) -> Option<f64> {
    let touched = edit_categories(attempt.proposal.patch()?);
    Some(pct(touched.iter().any(|surface| *surface != Surface::Parameters)))
}

/// The patches on the way to each lineage's reported generator.
fn chains(run: &RecordedRun) -> Counted {
    let mut counted = Counted::new();
    for result in run.result.iter().flat_map(|result| &result.lineages) {
        for program in run.chain(&result.evolved.solution) {
            let made = run.attempts.iter().find(|attempt| {
                attempt.exit.candidate().is_some_and(|candidate| candidate.program.solution_id == program.solution_id)
            });
            if let Some(value) = made.and_then(structural) {
                counted.entry(result.lineage.clone()).or_default().push(value);
            }
        }
    }
    counted
}

fn order(run: &RecordedRun, value: &dyn Fn(&crate::evidence::evaluator::order::Epoch) -> Option<f64>) -> Counted {
    let mut counted = Counted::new();
    for epoch in epochs(&[run]) {
        if let Some(value) = value(&epoch) {
            counted.entry(epoch.lineage.1.clone()).or_default().push(value);
        }
    }
    counted
}
