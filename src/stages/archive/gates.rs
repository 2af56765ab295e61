//! The three acceptance gates (paper, section Simulator Evaluation and Pareto Archive) with every number they compare, and
//! the two conditions that stand before them: the program acts often enough, and it does something else than its parent.
//!
//! All numbers are taken over the scenes on which the child, its parent and the front all have labels. A gain counts where
//! it is above 0 at the declared level; a loss is compared with its ε as it was measured.

use serde::{Deserialize, Serialize};

use super::{
    objectives::{ObjectivesError, admissible},
    paired::{Means, Measure, Panel, is_shown},
    plane::hypervolume,
    promotion::PromotionRule,
};
use crate::objects::{
    AcceptanceGates, AcceptanceRequirement, CoverageFloor, Densification, Difference, FrontOf, FrontPer, JudgedOn,
    LocalPush, ParentTradeoff, Required, Score, Ties, is_unsaid, is_yes, yes,
};

/// Numbers that the gates compare with. They come from the experiment file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArchiveOptions {
    /// Fixed reference point [attack, realism], 1, each in [0, 1). A point that is not above it in both coordinates
    /// never adds hypervolume (paper: "with respect to a fixed reference point").
    pub reference: [f64; 2],
    /// r_0: where the high-realism region begins, 1.
    pub r0: f64,
    /// a_0: where the high-attack region begins, 1.
    pub a0: f64,
    /// ε_R: realism that a child may lose for more attack, 1.
    pub epsilon_r: f64,
    /// ε_A: attack that a child may lose for more realism, 1.
    pub epsilon_a: f64,
    /// ε of PF-Area: least hypervolume of a parent frontier to divide by, 1 (eq. app-pf-area).
    pub epsilon_pf: f64,
    /// How sure a gain must be before it counts, 1: one-sided, over paired scenes. 0.5 counts every measured gain.
    pub level: f64,
    /// Share of its parent's coverage that a program must keep, 1.
    pub coverage_floor: f64,
    /// Rule for who leads the lineage from one epoch to the next.
    pub promotion: PromotionRule,
    /// How sure the gain of a child over its parent must be before it leads, 1: one-sided, over as many evolution scenes as it
    /// takes. Without it whoever was accepted may lead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub race: Option<f64>,
    /// Requirement on a child besides what a gate asks.
    #[serde(default, skip_serializing_if = "Required::is_unsaid")]
    pub requires: Required<AcceptanceRequirement>,
    /// Programs whose points make up the front.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub front: FrontOf,
    /// Unit that has a front of its own.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub front_per: FrontPer,
    /// Scenes on which a child is compared.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub judged_on: JudgedOn,
    /// Rule for which of several equal entries stand on the front.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub ties: Ties,
    /// True if every third slot edits another member of the front than the leader. The paper has one active parent.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub portfolio: bool,
    /// Most children that are measured on after an epoch that did not accept them, because they had a gain that was not shown yet. With
    /// 0, as the paper has it, whoever was not accepted is never looked at again.
    #[serde(default, skip_serializing_if = "is_none_at_all")]
    pub challengers: usize,
    /// True if the parent stands among those whom a child must surpass in ΔHV and local push also where it is not on the
    /// front. The paper has the front alone.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub parent_counts: bool,
}

impl ArchiveOptions {
    /// A level at which every measured gain counts, however unsure.
    pub const ANY_GAIN: f64 = 0.5;

    /// The same options with another level.
    pub fn at(&self, level: f64) -> ArchiveOptions {
        ArchiveOptions { level, ..self.clone() }
    }
}

/// True of a number that a file need not say.
fn is_none_at_all(count: &usize) -> bool {
    *count == 0
}

