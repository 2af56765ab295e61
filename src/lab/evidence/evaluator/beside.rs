//! Two evaluators on the same recorded candidates: two runs whose proposals and labels are the same and whose routes are not, because
//! every admitted candidate was simulated in both.

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use super::super::aligned::Aligned;
use super::case::{Case, cases, first_by_rank};
use super::quality::quality;
use crate::archive::{hypervolume, point};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::{Seed, num};
use crate::objects::{AttemptId, LineageId};
use crate::world::measures::share_pct;

/// λ_A = λ_R and λ_U at which a candidate is turned away for its value: those of the MetaDrive protocol, for every evaluator alike.
const LOSS: f64 = 0.15;
const SURE: f64 = 0.2;
/// Draws of as many candidates as the rank keeps, and the root of their stream. No result of a run depends on them.
const DRAWS: usize = 200;
const SEED: Seed = Seed(65);

/// Results of one evaluator on the candidates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluated {
    /// Name of the run's experiment.
    pub run: String,
    /// Rank against the labelled gain, over all candidates.
    pub spearman: Option<f64>,
    /// Predicted against labelled difference.
    pub spearman_attack: Option<f64>,
    pub spearman_realism: Option<f64>,
    /// Root mean squared error as a share of that of the guess that a child is like its parent.
    pub error_ratio: Option<f64>,
    /// Labels in the intervals, per cent.
    pub coverage_pct: Option<f64>,
    /// Share that the archive accepts of those that are not among the first three in ten of their epoch, per cent.
    pub false_reject_pct: Option<f64>,
    /// Hypervolume of parent and first three in ten as a share of that of parent and all, mean over epochs of lineages, per cent.
    pub hypervolume_pct: Option<f64>,
    /// Candidates that are low and certain, per cent, and what the archive accepts of them.
    pub low_pct: Option<f64>,
    pub low_accepted_pct: Option<f64>,
    /// Candidates of which the evaluator is not certain, per cent.
    pub uncertain_pct: Option<f64>,
}

/// Both evaluators, and a draw of as many.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Beside {
    /// Candidates that both runs labelled, in how many epochs of lineages.
    pub candidates: usize,
    pub epochs: usize,
    pub evaluators: Vec<Evaluated>,
    /// Hypervolume that a draw of three in ten comes to, and what it leaves out of the accepted, per cent.
    pub drawn_hypervolume_pct: Option<f64>,
    pub accepted_pct: Option<f64>,
}

type Epochs<'c> = BTreeMap<(&'c LineageId, u32), Vec<&'c Case>>;

/// Compares the evaluators of two runs; an error says why they cannot be compared.
pub fn beside(runs: [&RecordedRun; 2], reference: [f64; 2]) -> Result<Beside, String> {
    let of = runs.map(cases);
    let labelled = |cases: &[Case]| -> BTreeSet<(AttemptId, String)> {
        let known = cases.iter().filter(|case| case.label.is_some());
        known.map(|case| (case.attempt.clone(), case.program.to_hex())).collect()
    };
    let both: BTreeSet<(AttemptId, String)> = labelled(&of[0]).intersection(&labelled(&of[1])).cloned().collect();
    let shared = of.each_ref().map(|cases| -> Vec<&Case> {
        cases.iter().filter(|case| both.contains(&(case.attempt.clone(), case.program.to_hex()))).collect()
    });
    if shared[0].is_empty() {
        let why =
            "have no labelled candidate in common; run one experiment with both evaluators and rollouts for all slots";
        return Err(format!("`{}` and `{}` {why}", runs[0].opened.name, runs[1].opened.name));
    }
    let evaluators =
        runs.iter().zip(&shared).map(|(run, cases)| evaluated(&run.opened.name, cases, reference)).collect();
    let groups = grouped(&shared[0]);
    let accepted = shared[0].iter().filter_map(|case| case.label.map(|(_, accepted)| (1.0, accepted)));
    Ok(Beside {
        candidates: shared[0].len(),
        epochs: groups.len(),
        evaluators,
        drawn_hypervolume_pct: drawn(&groups, reference),
        accepted_pct: share_pct(accepted),
    })
}

