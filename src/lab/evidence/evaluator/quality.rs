//! The measures of a set of candidates. `None` where there is nothing to measure.

use serde::Serialize;
use std::collections::BTreeMap;

use super::case::{Case, first_by_rank};
use crate::evidence::tables::interval;
use crate::kernel::{Seed, num};
use crate::objects::{LineageId, Objectives, RouteDecision};
use crate::world::measures::{Compared, coverage_pct, gain, kendall, loss_ratio, share_pct, spearman};

/// Resamples of an interval, and the root of their stream. No result of a run depends on them.
const RESAMPLES: usize = 1000;
const SEED: Seed = Seed(95);

/// Quality of the evaluator over a set of candidates.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Quality {
    /// Candidates that passed the gates, and how they left: by rank, drawn, turned away.
    pub admitted: usize,
    pub selected: usize,
    pub audited: usize,
    pub rejected: usize,
    /// Rank against the labelled gain, attack and realism added, over the simulated candidates.
    pub spearman_pooled: Option<f64>,
    pub kendall_pooled: Option<f64>,
    /// Predicted against labelled difference.
    pub spearman_attack: Option<f64>,
    pub spearman_realism: Option<f64>,
    /// Root mean squared error of the predicted difference, attack and realism together, as a share of what it is for the guess
    /// that a child is like its parent.
    pub error_ratio_to_parent: Option<f64>,
    /// The same of absolute errors. The guess has the advantage that most differences are exactly zero.
    pub absolute_error_ratio_to_parent: Option<f64>,
    /// Labels in their intervals, per cent; attack and realism count one each.
    pub coverage_80_pct: Option<f64>,
    /// Share of the accepted candidates, among the simulated, that are among the first three in ten by rank.
    pub recall_top_30_pct: Option<f64>,
    /// Share of the first three in ten that were accepted.
    pub precision_top_30_pct: Option<f64>,
    /// Share of those that would be turned away that the archive accepts, estimated from the drawn ones by their weights.
    pub false_reject_pct: Option<f64>,
    /// 95 % bootstrap interval over epochs of lineages.
    pub false_reject_interval: Option<[f64; 2]>,
    /// The same where a draw of as many decides in place of the rank: the result of a rank that knows nothing. Over the
    /// epochs in which some candidate was turned away.
    pub false_reject_of_a_draw_pct: Option<f64>,
    /// Accepted candidates of the drawn ones alone, per cent: what a random choice accepts.
    pub audited_accepted_pct: Option<f64>,
    pub selected_accepted_pct: Option<f64>,
    /// Mean over epochs of lineages: gain of the best simulated candidate less that of the best of the first three in ten.
    pub regret: Option<f64>,
}

/// Measures a set of candidates.
pub fn quality(cases: &[&Case]) -> Quality {
    let labelled: Vec<(&Case, Objectives, bool)> =
        cases.iter().filter_map(|case| case.label.map(|(label, accepted)| (*case, label, accepted))).collect();
    let of = |read: &dyn Fn(&(&Case, Objectives, bool)) -> f64| labelled.iter().map(read).collect::<Vec<f64>>();
    let (scores, gains) = (of(&|(case, ..)| case.rank_score), of(&|(_, label, _)| gain(label)));
    let decided = |decision: RouteDecision| cases.iter().filter(|case| case.decision == decision).count();
    let accepted = |decision: RouteDecision| {
        let of = labelled.iter().filter(|(case, ..)| case.decision == decision);
        share_pct(of.map(|(.., accepted)| (1.0, *accepted)))
    };
    let (recall, precision) = top(&labelled);
    let beside: Vec<Compared> = labelled.iter().map(|(case, label, _)| compared(case, *label)).collect();
    let turned_away: Vec<(&Case, bool)> =
        labelled.iter().filter(|(case, ..)| case.turned_away).map(|(case, _, accepted)| (*case, *accepted)).collect();
    Quality {
        admitted: cases.len(),
        selected: decided(RouteDecision::Select),
        audited: decided(RouteDecision::Audit),
        rejected: decided(RouteDecision::Reject),
        spearman_pooled: spearman(&scores, &gains),
        kendall_pooled: kendall(&scores, &gains),
        spearman_attack: spearman(&of(&|(case, ..)| case.predicted.attack), &of(&|(_, label, _)| label.attack)),
        spearman_realism: spearman(&of(&|(case, ..)| case.predicted.realism), &of(&|(_, label, _)| label.realism)),
        error_ratio_to_parent: ratio(&beside, |error| error * error).map(f64::sqrt),
        absolute_error_ratio_to_parent: ratio(&beside, f64::abs),
        coverage_80_pct: coverage_pct(&beside),
        recall_top_30_pct: recall,
        precision_top_30_pct: precision,
        false_reject_pct: share_pct(turned_away.iter().map(|(case, accepted)| (case.weight, *accepted))),
        false_reject_interval: false_reject_interval(&turned_away),
        false_reject_of_a_draw_pct: of_a_draw(&labelled),
        audited_accepted_pct: accepted(RouteDecision::Audit),
        selected_accepted_pct: accepted(RouteDecision::Select),
        regret: regret(&labelled),
    }
}