impl Default for ArchiveOptions {
    /// Every measured gain counts, nothing is a floor, and every rule is the one of a file that does not name it.
    fn default() -> ArchiveOptions {
        ArchiveOptions {
            reference: [0.0; 2],
            r0: 1.0,
            a0: 1.0,
            epsilon_r: 0.0,
            epsilon_a: 0.0,
            epsilon_pf: 1.0,
            level: 0.5,
            coverage_floor: 0.0,
            promotion: PromotionRule::LargestHypervolumeGain,
            race: None,
            requires: Required::default(),
            front: FrontOf::default(),
            front_per: FrontPer::default(),
            judged_on: JudgedOn::default(),
            ties: Ties::default(),
            portfolio: true,
            challengers: 0,
            parent_counts: true,
        }
    }
}

/// An option of the archive that cannot be obeyed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("archive option {option} is {value}; expected {expected}: correct it in the experiment file")]
pub struct OptionsError {
    pub option: &'static str,
    pub value: f64,
    pub expected: &'static str,
}

impl ArchiveOptions {
    /// Refuses what is not a number or outside its range.
    pub fn validate(&self) -> Result<(), OptionsError> {
        let check = |option, value: f64, ok: bool, expected| {
            if ok { Ok(()) } else { Err(OptionsError { option, value, expected }) }
        };
        let [x, y] = self.reference;
        check("reference", x, (0.0..1.0).contains(&x), "a pair of numbers in [0, 1)")?;
        check("reference", y, (0.0..1.0).contains(&y), "a pair of numbers in [0, 1)")?;
        for (name, value) in [
            ("r0", self.r0),
            ("a0", self.a0),
            ("epsilon_r", self.epsilon_r),
            ("epsilon_a", self.epsilon_a),
            ("coverage_floor", self.coverage_floor),
        ] {
            check(name, value, (0.0..=1.0).contains(&value), "a number in [0, 1]")?;
        }
        check("level", self.level, (0.5..1.0).contains(&self.level), "a number in [0.5, 1)")?;
        if let Some(level) = self.race {
            check("race", level, (0.5..1.0).contains(&level), "a number in [0.5, 1)")?;
            let one_leads = self.promotion == PromotionRule::LargestHypervolumeGain;
            check(
                "race",
                level,
                one_leads,
                "none beside promotion = \"two_anchors\" or \"last_accepted\", whose leaders are no gain over one parent",
            )?;
        }
        if let Some((option, value, expected)) = self.contradiction() {
            check(option, value, false, expected)?;
        }
        let positive = self.epsilon_pf > 0.0 && self.epsilon_pf <= 1.0;
        check("epsilon_pf", self.epsilon_pf, positive, "a number in (0, 1]")
    }
}

impl ArchiveOptions {
    /// Two options of which one takes away what the other rests on: the one, its value, and what to do.
    fn contradiction(&self) -> Option<(&'static str, f64, &'static str)> {
        let (race, all) = (self.race, self.front == FrontOf::Evaluated);
        let window = self.judged_on == JudgedOn::Window;
        match race {
            Some(level) if window => Some((
                "race",
                level,
                "none beside judged_on = \"window\": a race compares with the parent's labels on all windows so far, which there are none of \
                 then; remove race, or judge on \"window_then_all\"",
            )),
            _ if all && self.level > 0.5 => Some((
                "level",
                self.level,
                "0.5 beside front = \"evaluated\": a front of all that was measured cannot ask how sure a gain is; lower level, or take \
                 front = \"accepted\"",
            )),
            _ if all && self.coverage_floor > 0.0 => Some((
                "coverage_floor",
                self.coverage_floor,
                "0 beside front = \"evaluated\": who falls below the floor would stand on the front; set it to 0, or take front = \"accepted\"",
            )),
            _ if all && !window => Some((
                "judged_on (absent: window_then_all)",
                0.0,
                "\"window\" beside front = \"evaluated\": whom no gate accepted has no labels beyond its window, so its point would lie \
                 on other scenes than the rest; judge on the window, or take front = \"accepted\"",
            )),
            _ => None,
        }
    }
}

/// The programs that a child is compared with. All are labelled on the child's scenes.
#[derive(Clone, Copy, Debug)]
pub struct Standing<'a> {
    pub child: &'a Score,
    pub parent: &'a Score,
    /// Members of the front.
    pub front: &'a [&'a Score],
}