fn evaluated(run: &str, cases: &[&Case], reference: [f64; 2]) -> Evaluated {
    let (groups, whole) = (grouped(cases), quality(cases));
    let mut turned_away: Vec<(f64, bool)> = Vec::new();
    let mut shares: Vec<f64> = Vec::new();
    for group in groups.values() {
        let kept = first_by_rank(&group.iter().map(|case| case.rank_score).collect::<Vec<f64>>());
        let left = group.iter().zip(&kept).filter(|(_, kept)| !**kept);
        turned_away.extend(left.filter_map(|(case, _)| case.label.map(|(_, accepted)| (1.0, accepted))));
        let chosen: Vec<&Case> = group.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(case, _)| *case).collect();
        shares.extend(share(&chosen, group, reference));
    }
    let certain = |case: &&&Case| case.uncertainty <= SURE;
    let loses = |case: &&&Case| case.predicted.attack < -LOSS || case.predicted.realism < -LOSS;
    let low =
        cases.iter().filter(certain).filter(loses).filter_map(|case| case.label.map(|(_, accepted)| (1.0, accepted)));
    Evaluated {
        run: run.into(),
        spearman: whole.spearman_pooled,
        spearman_attack: whole.spearman_attack,
        spearman_realism: whole.spearman_realism,
        error_ratio: whole.error_ratio_to_parent,
        coverage_pct: whole.coverage_80_pct,
        false_reject_pct: share_pct(turned_away.into_iter()),
        hypervolume_pct: num::mean(&shares).map(|share| 100.0 * share),
        low_pct: share_pct(cases.iter().map(|case| (1.0, certain(&case) && loses(&case)))),
        low_accepted_pct: share_pct(low),
        uncertain_pct: share_pct(cases.iter().map(|case| (1.0, !certain(&case)))),
    }
}

fn grouped<'c>(cases: &[&'c Case]) -> Epochs<'c> {
    let mut groups = Epochs::new();
    cases.iter().for_each(|case| groups.entry((&case.lineage, case.epoch)).or_default().push(case));
    groups
}

/// Hypervolume with some of an epoch's candidates as a share of that with all; `None` where all together have none.
fn share(chosen: &[&Case], all: &[&Case], reference: [f64; 2]) -> Option<f64> {
    let area = |of: &[&Case]| {
        let points = of.iter().filter_map(|case| case.labelled.as_ref()).chain(all.first().map(|case| &case.parent));
        hypervolume(&points.map(point).collect::<Vec<_>>(), reference)
    };
    let whole = area(all);
    (whole > 0.0).then(|| area(chosen) / whole)
}

/// The mean over draws of as many candidates as a rank keeps.
fn drawn(groups: &Epochs<'_>, reference: [f64; 2]) -> Option<f64> {
    let mut stream = SEED.stream(&["evidence", "evaluator", "beside"]);
    let mut shares: Vec<f64> = Vec::new();
    for group in groups.values() {
        let kept = first_by_rank(&vec![0.0; group.len()]).into_iter().filter(|kept| *kept).count();
        for _ in 0..DRAWS {
            let mut order = group.clone();
            stream.shuffle(&mut order);
            shares.extend(share(&order[..kept], group, reference));
        }
    }
    num::mean(&shares).map(|share| 100.0 * share)
}