/// Attack and realism together, each candidate once.
fn compared(case: &Case, label: Objectives) -> Compared {
    Compared { predicted: case.predicted, half_width: case.half_width, label, weight: 1.0 }
}

fn ratio(of: &[Compared], size: fn(f64) -> f64) -> Option<f64> {
    loss_ratio(of, &|error| size(error.attack) + size(error.realism))
}

/// Candidates by epoch of their lineage.
fn grouped<'a, T: Copy>(of: &'a [T], case: impl Fn(&T) -> &'a Case) -> Vec<Vec<T>> {
    let mut groups: BTreeMap<(&LineageId, u32), Vec<T>> = BTreeMap::new();
    for item in of {
        let case = case(item);
        groups.entry((&case.lineage, case.epoch)).or_default().push(*item);
    }
    groups.into_values().collect()
}

fn first(group: &[(&Case, Objectives, bool)]) -> Vec<bool> {
    first_by_rank(&group.iter().map(|(case, ..)| case.rank_score).collect::<Vec<f64>>())
}

/// Recall and precision of the first three in ten.
fn top(labelled: &[(&Case, Objectives, bool)]) -> (Option<f64>, Option<f64>) {
    let groups = grouped(labelled, |(case, ..)| *case);
    let marked: Vec<(bool, bool)> =
        groups.iter().flat_map(|g| first(g).into_iter().zip(g.iter().map(|(.., accepted)| *accepted))).collect();
    let recall = share_pct(marked.iter().filter(|(_, accepted)| *accepted).map(|(first, _)| (1.0, *first)));
    let precision = share_pct(marked.iter().filter(|(first, _)| *first).map(|(_, accepted)| (1.0, *accepted)));
    (recall, precision)
}

fn regret(labelled: &[(&Case, Objectives, bool)]) -> Option<f64> {
    let best = |gains: &mut dyn Iterator<Item = f64>| gains.fold(0.0f64, f64::max);
    let of = |group: &Vec<(&Case, Objectives, bool)>| {
        let first = first(group);
        let all = best(&mut group.iter().map(|(_, label, _)| gain(label)));
        let chosen = group.iter().zip(&first).filter(|(_, first)| **first);
        all - best(&mut chosen.map(|((_, label, _), _)| gain(label)))
    };
    num::mean(&grouped(labelled, |(case, ..)| *case).iter().map(of).collect::<Vec<f64>>())
}

/// Everybody's acceptance, by how many each stands for: a draw turns away the same share of it.
fn of_a_draw(labelled: &[(&Case, Objectives, bool)]) -> Option<f64> {
    let ranked = grouped(labelled, |(case, ..)| *case);
    let ranked = ranked.iter().filter(|group| group.iter().any(|(case, ..)| case.turned_away)).flatten();
    share_pct(ranked.map(|(case, _, accepted)| (case.weight, *accepted)))
}

fn false_reject_interval(turned_away: &[(&Case, bool)]) -> Option<[f64; 2]> {
    let groups = grouped(turned_away, |(case, _)| *case);
    let mut stream = SEED.stream(&["evidence", "evaluator"]);
    let drawn = (0..if groups.is_empty() { 0 } else { RESAMPLES }).filter_map(|_| {
        let of: Vec<usize> = groups.iter().map(|_| stream.below(groups.len())).collect();
        share_pct(of.into_iter().flat_map(|place| &groups[place]).map(|(case, accepted)| (case.weight, *accepted)))
    });
    interval(&drawn.collect::<Vec<f64>>())
}