/// Places in the panel.
const CHILD: usize = 0;
const PARENT: usize = 1;

/// Asks the gates about a candidate. Changes nothing.
pub fn consider(
    standing: &Standing<'_>,
    options: &ArchiveOptions,
    measure: &dyn Measure,
) -> Result<AcceptanceGates, ObjectivesError> {
    admissible(standing.child.objectives)?;
    admissible(standing.parent.objectives)?;
    let scores: Vec<&Score> =
        [standing.child, standing.parent].into_iter().chain(standing.front.iter().copied()).collect();
    let panel = Panel::of(&scores, measure);
    let others: Vec<usize> = (PARENT + usize::from(!options.parent_counts)..scores.len()).collect();
    let densification = densification(&panel, &others, options);
    let local_push = local_push(&panel, &others, densification.holds, options);
    Ok(AcceptanceGates {
        densification,
        local_push,
        parent_tradeoff: parent_tradeoff(&panel, options),
        coverage: coverage_floor(&panel, options),
        differing_scenes: panel.differing(CHILD, PARENT),
        may_do_as_parent: !options.requires.has(AcceptanceRequirement::Differs),
        scenes: panel.scenes(),
        ..AcceptanceGates::default()
    })
}

fn area(means: &dyn Fn(usize) -> Means, members: impl Iterator<Item = usize>, reference: [f64; 2]) -> f64 {
    let points: Vec<[f64; 2]> = members.filter_map(|member| means(member).point()).collect();
    hypervolume(&points, reference)
}

/// ΔHV(c) = HV(P ∪ {c}) - HV(P) > 0 for a non-dominated c. A copy of a front point is not dominated, and gains 0.
fn densification(panel: &Panel<'_>, others: &[usize], options: &ArchiveOptions) -> Densification {
    let before = |means: &dyn Fn(usize) -> Means| area(means, others.iter().copied(), options.reference);
    let after = |means: &dyn Fn(usize) -> Means| area(means, others.iter().copied().chain([CHILD]), options.reference);
    let gain = panel.difference(|means| after(means) - before(means));
    let dominates = |[a, r]: [f64; 2], [b, s]: [f64; 2]| a >= b && r >= s && (a > b || r > s);
    let child = panel.means(CHILD).point();
    let dominated = |child: [f64; 2]| {
        others.iter().filter_map(|other| panel.means(*other).point()).any(|other| dominates(other, child))
    };
    let non_dominated = child.is_some_and(|child| !dominated(child));
    Densification {
        holds: non_dominated && is_shown(&gain, options.level),
        non_dominated,
        hypervolume_before: before(&|program| panel.means(program)),
        hypervolume_gain: gain.value,
        uncertainty: gain.uncertainty,
    }
}

/// More attack than anyone where realism is high, or more realism than anyone where attack is high. The candidate
/// must lie in the region itself; where the region holds nobody yet, densification decides for it.
fn local_push(panel: &Panel<'_>, others: &[usize], densifies: bool, options: &ArchiveOptions) -> LocalPush {
    let points = || others.iter().filter_map(|other| Some((*other, panel.means(*other).point()?)));
    let first_best = |best: (usize, f64), next: (usize, f64)| if next.1 > best.1 { next } else { best };
    let realistic =
        points().filter(|(_, [_, r])| *r >= options.r0).map(|(other, [a, _])| (other, a)).reduce(first_best);
    let strong = points().filter(|(_, [a, _])| *a >= options.a0).map(|(other, [_, r])| (other, r)).reduce(first_best);
    let own = panel.means(CHILD).point();
    let in_region = |inside: fn([f64; 2], &ArchiveOptions) -> bool| own.is_some_and(|own| inside(own, options));
    let attack_push = realistic
        .filter(|_| in_region(|[_, r], options| r >= options.r0))
        .map(|(best, _)| panel.difference(|means| means(CHILD).attack - means(best).attack));
    let realism_push = strong
        .filter(|_| in_region(|[a, _], options| a >= options.a0))
        .map(|(best, _)| panel.difference(|means| realism_change(means(CHILD), means(best))));
    let shown = |push: &Option<Difference>| push.as_ref().is_some_and(|push| is_shown(push, options.level));
    let first_there = densifies
        && (realistic.is_none() && in_region(|[_, r], options| r >= options.r0)
            || strong.is_none() && in_region(|[a, _], options| a >= options.a0));
    LocalPush {
        holds: shown(&attack_push) || shown(&realism_push) || first_there,
        best_attack_at_r0: realistic.map(|(_, attack)| attack),
        best_realism_at_a0: strong.map(|(_, realism)| realism),
        attack_push,
        realism_push,
    }
}

