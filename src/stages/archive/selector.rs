//! The active selector: which point of a trade-off is reported as the practical generator (paper, MetaDrive protocol:
//! R >= 0.95, relative tolerance 0.05, parent included). It is applied once, at the end of a run: who leads in between is
//! `promotion`'s.
//!
//! The paper names the two numbers, not the rule. Ours: among candidates with R >= `realism_min`, those whose attack
//! is at least (1 - `tolerance`) times the largest such attack are as good as tied, and of these the most realistic
//! one is taken; then larger attack, then the earlier one. Where nobody reaches `realism_min`, the most realistic one
//! is taken, then larger attack, then the earlier one. Two of the paper's twenty rows contradict that, and one contradicts
//! the other reading, the largest attack with R >= `realism_min`: `rule = "best_attack"`.

use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

use crate::objects::{Objectives, ReportedBy, SolutionId, is_unsaid, is_yes, yes};

/// Numbers of the realism-constrained rule. Come from the experiment file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SelectorOptions {
    /// Least realism, 1 (paper: 0.95).
    pub realism_min: f64,
    /// ε: share of the best attack that may be given up for realism, 1 (paper: 0.05).
    pub tolerance: f64,
    /// Two further values of `realism_min` at which the finalists are chosen from as well, to be reported beside the active
    /// generator: one point of a front says little.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub also_at: Option<[f64; 2]>,
    /// Choice among those that are realistic enough.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub rule: ReportedBy,
    /// True if a program that acts nowhere is no contender. The paper does not say so.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub must_act: bool,
    /// True if the most realistic of the others fill PF-Area's programs up where too few reach `realism_min`. Of the paper's
    /// descendants those alone are eligible that reach it.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub fills_up: bool,
}

impl SelectorOptions {
    /// The rule of a file that names these two numbers alone.
    pub const fn at(realism_min: f64, tolerance: f64) -> SelectorOptions {
        SelectorOptions {
            realism_min,
            tolerance,
            also_at: None,
            rule: ReportedBy::Tolerance,
            must_act: true,
            fills_up: true,
        }
    }

    /// Returns `true` if a program of this coverage may be reported.
    pub fn admits(&self, coverage: f64) -> bool {
        coverage > 0.0 || !self.must_act
    }

    /// The share of the best attack that counts as tied with it.
    pub fn tied_share(&self) -> f64 {
        match self.rule {
            ReportedBy::Tolerance => 1.0 - self.tolerance,
            ReportedBy::BestAttack => 1.0,
        }
    }

    /// The values of `realism_min` that are reported beside the active generator's, and that one, in rising order; empty
    /// where no further ones are declared.
    pub fn floors(&self) -> Vec<f64> {
        let mut all: Vec<f64> = self.also_at.iter().flatten().copied().collect();
        if !all.is_empty() {
            all.push(self.realism_min);
        }
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }
}

/// One candidate for selection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contender {
    pub solution: SolutionId,
    pub objectives: Objectives,
    /// Share of scenes in which it acts.
    pub coverage: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SelectionRule {
    /// The strongest attack among those realistic enough, up to the tolerance.
    RealismConstrained,
    /// Nobody is realistic enough: the most realistic one.
    MostRealistic,
}

/// Selected program, and everything that the rule compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Selection {
    pub solution: SolutionId,
    pub objectives: Objectives,
    pub rule: SelectionRule,
    /// Number of contenders that reach `realism_min`, and of all contenders.
    pub eligible: usize,
    pub contenders: usize,
    /// Largest attack among the eligible; `None` where there are none.
    pub attack_best: Option<f64>,
    /// Those within the tolerance of it, in their order.
    pub tied: Vec<SolutionId>,
}

impl Selection {
    /// The reason in one sentence.
    pub fn reason(&self) -> String {
        match (self.rule, self.attack_best) {
            (SelectionRule::RealismConstrained, Some(best)) => format!(
                "{} of {} reach the realism required; best attack among them {best:.4}, {} within tolerance, of these the most realistic",
                self.eligible,
                self.contenders,
                self.tied.len()
            ),
            _ => format!("none of {} reaches the realism required; the most realistic one", self.contenders),
        }
    }
}

/// The first `k` by the rule, each chosen from those that are left. Whoever acts nowhere is none of them, and whoever is not
/// realistic enough none where nothing fills up.
pub fn first_by_rule(mut contenders: Vec<Contender>, k: usize, options: &SelectorOptions) -> Vec<SolutionId> {
    contenders.retain(|contender| options.admits(contender.coverage));
    let mut first = Vec::new();
    let counts = |next: &Selection| options.fills_up || next.rule == SelectionRule::RealismConstrained;
    while let Some(next) = select_active(&contenders, options).filter(|next| first.len() < k && counts(next)) {
        contenders.retain(|contender| contender.solution != next.solution);
        first.push(next.solution);
    }
    first
}

