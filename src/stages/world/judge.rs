//! The world judge: whether a proposed configuration takes the place of the active one. Both are held against the same
//! candidates, and a tie keeps the incumbent.

use std::collections::BTreeSet;

use super::held::{Held, Judging, measures};
use crate::kernel::num;
use crate::objects::{JudgeRule, Judgement, LineageId, MeasureGain, Objection, WorldMeasures};

/// Differences below this are rounding.
const ROUNDING: f64 = 1e-9;
/// Epochs of lineages that a standard error rests on at least.
const GROUPS_MIN: usize = 3;
/// Measures that a challenger may not worsen, and one of which it must better.
const COMPARED: [JudgeRule; 4] =
    [JudgeRule::Ranking, JudgeRule::RealismError, JudgeRule::Coverage, JudgeRule::FalseRejects];

/// j: both lists hold the same candidates in the same order.
pub fn judge(judging: &Judging<'_>, incumbent: &[Held<'_>], challenger: &[Held<'_>]) -> Judgement {
    let pair = Pair { judging, incumbent: incumbent.iter().collect(), challenger: challenger.iter().collect() };
    let (old, new) = pair.measures(None);
    let (options, left_out) = (judging.options, pair.left_out());
    let gain = |rule, (old, new): &(WorldMeasures, WorldMeasures)| gain(judging, rule, old, new);
    let error = |rule| jackknife(&left_out.iter().map(|both| gain(rule, both)).collect::<Vec<f64>>());
    let gains: Vec<MeasureGain> = COMPARED
        .into_iter()
        .map(|rule| MeasureGain { rule, gain: gain(rule, &(old, new)), error: error(rule) })
        .collect();
    let mut objections = Vec::new();
    if old.held < options.held_labels_min as usize {
        let says = format!("{} held candidates, {} are needed", old.held, options.held_labels_min);
        objections.push(Objection { rule: JudgeRule::Evidence, says });
    }
    let slack = |rule: JudgeRule| if rule == JudgeRule::Coverage { options.coverage_slack_pct } else { 0.0 };
    for of in gains.iter().filter(|of| of.gain < -slack(of.rule) - ROUNDING) {
        objections.push(Objection { rule: of.rule, says: said(of.rule, &old, &new) });
    }
    let betters = |of: &MeasureGain| {
        of.error.is_some_and(|error| of.gain > (options.gain_errors * error).max(slack(of.rule)).max(ROUNDING))
    };
    if !gains.iter().any(betters) {
        let says = format!("no measure gains more than {} of its standard errors", options.gain_errors);
        objections.push(Objection { rule: JudgeRule::Gain, says });
    }
    Judgement { incumbent: old, challenger: new, gains, objections }
}

/// The numbers of a measure before and after.
fn said(rule: JudgeRule, old: &WorldMeasures, new: &WorldMeasures) -> String {
    let (name, read): (&str, fn(&WorldMeasures) -> Option<f64>) = match rule {
        JudgeRule::Ranking => ("rank correlation", |of| of.rank_correlation),
        JudgeRule::RealismError => ("error of realism against the guess", |of| of.realism_error),
        JudgeRule::Coverage => ("coverage %", |of| of.coverage_pct),
        JudgeRule::FalseRejects => ("false rejects %", |of| of.false_reject_pct),
        JudgeRule::Evidence | JudgeRule::Gain => ("", |_| None),
    };
    let number = |of: &WorldMeasures| read(of).map_or("none".into(), |value| format!("{value:.4}"));
    format!("{name} would go from {} to {}", number(old), number(new))
}

struct Pair<'j, 'h, 'a> {
    judging: &'j Judging<'j>,
    incumbent: Vec<&'h Held<'a>>,
    challenger: Vec<&'h Held<'a>>,
}

impl Pair<'_, '_, '_> {
    /// Measures of both, without one epoch of a lineage where that is given.
    fn measures(&self, without: Option<(&LineageId, u32)>) -> (WorldMeasures, WorldMeasures) {
        let of = |list: &[&Held<'_>]| {
            let kept: Vec<&Held<'_>> = list.iter().copied().filter(|held| Some(held.group()) != without).collect();
            measures(&kept, &self.judging.founding.routing)
        };
        (of(&self.incumbent), of(&self.challenger))
    }

    /// The same without each epoch of a lineage in turn: its candidates have a parent and a window in common.
    fn left_out(&self) -> Vec<(WorldMeasures, WorldMeasures)> {
        let groups: BTreeSet<(&LineageId, u32)> = self.incumbent.iter().map(|held| held.group()).collect();
        groups.into_iter().map(|group| self.measures(Some(group))).collect()
    }
}

/// Returns the challenger's gain in a measure; larger is better.
fn gain(judging: &Judging<'_>, rule: JudgeRule, old: &WorldMeasures, new: &WorldMeasures) -> f64 {
    let level_pct = 100.0 * judging.founding.interval_level;
    let less = |read: fn(&WorldMeasures) -> Option<f64>| read(old).unwrap_or(0.0) - read(new).unwrap_or(0.0);
    // Without intervals nothing is held.
    let off = |of: &WorldMeasures| (of.coverage_pct.unwrap_or(0.0) - level_pct).abs();
    match rule {
        // A configuration that cannot rank has a correlation of 0.
        JudgeRule::Ranking => -less(|of| of.rank_correlation),
        JudgeRule::RealismError => less(|of| of.realism_error),
        JudgeRule::Coverage => off(old) - off(new),
        JudgeRule::FalseRejects => less(|of| of.false_reject_pct),
        JudgeRule::Evidence | JudgeRule::Gain => 0.0,
    }
}

/// Standard error from what a measure is with each group left out.
pub(super) fn jackknife(left_out: &[f64]) -> Option<f64> {
    let (n, mean) = (left_out.len() as f64, num::mean(left_out)?);
    let spread = num::sum(left_out.iter().map(|gain| (gain - mean) * (gain - mean)));
    (left_out.len() >= GROUPS_MIN).then(|| ((n - 1.0) / n * spread).sqrt())
}
