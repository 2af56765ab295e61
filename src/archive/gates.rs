//! The three acceptance gates (paper, section Simulator Evaluation and Pareto Archive) with every number they compare.

use serde::{Deserialize, Serialize};

use super::{
    front::Archive,
    objectives::{ObjectivesError, admissible},
    plane::{hypervolume, point},
};
use crate::objects::{AcceptanceGates, Densification, LocalPush, Objectives, ParentTradeoff};

/// What the gates and the frontier statistics compare with. Comes from the experiment file.
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
        let check = |option, value: f64, ok: bool, expected| match ok {
            true => Ok(()),
            false => Err(OptionsError { option, value, expected }),
        };
        let [x, y] = self.reference;
        check("reference", x, (0.0..1.0).contains(&x), "a pair of numbers in [0, 1)")?;
        check("reference", y, (0.0..1.0).contains(&y), "a pair of numbers in [0, 1)")?;
        for (name, value) in
            [("r0", self.r0), ("a0", self.a0), ("epsilon_r", self.epsilon_r), ("epsilon_a", self.epsilon_a)]
        {
            check(name, value, (0.0..=1.0).contains(&value), "a number in [0, 1]")?;
        }
        let positive = self.epsilon_pf > 0.0 && self.epsilon_pf <= 1.0;
        check("epsilon_pf", self.epsilon_pf, positive, "a number in (0, 1]")
    }
}

/// What the three gates say of a candidate against the archive as it stands and its parent. Changes nothing.
pub fn consider(
    archive: &Archive,
    objectives: Objectives,
    parent: Objectives,
    options: &ArchiveOptions,
) -> Result<AcceptanceGates, ObjectivesError> {
    let (child, parent) = (admissible(objectives)?, admissible(parent)?);
    let densification = densification(archive, &child, options.reference);
    let local_push = local_push(archive, &child, densification.holds, options);
    Ok(AcceptanceGates { densification, local_push, parent_tradeoff: parent_tradeoff(&child, &parent, options) })
}

/// ΔHV(c) = HV(P ∪ {c}) - HV(P) > 0 for a non-dominated c. A copy of a front point is not dominated, and gains 0.
fn densification(archive: &Archive, child: &Objectives, reference: [f64; 2]) -> Densification {
    let mut points: Vec<[f64; 2]> = archive.front().map(|entry| point(&entry.objectives)).collect();
    let non_dominated = !archive.front().any(|entry| entry.objectives.dominates(child));
    let hypervolume_before = hypervolume(&points, reference);
    points.push(point(child));
    let hypervolume_gain = hypervolume(&points, reference) - hypervolume_before;
    Densification {
        holds: non_dominated && hypervolume_gain > 0.0,
        non_dominated,
        hypervolume_before,
        hypervolume_gain,
    }
}

/// More attack than anyone where realism is high, or more realism than anyone where attack is high. The candidate
/// must lie in the region itself; where the region holds nobody yet, densification decides for it.
fn local_push(archive: &Archive, child: &Objectives, densifies: bool, options: &ArchiveOptions) -> LocalPush {
    let front = || archive.front().map(|entry| entry.objectives);
    let best_attack_at_r0 = front().filter(|o| o.realism >= options.r0).map(|o| o.attack).reduce(f64::max);
    let best_realism_at_a0 = front().filter(|o| o.attack >= options.a0).map(|o| o.realism).reduce(f64::max);
    let attack_push = child.realism >= options.r0 && best_attack_at_r0.map_or(densifies, |best| child.attack > best);
    let realism_push = child.attack >= options.a0 && best_realism_at_a0.map_or(densifies, |best| child.realism > best);
    LocalPush { holds: attack_push || realism_push, best_attack_at_r0, best_realism_at_a0 }
}

/// Better than the parent in one objective while the other falls by no more than its ε.
fn parent_tradeoff(child: &Objectives, parent: &Objectives, options: &ArchiveOptions) -> ParentTradeoff {
    let more_attack = child.attack > parent.attack && child.realism >= parent.realism - options.epsilon_r;
    let more_realism = child.realism > parent.realism && child.attack >= parent.attack - options.epsilon_a;
    ParentTradeoff {
        holds: more_attack || more_realism,
        attack_change: child.attack - parent.attack,
        realism_change: child.realism - parent.realism,
    }
}

#[cfg(test)]
mod tests {
    use super::super::front::samples::{archive_of, objectives};
    use super::*;

    fn options() -> ArchiveOptions {
        ArchiveOptions { reference: [0.0; 2], r0: 0.9, a0: 0.6, epsilon_r: 0.02, epsilon_a: 0.05, epsilon_pf: 1e-9 }
    }

    fn gates(front: &[[f64; 2]], child: [f64; 2], parent: [f64; 2]) -> AcceptanceGates {
        consider(&archive_of(front), objectives(child), objectives(parent), &options()).unwrap()
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
        assert_eq!(found.densification.hypervolume_gain, 0.0);
        assert!(!found.any());
    }

    #[test]
    fn a_new_point_on_the_border_of_the_reference_gains_nothing() {
        let found = gates(&[[0.2, 0.9]], [0.9, 0.0], [0.2, 0.9]).densification;
        assert!(found.non_dominated && !found.holds);
    }

    #[test]
    fn a_push_needs_more_than_the_best_of_its_region() {
        let front = [[0.3, 0.95], [0.7, 0.5]];
        let push = gates(&front, [0.31, 0.92], [0.3, 0.95]).local_push;
        assert!(push.holds);
        assert_eq!((push.best_attack_at_r0, push.best_realism_at_a0), (Some(0.3), Some(0.5)));
        assert!(!gates(&front, [0.3, 0.96], [0.3, 0.95]).local_push.holds, "equal attack is no push");
        assert!(gates(&front, [0.6, 0.51], [0.3, 0.95]).local_push.holds);
        assert!(!gates(&front, [0.59, 0.89], [0.3, 0.95]).local_push.holds, "outside both regions");
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
    fn what_is_no_rate_never_reaches_a_gate() {
        for bad in [f64::NAN, f64::INFINITY, -0.1, 1.1] {
            let child = Objectives { attack: bad, realism: 0.5 };
            assert!(consider(&Archive::default(), child, objectives([0.5; 2]), &options()).is_err());
            let child = Objectives { attack: 0.5, realism: bad };
            assert!(consider(&Archive::default(), child, objectives([0.5; 2]), &options()).is_err());
        }
        let zero = admissible(Objectives { attack: -0.0, realism: 0.0 }).unwrap();
        assert!(zero.attack.is_sign_positive());
    }

    #[test]
    fn options_out_of_range_are_named() {
        let bad = ArchiveOptions { epsilon_pf: 0.0, ..options() };
        assert_eq!(bad.validate().unwrap_err().option, "epsilon_pf");
        let bad = ArchiveOptions { r0: f64::NAN, ..options() };
        assert_eq!(bad.validate().unwrap_err().option, "r0");
        assert_eq!(options().validate(), Ok(()));
    }
}
