//! Promotion of programs that lead a lineage from one epoch to the next: accepted children (paper, section Lineage,
//! memory, and parallelization: "Accepted children update the active generator"). Another rule says which generator is
//! reported; it is applied once, at the end (`selector`).
//!
//! The paper names no rule for several accepted children. Three are offered, and the experiment file says which: the child
//! with the largest gain in hypervolume; the last one accepted; or two leaders, the ends of the front, whose slots alternate.

use serde::{Deserialize, Serialize};

use super::{plane::hypervolume, selector::Contender};
use crate::objects::SolutionId;

/// `[archive] promotion`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PromotionRule {
    /// Of the accepted children the one that adds most area to the front as the epoch found it. The parent stays where
    /// none adds any.
    LargestHypervolumeGain,
    /// Every accepted child in its turn, as the serial acceptor goes through the slots: the last one stays (paper, read literally).
    LastAccepted,
    /// An attack anchor for the even slots and a realism anchor for the odd ones: the ends of the front, the parents
    /// among the contenders.
    TwoAnchors,
}

/// Programs that lead a lineage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Leaders {
    /// Edited by every slot, or by the even ones where there is a second leader.
    pub active: SolutionId,
    /// Edited by the odd slots under the rule of two anchors. May be the same program.
    pub realism_anchor: Option<SolutionId>,
}

impl PromotionRule {
    /// The words of a file.
    pub const NAMES: [&str; 3] = ["largest_hypervolume_gain", "last_accepted", "two_anchors"];
}

impl Leaders {
    pub fn names(&self, solution: &SolutionId) -> bool {
        self.active == *solution || self.realism_anchor.as_ref() == Some(solution)
    }
}

/// Applies a rule. `front` is the front as the epoch found it, `parents` the programs that it edited, `accepted` its accepted
/// children in slot order, all measured on the same scenes. Whoever acts nowhere never leads where acting is asked for.
pub fn promote(
    rule: PromotionRule,
    front: &[Contender],
    parents: &[Contender],
    accepted: &[Contender],
    reference: [f64; 2],
    must_act: bool,
) -> Option<Leaders> {
    let acting = |of: &[Contender]| {
        of.iter().filter(|contender| contender.coverage > 0.0 || !must_act).cloned().collect::<Vec<_>>()
    };
    let (front, parents, accepted) = (acting(front), acting(parents), acting(accepted));
    match rule {
        PromotionRule::LargestHypervolumeGain => {
            largest_gain(&front, &parents, &accepted, reference).map(|active| Leaders { active, realism_anchor: None })
        }
        PromotionRule::LastAccepted => {
            accepted.last().map(|child| Leaders { active: child.solution.clone(), realism_anchor: None })
        }
        PromotionRule::TwoAnchors => anchors(parents.iter().chain(&front).chain(&accepted)),
    }
}

fn largest_gain(
    front: &[Contender],
    parents: &[Contender],
    accepted: &[Contender],
    reference: [f64; 2],
) -> Option<SolutionId> {
    let point = |contender: &Contender| [contender.objectives.attack, contender.objectives.realism];
    let before: Vec<[f64; 2]> = front.iter().chain(parents).map(point).collect();
    let area = hypervolume(&before, reference);
    let gain = |child: &Contender| hypervolume(&[before.as_slice(), &[point(child)]].concat(), reference) - area;
    let gains = accepted.iter().map(|child| (child, gain(child))).filter(|(_, gain)| *gain > 0.0);
    let best = gains.reduce(|best, next| if next.1 > best.1 { next } else { best });
    best.map(|(child, _)| child.solution.clone())
}