/// No change where one of the two acts nowhere: there is nothing to compare.
fn realism_change(child: Means, other: Means) -> f64 {
    child.realism.zip(other.realism).map_or(0.0, |(child, other)| child - other)
}

/// Better than the parent in one objective while the other falls by no more than its ε.
fn parent_tradeoff(panel: &Panel<'_>, options: &ArchiveOptions) -> ParentTradeoff {
    let attack = panel.difference(|means| means(CHILD).attack - means(PARENT).attack);
    let realism = panel.difference(|means| realism_change(means(CHILD), means(PARENT)));
    let more_attack = is_shown(&attack, options.level) && realism.value >= -options.epsilon_r;
    let more_realism = is_shown(&realism, options.level) && attack.value >= -options.epsilon_a;
    ParentTradeoff {
        holds: more_attack || more_realism,
        attack_change: attack.value,
        attack_uncertainty: attack.uncertainty,
        realism_change: realism.value,
        realism_uncertainty: realism.uncertainty,
    }
}

/// A program that leaves most scenes alone is realistic for nothing.
fn coverage_floor(panel: &Panel<'_>, options: &ArchiveOptions) -> CoverageFloor {
    let (coverage, parent) = (panel.means(CHILD).coverage, panel.means(PARENT).coverage);
    let floor = options.coverage_floor * parent;
    let acts = coverage > 0.0 || !options.requires.has(AcceptanceRequirement::Acts);
    CoverageFloor { holds: acts && coverage >= floor, coverage, parent, floor }
}

#[cfg(test)]
mod tests {
    use super::super::paired::MeanOverScenes;
    use super::super::paired::samples::{alike, scenes};
    use super::*;
    use crate::objects::{Objectives, RealismMean};

    fn options() -> ArchiveOptions {
        ArchiveOptions {
            reference: [0.0; 2],
            r0: 0.9,
            a0: 0.6,
            epsilon_r: 0.02,
            epsilon_a: 0.05,
            epsilon_pf: 1e-9,
            level: 0.8,
            coverage_floor: 0.8,
            ..ArchiveOptions::default()
        }
    }

    fn judged(child: &Score, parent: &Score, front: &[&Score]) -> AcceptanceGates {
        consider(&Standing { child, parent, front }, &options(), &MeanOverScenes::default()).unwrap()
    }

    /// Programs whose labels are the same in every scene, so that nothing is uncertain.
    fn gates(front: &[[f64; 2]], child: [f64; 2], parent: [f64; 2]) -> AcceptanceGates {
        let front: Vec<Score> = front.iter().map(|point| alike(*point)).collect();
        judged(&alike(child), &alike(parent), &front.iter().collect::<Vec<_>>())
    }

    #[test]
    fn the_front_alone_is_surpassed_where_the_parent_does_not_count() {
        let (child, parent, front) = (alike([0.5, 0.7]), alike([0.6, 0.8]), alike([0.2, 0.9]));
        let with = |parent_counts| {
            let options = ArchiveOptions { parent_counts, ..options() };
            let standing = Standing { child: &child, parent: &parent, front: &[&front] };
            consider(&standing, &options, &MeanOverScenes::default()).unwrap().densification.holds
        };
        assert_eq!((with(true), with(false)), (false, true));
    }

