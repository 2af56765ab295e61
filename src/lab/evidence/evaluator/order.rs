//! Random order against the evaluator's order of an epoch's candidates: how many evaluations until the n-th useful one, and how many
//! useful ones among the first k. Useful is what the archive accepts. Only epochs that were simulated whole can be asked: elsewhere the
//! labels of those left out are missing.

use std::collections::BTreeMap;

use super::case::{Case, cases};
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::LineageId;
use crate::world::measures::{gain, spearman};

/// An epoch of a lineage whose candidates were all ranked and all labelled.
#[derive(Clone, Debug, PartialEq)]
pub struct Epoch {
    /// The run's name and its lineage: epochs of one lineage are no independent samples.
    pub lineage: (String, LineageId),
    /// Epoch, from 0.
    pub epoch: u32,
    /// For each place of the ranked order, true if the candidate there is useful.
    pub useful: Vec<bool>,
    /// Rank correlation of the rank score with the labelled gain; `None` where either is the same of all.
    pub spearman: Option<f64>,
}

impl Epoch {
    /// Returns the number of useful candidates.
    pub fn useful_count(&self) -> usize {
        self.useful.iter().filter(|useful| **useful).count()
    }

    /// Evaluations until the `n`-th useful candidate (from 1), by rank and in expectation over random orders, which is
    /// n (m + 1) / (u + 1) for u useful ones of m. `None` with fewer than `n`.
    pub fn evaluations_to(&self, n: usize) -> Option<[f64; 2]> {
        let place = self.useful.iter().enumerate().filter(|(_, useful)| **useful).nth(n.checked_sub(1)?)?.0;
        let (m, u) = (self.useful.len() as f64, self.useful_count() as f64);
        Some([(place + 1) as f64, n as f64 * (m + 1.0) / (u + 1.0)])
    }

    /// Useful ones among the first `k`, by rank and in expectation over random orders. `None` with fewer than `k` candidates.
    pub fn yield_at(&self, k: usize) -> Option<[f64; 2]> {
        let first = self.useful.get(..k)?;
        let ordered = first.iter().filter(|useful| **useful).count() as f64;
        Some([ordered, k as f64 * self.useful_count() as f64 / self.useful.len() as f64])
    }
}

/// The epochs of these runs that can be asked, in their order. One whose candidates all have the same rank score tells nothing and
/// is left out; of equals the earlier candidate comes first.
pub fn epochs(runs: &[&RecordedRun]) -> Vec<Epoch> {
    let mut ordered = Vec::new();
    for run in runs {
        let mut groups: BTreeMap<(LineageId, u32), Vec<Case>> = BTreeMap::new();
        for case in cases(run) {
            groups.entry((case.lineage.clone(), case.epoch)).or_default().push(case);
        }
        for ((lineage, epoch), mut group) in groups {
            let ranked = group.windows(2).any(|pair| pair[0].rank_score != pair[1].rank_score);
            if !ranked || group.iter().any(|case| case.label.is_none()) {
                continue;
            }
            group.sort_by(|a, b| b.rank_score.total_cmp(&a.rank_score));
            let useful = group.iter().map(|case| case.label.is_some_and(|(_, accepted)| accepted)).collect();
            let scores: Vec<f64> = group.iter().map(|case| case.rank_score).collect();
            let gains: Vec<f64> = group.iter().filter_map(|case| case.label.map(|(label, _)| gain(&label))).collect();
            let spearman = spearman(&scores, &gains);
            ordered.push(Epoch { lineage: (run.opened.name.clone(), lineage), epoch, useful, spearman });
        }
    }
    ordered
}

#[cfg(test)]
mod tests {
    use super::*;

    fn epoch(useful: &[bool]) -> Epoch {
        Epoch { lineage: ("run".into(), LineageId::new("cat-idm")), epoch: 1, useful: useful.to_vec(), spearman: None }
    }

    #[test]
    fn the_expectation_over_random_orders_is_the_mean_over_all_of_them() {
        // Two useful of four: six orders. First useful at 1 in three of them, 2 in two, 3 in one; second at 2, 3, 3, 4, 4, 4.
        let [ranked, random] = epoch(&[false, true, true, false]).evaluations_to(1).unwrap();
        assert_eq!((ranked, random), (2.0, (3.0 * 1.0 + 2.0 * 2.0 + 3.0) / 6.0));
        let [ranked, random] = epoch(&[false, true, true, false]).evaluations_to(2).unwrap();
        assert_eq!((ranked, random), (3.0, (2.0 + 3.0 + 3.0 + 4.0 + 4.0 + 4.0) / 6.0));
    }

    #[test]
    fn what_is_not_there_has_no_number() {
        let one = epoch(&[false, true]);
        assert_eq!((one.evaluations_to(0), one.evaluations_to(2), one.yield_at(3)), (None, None, None));
        assert_eq!(one.yield_at(1), Some([0.0, 0.5]));
    }
}