/// The largest attack and the largest realism; of equals the one with more of the other, then the earlier one.
fn anchors<'c>(contenders: impl Iterator<Item = &'c Contender> + Clone) -> Option<Leaders> {
    let ahead = |a: [f64; 2], b: [f64; 2]| a[0] > b[0] || (a[0] == b[0] && a[1] > b[1]);
    let by_attack = |best: &'c Contender, next: &'c Contender| {
        let key = |c: &Contender| [c.objectives.attack, c.objectives.realism];
        if ahead(key(next), key(best)) { next } else { best }
    };
    let by_realism = |best: &'c Contender, next: &'c Contender| {
        let key = |c: &Contender| [c.objectives.realism, c.objectives.attack];
        if ahead(key(next), key(best)) { next } else { best }
    };
    let active = contenders.clone().reduce(by_attack)?.solution.clone();
    let realism = contenders.reduce(by_realism)?.solution.clone();
    Some(Leaders { active, realism_anchor: Some(realism) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::Objectives;

    fn contenders(points: &[(&str, [f64; 2])]) -> Vec<Contender> {
        let one = |(name, [attack, realism]): &(&str, [f64; 2])| Contender {
            solution: SolutionId::new(*name),
            objectives: Objectives { attack: *attack, realism: *realism },
            coverage: 1.0,
        };
        points.iter().map(one).collect()
    }

    fn leaders(
        rule: PromotionRule,
        parent: [f64; 2],
        accepted: &[(&str, [f64; 2])],
    ) -> Option<(String, Option<String>)> {
        let parents = contenders(&[("parent", parent)]);
        let found = promote(rule, &parents, &parents, &contenders(accepted), [0.0; 2], true)?;
        Some((found.active.0, found.realism_anchor.map(|anchor| anchor.0)))
    }

    #[test]
    fn the_last_accepted_child_leads_whatever_area_it_adds() {
        let children = [("best", [0.9, 0.95]), ("last", [0.1, 0.1])];
        let found = leaders(PromotionRule::LastAccepted, [0.80, 0.875], &children);
        assert_eq!(found, Some(("last".into(), None)));
        assert_eq!(leaders(PromotionRule::LastAccepted, [0.80, 0.875], &[]), None, "the parent stays");
    }

    /// The case of king-idm, epoch 0: the reporting rule (R >= 0.95) took e0s17 and threw the attack away.
    #[test]
    fn a_child_that_dominates_its_parent_leads_before_one_that_gave_its_attack_away() {
        let children = [("e0s9", [0.80, 0.922]), ("e0s17", [0.30, 0.984])];
        let found = leaders(PromotionRule::LargestHypervolumeGain, [0.80, 0.875], &children);
        assert_eq!(found, Some(("e0s9".into(), None)));
        let turned = [children[1], children[0], ("copy", children[0].1)];
        let found = leaders(PromotionRule::LargestHypervolumeGain, [0.80, 0.875], &turned);
        assert_eq!(found, Some(("e0s9".into(), None)), "the first of equals, wherever it stands");
    }

    #[test]
    fn the_parent_leads_on_where_no_accepted_child_adds_area() {
        let rule = PromotionRule::LargestHypervolumeGain;
        assert_eq!(leaders(rule, [0.5, 0.9], &[("dominated", [0.49, 0.9]), ("copy", [0.5, 0.9])]), None);
        assert_eq!(leaders(rule, [0.5, 0.9], &[]), None);
    }

    #[test]
    fn two_anchors_are_the_ends_of_the_front_and_may_be_one_program() {
        let rule = PromotionRule::TwoAnchors;
        let found =
            leaders(rule, [0.5, 0.9], &[("strong", [0.8, 0.7]), ("mild", [0.2, 0.99]), ("middle", [0.6, 0.85])]);
        assert_eq!(found, Some(("strong".into(), Some("mild".into()))));
        assert_eq!(
            leaders(rule, [0.5, 0.9], &[("better", [0.6, 0.95])]),
            Some(("better".into(), Some("better".into())))
        );
        assert_eq!(leaders(rule, [0.5, 0.9], &[]), Some(("parent".into(), Some("parent".into()))));
    }

    #[test]
    fn of_equal_anchors_the_one_with_more_of_the_other_leads_and_then_the_earlier_one() {
        let children = [
            ("plain", [0.8, 0.7]),
            ("finer", [0.8, 0.9]),
            ("copy", [0.8, 0.9]),
            ("mild", [0.1, 0.99]),
            ("milder", [0.2, 0.99]),
        ];
        let found = leaders(PromotionRule::TwoAnchors, [0.5, 0.9], &children);
        assert_eq!(found, Some(("finer".into(), Some("milder".into()))));
    }

    #[test]
    fn a_program_that_does_nothing_never_leads() {
        for rule in [PromotionRule::LargestHypervolumeGain, PromotionRule::LastAccepted, PromotionRule::TwoAnchors] {
            let parents = contenders(&[("parent", [0.5, 0.9])]);
            let mut null = contenders(&[("null", [0.6, 1.0])]);
            null[0].coverage = 0.0;
            let led = promote(rule, &parents, &parents, &null, [0.0; 2], true);
            assert!(
                led.is_none_or(
                    |led| led.active.as_str() == "parent" && led.realism_anchor.is_none_or(|a| a == led.active)
                ),
                "{rule:?}"
            );
            let led = promote(rule, &parents, &parents, &null, [0.0; 2], false).unwrap();
            assert_eq!(led.active.as_str(), "null", "{rule:?}, where acting is not asked for");
        }
    }
}