    #[test]
    fn a_point_between_two_of_the_front_densifies_it() {
        let found = gates(&[[0.2, 0.9], [0.8, 0.5]], [0.5, 0.7], [0.2, 0.9]).densification;
        assert!(found.holds && found.non_dominated);
        assert!((found.hypervolume_before - (0.2 * 0.9 + 0.6 * 0.5)).abs() < 1e-12);
        assert!((found.hypervolume_gain - 0.3 * 0.2).abs() < 1e-12);
    }

    #[test]
    fn a_copy_of_a_front_point_is_not_dominated_but_gains_nothing() {
        let found = gates(&[[0.2, 0.9]], [0.2, 0.9], [0.2, 0.9]);
        assert!(found.densification.non_dominated && !found.densification.holds);
        assert_eq!((found.densification.hypervolume_gain, found.differing_scenes), (0.0, 0));
        assert!(!found.any());
        // As much of one and less of the other is dominated.
        for behind in [[0.25, 0.5], [0.125, 0.75], [0.125, 0.5]] {
            assert!(!gates(&[[0.25, 0.75]], behind, [0.1, 0.1]).densification.non_dominated, "{behind:?}");
        }
    }

    #[test]
    fn a_push_needs_more_than_the_best_of_its_region() {
        let front = [[0.3, 0.95], [0.7, 0.5]];
        let push = gates(&front, [0.31, 0.92], [0.3, 0.95]).local_push;
        assert!(push.holds);
        let best = (push.best_attack_at_r0.unwrap(), push.best_realism_at_a0.unwrap());
        assert!((best.0 - 0.3).abs() < 1e-12 && (best.1 - 0.5).abs() < 1e-12);
        assert!(!gates(&front, [0.3, 0.96], [0.3, 0.95]).local_push.holds, "equal attack is no push");
        assert!(gates(&front, [0.65, 0.51], [0.3, 0.95]).local_push.holds);
        assert!(!gates(&front, [0.59, 0.89], [0.3, 0.95]).local_push.holds, "outside both regions");
    }

    #[test]
    fn a_push_is_measured_against_the_best_of_its_region_wherever_it_stands_in_the_front() {
        let realistic = [[0.3, 0.95], [0.5, 0.91], [0.2, 0.99]];
        let strong = [[0.7, 0.5], [0.65, 0.6], [0.9, 0.4]];
        for turn in 0..3 {
            let turned = |points: [[f64; 2]; 3]| (0..3).map(|k| points[(k + turn) % 3]).collect::<Vec<_>>();
            let front = [turned(realistic), turned(strong)].concat();
            let push = gates(&front, [0.4, 0.92], [0.1, 0.92]).local_push;
            let best = (push.best_attack_at_r0.unwrap(), push.best_realism_at_a0.unwrap());
            assert!((best.0 - 0.5).abs() < 1e-12 && (best.1 - 0.6).abs() < 1e-12, "{front:?}: {best:?}");
            assert!(!push.holds && gates(&front, [0.51, 0.92], [0.1, 0.92]).local_push.holds);
        }
    }

    #[test]
    fn a_child_acts_in_the_declared_share_of_what_its_parent_acts_in() {
        let acting = |scenes_acted: usize| {
            scenes(&(0..20).map(|k| (0.5, 0.9, k < scenes_acted)).collect::<Vec<(f64, f64, bool)>>())
        };
        let parent = acting(10);
        let found = |acted: usize| judged(&acting(acted), &parent, &[&parent]).coverage;
        assert_eq!((found(8).floor, found(8).parent, found(8).coverage), (0.8 * 0.5, 0.5, 0.4));
        assert!(found(8).holds && !found(7).holds);
    }

    #[test]
    fn an_empty_region_falls_back_to_densification_for_points_inside_it() {
        let push = gates(&[[0.3, 0.8]], [0.1, 0.95], [0.3, 0.8]).local_push;
        assert!(push.holds);
        assert_eq!(push.best_attack_at_r0, None);
        assert!(!gates(&[[0.3, 0.8]], [0.0, 0.95], [0.3, 0.8]).local_push.holds, "gains no area");
        assert!(!gates(&[[0.3, 0.8]], [0.4, 0.85], [0.3, 0.8]).local_push.holds, "densifies, but lies in no region");
    }