/// Applies the rule to contenders in their fixed order (the parent first). Whoever acts nowhere is no contender, but the
/// parent stays where nobody else is left. `None` of nobody.
pub fn select_active(contenders: &[Contender], options: &SelectorOptions) -> Option<Selection> {
    let acting: Vec<Contender> = contenders.iter().filter(|c| options.admits(c.coverage)).cloned().collect();
    let contenders = if acting.is_empty() { &contenders[..contenders.len().min(1)] } else { acting.as_slice() };
    let eligible: Vec<&Contender> = contenders.iter().filter(|c| c.objectives.realism >= options.realism_min).collect();
    let attack_best = eligible.iter().map(|c| c.objectives.attack).reduce(f64::max);
    let (rule, tied) = match attack_best {
        Some(best) => {
            let floor = options.tied_share() * best;
            let tied = eligible.iter().copied().filter(|c| c.objectives.attack >= floor).collect();
            (SelectionRule::RealismConstrained, tied)
        }
        None => (SelectionRule::MostRealistic, contenders.iter().collect::<Vec<_>>()),
    };
    let chosen = tied.iter().copied().reduce(|best, next| match more_realistic(next, best) {
        Ordering::Greater => next,
        _ => best,
    })?;
    Some(Selection {
        solution: chosen.solution.clone(),
        objectives: chosen.objectives,
        rule,
        eligible: eligible.len(),
        contenders: contenders.len(),
        attack_best,
        tied: if attack_best.is_some() { tied.iter().map(|c| c.solution.clone()).collect() } else { Vec::new() },
    })
}

fn more_realistic(a: &Contender, b: &Contender) -> Ordering {
    let (a, b) = (&a.objectives, &b.objectives);
    a.realism.total_cmp(&b.realism).then(a.attack.total_cmp(&b.attack))
}

#[cfg(test)]
mod tests {
    use super::super::front::samples::objectives;
    use super::*;
    use proptest::prelude::*;

    const PAPER: SelectorOptions = SelectorOptions::at(0.95, 0.05);

    fn contenders(points: &[[f64; 2]]) -> Vec<Contender> {
        let one = |(i, p): (usize, &[f64; 2])| Contender {
            solution: SolutionId::new(format!("s{i}")),
            objectives: objectives(*p),
            coverage: 1.0,
        };
        points.iter().enumerate().map(one).collect()
    }

    fn selected(points: &[[f64; 2]]) -> String {
        select_active(&contenders(points), &PAPER).unwrap().solution.0
    }

    #[test]
    fn an_unrealistic_attack_is_not_selected_however_strong() {
        assert_eq!(selected(&[[0.3, 0.96], [0.9, 0.94]]), "s0");
    }

    #[test]
    fn within_the_tolerance_of_the_best_attack_realism_decides() {
        assert_eq!(selected(&[[0.80, 0.95], [0.77, 0.99], [0.75, 1.0]]), "s1");
    }

    #[test]
    fn of_equals_the_earlier_stays_so_that_a_parent_is_not_replaced_for_nothing() {
        assert_eq!(selected(&[[0.5, 0.97], [0.5, 0.97]]), "s0");
    }

    #[test]
    fn where_nobody_is_realistic_enough_the_most_realistic_is_taken() {
        let choice = select_active(&contenders(&[[0.9, 0.5], [0.2, 0.9], [0.3, 0.9]]), &PAPER).unwrap();
        assert_eq!(choice.solution.as_str(), "s2");
        assert_eq!(choice.rule, SelectionRule::MostRealistic);
        assert_eq!(choice.reason(), "none of 3 reaches the realism required; the most realistic one");
    }

    #[test]
    fn a_program_that_does_nothing_is_not_selected_however_well_it_scores() {
        let mut all = contenders(&[[0.3, 0.96], [0.9, 1.0]]);
        all[1].coverage = 0.0;
        assert_eq!(select_active(&all, &PAPER).unwrap().solution.as_str(), "s0");
        all[0].coverage = 0.0;
        assert_eq!(select_active(&all, &PAPER).unwrap().solution.as_str(), "s0", "the parent stays where nobody acts");
        assert_eq!(select_active(&all[..0], &PAPER), None);
        let open = SelectorOptions { must_act: false, ..PAPER };
        let (idle, parent) =
            (Contender { coverage: 0.0, ..all[1].clone() }, Contender { coverage: 1.0, ..all[0].clone() });
        let both = [parent, idle];
        assert_eq!(select_active(&both, &open).unwrap().solution.as_str(), "s1", "where acting is not asked for");
        assert_eq!(first_by_rule(both.to_vec(), 2, &open).len(), 2);
    }

    #[test]
    fn where_nothing_fills_up_only_the_realistic_are_among_the_first() {
        let all = contenders(&[[0.3, 0.96], [0.9, 0.94], [0.2, 0.97]]);
        let first = |options: &SelectorOptions| first_by_rule(all.clone(), 3, options).len();
        assert_eq!((first(&PAPER), first(&SelectorOptions { fills_up: false, ..PAPER })), (3, 2));
    }

    #[test]
    fn by_the_best_attack_the_tolerance_means_nothing() {
        let strongest = SelectorOptions { rule: ReportedBy::BestAttack, ..PAPER };
        let all = contenders(&[[0.80, 0.95], [0.77, 0.99], [0.80, 0.96], [0.90, 0.94]]);
        assert_eq!(select_active(&all, &PAPER).unwrap().solution.as_str(), "s1");
        assert_eq!(
            select_active(&all, &strongest).unwrap().solution.as_str(),
            "s2",
            "of equals the more realistic one"
        );
    }

    proptest! {
        #[test]
        fn nobody_eligible_beats_the_selected_by_more_than_the_tolerance(
            points in prop::collection::vec([0.0..=1.0f64, 0.9..=1.0f64], 1..20)
        ) {
            let all = contenders(&points);
            let choice = select_active(&all, &PAPER).unwrap();
            for other in all.iter().filter(|c| c.objectives.realism >= 0.95) {
                prop_assert!(choice.objectives.realism >= 0.95);
                prop_assert!(choice.objectives.attack >= 0.95 * other.objectives.attack);
            }
        }
    }
}
