//! An admitted candidate with what was predicted of it and what it turned out to be.

use std::collections::BTreeMap;

use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::Digest;
use crate::objects::event::Frozen;
use crate::objects::{Attempt, AttemptId, FamilyName, LineageId, Objectives, RouteDecision};
use crate::world::drawn_by_monitor;

/// Share of an epoch's candidates that counts as the first by rank.
const FIRST_SHARE: f64 = 0.3;

/// One admitted candidate.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    pub attempt: AttemptId,
    /// Hash of the child's content.
    pub program: Digest,
    pub lineage: LineageId,
    pub family: FamilyName,
    pub epoch: u32,
    pub decision: RouteDecision,
    /// Predicted difference from its parent.
    pub predicted: Objectives,
    pub half_width: Option<Objectives>,
    /// Uncertainty, as the route has it.
    pub uncertainty: f64,
    /// Its parent's labels on the window, and its own; `None` where it was not simulated.
    pub parent: Objectives,
    pub labelled: Option<Objectives>,
    pub rank_score: f64,
    /// Difference of its labels from its parent's, and whether the archive accepted it; `None` where it was not simulated.
    pub label: Option<(Objectives, bool)>,
    /// True if the evaluator would turn it away: it was drawn among those left out by the rank, or, where an epoch was
    /// simulated whole, it is not among the first three in ten.
    pub turned_away: bool,
    /// Number of candidates that it stands for among those that would be turned away.
    pub weight: f64,
}

/// The admitted candidates of a run.
pub fn cases(run: &RecordedRun) -> Vec<Case> {
    let frozen: BTreeMap<(&LineageId, u32), &Frozen> =
        run.frozen.iter().map(|frozen| ((&frozen.lineage, frozen.epoch), frozen)).collect();
    let mut groups: BTreeMap<(&LineageId, u32), Vec<Case>> = BTreeMap::new();
    for attempt in &run.attempts {
        let key = (&attempt.lineage, attempt.epoch);
        if let Some(case) = frozen.get(&key).and_then(|frozen| case(attempt, frozen)) {
            groups.entry(key).or_default().push(case);
        }
    }
    groups.into_values().flat_map(split).collect()
}

fn case(attempt: &Attempt, frozen: &Frozen) -> Option<Case> {
    let (candidate, route) = (attempt.exit.candidate()?, attempt.exit.route()?);
    let second = frozen.second_parent(attempt.slot);
    let parent = second.map_or(&frozen.parent_score, |second| &second.parent_score).objectives;
    let predicted = route.predicted.less(&parent);
    let accepted = attempt.exit.decision().is_some_and(|decision| decision.gates.any());
    Some(Case {
        attempt: attempt.id.clone(),
        program: candidate.program_hash,
        lineage: attempt.lineage.clone(),
        family: candidate.program.source_family.clone(),
        epoch: attempt.epoch,
        decision: route.decision,
        predicted,
        half_width: route.half_width,
        uncertainty: route.uncertainty,
        parent,
        labelled: attempt.exit.score().map(|score| score.objectives),
        rank_score: route.rank_score.unwrap_or(predicted.attack + predicted.realism),
        label: attempt.exit.score().map(|score| (score.objectives.less(&parent), accepted)),
        turned_away: drawn_by_monitor(route),
        weight: route.weight.unwrap_or(1.0),
    })
}

/// Says who would be turned away in an epoch that was simulated whole.
fn split(mut cases: Vec<Case>) -> Vec<Case> {
    if cases.iter().all(|case| case.label.is_some()) {
        let kept = first_by_rank(&cases.iter().map(|case| case.rank_score).collect::<Vec<f64>>());
        for (case, kept) in cases.iter_mut().zip(kept) {
            (case.turned_away, case.weight) = (!kept, 1.0);
        }
    }
    cases
}

/// Marks the first three in ten of an epoch's candidates; of equals the earlier one comes first.
pub fn first_by_rank(scores: &[f64]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..scores.len()).collect();
    order.sort_by(|&a, &b| scores[b].total_cmp(&scores[a]).then(a.cmp(&b)));
    let kept = (FIRST_SHARE * scores.len() as f64).ceil() as usize;
    (0..scores.len()).map(|place| order[..kept].contains(&place)).collect()
}