impl Beside {
    /// A column an evaluator, in lines of at most `width` characters.
    pub fn text(&self, width: usize) -> String {
        let number = |value: Option<f64>, digits: usize| value.map_or("-".into(), |value| format!("{value:.digits$}"));
        let row = |name: &str, digits: usize, read: &dyn Fn(&Evaluated) -> Option<f64>, drawn: Option<f64>| {
            let values = self.evaluators.iter().map(|of| number(read(of), digits));
            std::iter::once(name.to_string()).chain(values).chain([number(drawn, digits)]).collect::<Vec<String>>()
        };
        let rows = vec![
            row("Spearman of rank against gain", 3, &|of| of.spearman, Some(0.0)),
            row("Spearman, attack", 3, &|of| of.spearman_attack, None),
            row("Spearman, realism", 3, &|of| of.spearman_realism, None),
            row("error ratio to the guess", 3, &|of| of.error_ratio, None),
            row("coverage %", 1, &|of| of.coverage_pct, None),
            row("false rejects % (first 3 in 10)", 1, &|of| of.false_reject_pct, self.accepted_pct),
            row("hypervolume % (first 3 in 10)", 2, &|of| of.hypervolume_pct, self.drawn_hypervolume_pct),
            row("low and certain %", 1, &|of| of.low_pct, None),
            row("accepted of these %", 1, &|of| of.low_accepted_pct, self.accepted_pct),
            row("uncertain %", 1, &|of| of.uncertain_pct, None),
        ];
        let names = self.evaluators.iter().map(|of| of.run.clone());
        let heads = std::iter::once(String::new()).chain(names).chain(["a draw".into()]).collect();
        let mut out = Aligned { labels: 1, heads, rows, ..Aligned::default() }.text(width);
        let _ = writeln!(
            out,
            "\n{} candidates of {} epochs of lineages, all simulated in both runs. Low and certain: predicted to lose more than {LOSS} of \
             attack or realism, with an uncertainty of at most {SURE}.",
            self.candidates, self.epochs
        );
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Digest;
    use crate::objects::{FamilyName, Objectives, RouteDecision};

    /// Ten candidates of an epoch, of which the last three gain; ranked and predicted as given.
    fn candidates(rank: impl Fn(usize) -> f64, predicted: impl Fn(usize) -> f64, uncertainty: f64) -> Vec<Case> {
        let parent = Objectives { attack: 0.2, realism: 0.9 };
        let case = |k: usize| {
            let difference = Objectives { attack: if k < 7 { -0.2 } else { 0.1 * k as f64 - 0.6 }, realism: 0.0 };
            Case {
                attempt: AttemptId::new(format!("cat/e0s{k}")),
                program: Digest::of_bytes(&[k as u8]),
                lineage: LineageId::new("cat"),
                family: FamilyName::new("cat"),
                epoch: 0,
                decision: RouteDecision::Select,
                predicted: Objectives { attack: predicted(k), realism: 0.0 },
                half_width: None,
                uncertainty,
                parent,
                labelled: Some(Objectives { attack: parent.attack + difference.attack, realism: parent.realism }),
                rank_score: rank(k),
                label: Some((difference, k >= 7)),
                turned_away: false,
                weight: 1.0,
            }
        };
        (0..10).map(case).collect()
    }

    fn of(cases: &[Case]) -> Evaluated {
        evaluated("run", &cases.iter().collect::<Vec<&Case>>(), [0.0, 0.0])
    }

    #[test]
    fn an_evaluator_that_ranks_by_the_gain_keeps_all_and_one_that_ranks_in_reverse_turns_the_accepted_away() {
        let difference = |k: usize| if k < 7 { -0.2 } else { 0.1 * k as f64 - 0.6 };
        let right = of(&candidates(|k| k as f64, difference, 0.1));
        let wrong = of(&candidates(|k| -(k as f64), |k| -difference(k), 0.1));
        assert_eq!((right.false_reject_pct, right.hypervolume_pct), (Some(0.0), Some(100.0)));
        assert!(wrong.false_reject_pct > Some(42.0) && wrong.hypervolume_pct < Some(99.0), "{wrong:?}");
        assert_eq!((right.low_pct, right.low_accepted_pct), (Some(70.0), Some(0.0)));
        assert_eq!((wrong.low_pct, wrong.low_accepted_pct), (Some(20.0), Some(100.0)));
    }

    #[test]
    fn who_is_never_certain_calls_nobody_low_and_a_draw_lies_between_right_and_wrong() {
        let unsure = of(&candidates(|_| 0.0, |_| -1.0, 1.0));
        assert_eq!((unsure.low_pct, unsure.uncertain_pct, unsure.spearman), (Some(0.0), Some(100.0), None));
        let cases = candidates(|k| k as f64, |_| 0.0, 0.1);
        let all: Vec<&Case> = cases.iter().collect();
        let drawn = drawn(&grouped(&all), [0.0, 0.0]).unwrap();
        assert!(drawn < 100.0 && Some(drawn) > of(&candidates(|k| -(k as f64), |_| 0.0, 0.1)).hypervolume_pct);
    }
}