    #[test]
    fn a_trade_with_the_parent_is_bounded_on_its_other_side() {
        let front = [[0.9, 0.99]];
        assert!(gates(&front, [0.5, 0.9], [0.4, 0.91]).parent_tradeoff.holds);
        assert!(!gates(&front, [0.5, 0.88], [0.4, 0.91]).parent_tradeoff.holds);
        assert!(gates(&front, [0.36, 0.92], [0.4, 0.91]).parent_tradeoff.holds);
        assert!(!gates(&front, [0.34, 0.92], [0.4, 0.91]).parent_tradeoff.holds);
        assert!(!gates(&front, [0.4, 0.91], [0.4, 0.91]).parent_tradeoff.holds, "no change is no trade");
    }

    #[test]
    fn a_gain_within_the_noise_of_its_scenes_is_not_accepted_and_the_record_keeps_the_three_numbers() {
        let parent = scenes(&[(0.0, 1.0, true); 20]);
        // Three scenes gained and two lost are five coin tosses; three gained and none lost are not.
        let mut labels = [(0.0, 1.0, true); 20];
        (0..3).for_each(|scene| labels[scene].0 = 1.0);
        let sure = judged(&scenes(&labels), &parent, &[&parent]);
        assert!(sure.any() && sure.parent_tradeoff.holds);
        let mut noisy = parent.clone();
        (5..7).for_each(|scene| noisy.scenes[scene].attack = 1.0);
        let unsure = judged(&scenes(&labels), &noisy, &[&noisy]);
        let trade = &unsure.parent_tradeoff;
        assert!(!unsure.any(), "{unsure:?}");
        // Differences: three of 1, two of -1, fifteen of 0: mean 0.05, squared deviations 4.95, so the standard error is
        // sqrt(4.95 / (20 * 19)).
        assert!((trade.attack_change - 0.05).abs() < 1e-12);
        assert!((trade.attack_uncertainty.unwrap() - (4.95f64 / 380.0).sqrt()).abs() < 1e-12);
        assert_eq!(unsure.scenes, 20);
    }

    #[test]
    fn programs_are_compared_on_the_scenes_that_all_of_them_have() {
        let child = scenes(&[(1.0, 1.0, true); 4]);
        let mut parent = scenes(&[(0.0, 1.0, true); 8]);
        // Easy scenes that the child never met.
        (4..8).for_each(|scene| parent.scenes[scene].attack = 1.0);
        parent.scenes.remove(0);
        let found = judged(&child, &parent, &[&parent]);
        assert_eq!((found.scenes, found.parent_tradeoff.attack_change), (3, 1.0));
    }

    #[test]
    fn a_program_that_does_nothing_is_never_accepted_whatever_its_labels_say() {
        let parent = scenes(&[(0.0, 0.9, true); 20]);
        // The ego crashes by itself in most scenes, and nothing is more realistic than a record.
        let null = scenes(&[(1.0, 1.0, false); 20]);
        let found = judged(&null, &parent, &[&parent]);
        assert!(!found.coverage.holds && !found.any());
        assert_eq!(found.densification.hypervolume_gain, 0.0, "it adds no frontier area");
        let idle_parent = scenes(&[(0.0, 1.0, false); 20]);
        assert!(!judged(&null, &idle_parent, &[&idle_parent]).any(), "also beside a parent that does nothing");
    }

    #[test]
    fn a_program_that_acts_only_where_it_is_easy_falls_below_its_parents_coverage() {
        let parent = scenes(&[(0.0, 0.9, true); 20]);
        let mut labels = [(0.0, 1.0, false); 20];
        (0..6).for_each(|scene| labels[scene] = (1.0, 1.0, true));
        let found = judged(&scenes(&labels), &parent, &[&parent]);
        assert!(found.parent_tradeoff.holds, "by its numbers it is better");
        assert!((found.coverage.coverage, found.coverage.floor) == (0.3, 0.8) && !found.any());
        (6..16).for_each(|scene| labels[scene].2 = true);
        assert!(judged(&scenes(&labels), &parent, &[&parent]).any());
    }

    #[test]
    fn what_is_no_rate_never_reaches_a_gate() {
        for bad in [f64::NAN, f64::INFINITY, -0.1, 1.1] {
            for objectives in [Objectives { attack: bad, realism: 0.5 }, Objectives { attack: 0.5, realism: bad }] {
                let child = Score { objectives, ..alike([0.5; 2]) };
                let standing = Standing { child: &child, parent: &alike([0.5; 2]), front: &[] };
                assert!(consider(&standing, &options(), &MeanOverScenes::default()).is_err());
            }
        }
        let zero = admissible(Objectives { attack: -0.0, realism: 0.0 }).unwrap();
        assert!(zero.attack.is_sign_positive());
    }

    #[test]
    fn options_out_of_range_are_named() {
        let named = |bad: ArchiveOptions| bad.validate().unwrap_err().option;
        assert_eq!(named(ArchiveOptions { epsilon_pf: 0.0, ..options() }), "epsilon_pf");
        assert_eq!(named(ArchiveOptions { r0: f64::NAN, ..options() }), "r0");
        assert_eq!(named(ArchiveOptions { level: 1.0, ..options() }), "level");
        assert_eq!(named(ArchiveOptions { coverage_floor: 1.5, ..options() }), "coverage_floor");
        assert_eq!(options().validate(), Ok(()));
    }

    /// The gates of a child beside a parent that stands on the front, with these options.
    fn by(options: &ArchiveOptions, child: &Score, parent: &Score) -> AcceptanceGates {
        consider(&Standing { child, parent, front: &[parent] }, options, &MeanOverScenes::default()).unwrap()
    }

    #[test]
    fn who_acts_nowhere_or_has_its_parents_labels_is_accepted_where_that_is_not_asked_for() {
        let open = ArchiveOptions { level: 0.5, coverage_floor: 0.0, ..options() };
        let plain = MeanOverScenes { mean: RealismMean::Plain };
        let (idle, parent) = (scenes(&[(1.0, 1.0, false); 20]), scenes(&[(0.0, 0.9, true); 20]));
        let standing = Standing { child: &idle, parent: &parent, front: &[&parent] };
        let any = |requires: Required<AcceptanceRequirement>| {
            consider(&standing, &ArchiveOptions { requires, ..open.clone() }, &plain).unwrap().any()
        };
        assert!(!any(Required::default()) && !any(Required::only([AcceptanceRequirement::Acts])));
        assert!(
            any(Required::only([AcceptanceRequirement::Differs])),
            "by the plain mean it is the more realistic one"
        );
        let same = |requires| {
            let mut gates = by(&ArchiveOptions { requires, ..open.clone() }, &parent, &parent);
            // A gate that holds all the same, as one by other scenes may.
            gates.parent_tradeoff.holds = true;
            gates.any()
        };
        assert!(!same(Required::default()) && same(Required::only([AcceptanceRequirement::Acts])));
    }

    #[test]
    fn options_that_take_away_what_others_rest_on_are_refused_with_both_names() {
        let published = ArchiveOptions {
            level: 0.5,
            coverage_floor: 0.0,
            front: FrontOf::Evaluated,
            judged_on: JudgedOn::Window,
            ..options()
        };
        assert_eq!(published.validate(), Ok(()));
        let cases = [
            (ArchiveOptions { level: 0.8, ..published.clone() }, ["level", "front = \"evaluated\""]),
            (ArchiveOptions { coverage_floor: 0.1, ..published.clone() }, ["coverage_floor", "front = \"evaluated\""]),
            (
                ArchiveOptions { judged_on: JudgedOn::WindowThenAll, ..published.clone() },
                ["judged_on", "front = \"evaluated\""],
            ),
            (ArchiveOptions { race: Some(0.9), ..published.clone() }, ["race", "judged_on = \"window\""]),
        ];
        for (options, names) in cases {
            let said = options.validate().unwrap_err().to_string();
            assert!(names.iter().all(|name| said.contains(name)), "{said}");
        }
    }
}
