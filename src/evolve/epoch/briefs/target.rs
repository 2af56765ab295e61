//! Targets of slots: attack, realism and the front take turns, in words that fit the parent, each time with another place
//! to look at first.

use super::aims::{Needs, Seen};
use crate::agents::{ParentOutcome, Target, TargetKind};
use crate::objects::Objectives;

/// Inputs of a target.
#[derive(Clone, Copy)]
pub struct Aims<'a> {
    /// The parent's labels on the window.
    pub parent: &'a ParentOutcome,
    /// Findings on the parent from the window, where questions are detailed: the instruction follows them.
    pub seen: Option<&'a Seen>,
    /// True if the parent is the child of an accepted patch.
    pub inherits: bool,
    /// The front, as measured on all scenes so far.
    pub front: &'a [Objectives],
    /// Least realism of a program that is reported, 1.
    pub realism_min: f64,
    /// Realism and attack that a child may lose for more of the other, 1.
    pub epsilon_r: f64,
    pub epsilon_a: f64,
}

impl Aims<'_> {
    fn meet(&self, needs: Needs) -> bool {
        match needs {
            Needs::Nothing => true,
            Needs::OtherMembers => self.front.len() > 1,
            Needs::InheritedEdits => self.inherits,
        }
    }
}

/// Realism from which there is nothing left to raise.
const PERFECT: f64 = 0.999;

const ATTACK: [&str; 6] = [
    "Look at who is chosen: rank or guard the adversaries by what the missed scenes have in common.",
    "Look at when it begins: in missed scenes the change may come too late or too early.",
    "Look at which candidate wins: score what makes a contact that counts, not any contact.",
    "Look at one cluster or tag with few attacks: a rule for these scenes alone.",
    "Look at contacts that do not count (anyway, unavoidable, unmoved): make them of another class or with somebody else.",
    "Look at how many adversaries act, and at another operator kind in a slot that was not changed yet.",
];
const REALISM: [&str; 5] = [
    "Look at the weakest diagnostic: refuse or devalue the candidates that break it.",
    "Look at the rows with the lowest diagnostics: a rule for what these scenes have in common.",
    "Look at bounds and limits: tighten the one that costs the least attack.",
    "Look at who is chosen: an adversary from where the contact needs no violent motion.",
    "Look at timing: an earlier or longer change needs less acceleration.",
];
const PORTFOLIO: [(Needs, &str); 6] = [
    (Needs::OtherMembers, "Take the mechanism of another member of the front and add it to the parent."),
    (Needs::Nothing, "Use a mechanism slot, an operator kind or a scene feature that no past edit used."),
    (
        Needs::Nothing,
        "Use a slot of the contract that the parent leaves empty, such as a law, or a fallback between two ways.",
    ),
    (Needs::Nothing, "Split the scenes: one behaviour where the parent attacks, another one where it does not."),
    (Needs::Nothing, "Trade: give up attack where a diagnostic is low, and seek it where realism is high."),
    (
        Needs::InheritedEdits,
        "Undo an inherited edit that costs more than it brings, and put a simpler one in its place.",
    ),
];

/// The target of a slot. `epoch` turns the list of instructions, so that an idea comes back only when all were asked for.
pub fn target(aims: &Aims<'_>, epoch: u32, slot: u32, slots: u32) -> Target {
    let target = whatever_was_seen(aims, epoch, slot, slots);
    let Some(seen) = aims.seen else { return target };
    let turn = (epoch * slots.div_ceil(3) + slot / 3) as usize;
    let own = seen.instructions(target.kind, |needs| aims.meet(needs));
    // The second slot for attack of a parent that is perfectly realistic looks elsewhere than the first.
    let ahead = if slot % 3 == 1 && target.kind == TargetKind::RaiseAttack { own.len() / 2 } else { 0 };
    let instruction = own.get((turn + ahead) % own.len().max(1)).cloned();
    Target { instruction: instruction.unwrap_or(target.instruction), ..target }
}

fn whatever_was_seen(aims: &Aims<'_>, epoch: u32, slot: u32, slots: u32) -> Target {
    let turn = (epoch * slots.div_ceil(3) + slot / 3) as usize;
    let chosen = |of: &[&str]| of[turn % of.len()].to_string();
    let Objectives { attack, realism } = aims.parent.objectives;
    match slot % 3 {
        1 if realism < PERFECT => {
            Target { kind: TargetKind::RaiseRealism, text: raise_realism(aims), instruction: chosen(&REALISM) }
        }
        2 => Target {
            kind: TargetKind::Diversify,
            text: widen(aims.front),
            instruction: chosen(
                &PORTFOLIO.iter().filter(|(needs, _)| aims.meet(*needs)).map(|of| of.1).collect::<Vec<_>>(),
            ),
        },
        // A parent whose realism cannot be raised has a second slot for attack, with another instruction.
        kind => Target {
            kind: TargetKind::RaiseAttack,
            text: if realism >= aims.realism_min {
                format!(
                    "Raise attack above {attack:.3} while realism, now {realism:.3}, stays at or above {:.3}.",
                    aims.realism_min
                )
            } else {
                format!(
                    "Raise attack above {attack:.3} while realism falls by no more than {:.3} from {realism:.3}.",
                    aims.epsilon_r
                )
            },
            instruction: ATTACK[(turn + kind as usize * ATTACK.len() / 2) % ATTACK.len()].into(),
        },
    }
}

fn raise_realism(aims: &Aims<'_>) -> String {
    let Objectives { attack, realism } = aims.parent.objectives;
    let weakest = aims.parent.weakest_diagnostic().and_then(|name| Some((name, aims.parent.diagnostics.get(name)?)));
    let weakest = weakest.map(|(name, value)| format!(" (weakest: {name} at {value:.3})")).unwrap_or_default();
    let least = (attack - aims.epsilon_a).max(0.0);
    let toward = if realism < aims.realism_min { format!(" toward {:.3}", aims.realism_min) } else { String::new() };
    format!(
        "Raise realism above {realism:.3}{toward}{weakest} while attack, now {attack:.3}, stays at or above {least:.3}."
    )
}

/// The widest gap between neighbours of the front, or its ends where there are no two.
fn widen(front: &[Objectives]) -> String {
    let mut points: Vec<Objectives> = front.to_vec();
    points.sort_by(|a, b| a.attack.total_cmp(&b.attack).then(b.realism.total_cmp(&a.realism)));
    let area = |pair: &[Objectives]| (pair[1].attack - pair[0].attack) * (pair[0].realism - pair[1].realism);
    let first_widest = |best: &[Objectives], next: &[Objectives]| area(next) > area(best);
    let mut widest: Option<&[Objectives]> = None;
    for pair in points.windows(2) {
        if widest.is_none_or(|best| first_widest(best, pair)) {
            widest = Some(pair);
        }
    }
    match (widest, points.first()) {
        (Some([low, high]), _) => format!(
            "Fill the widest gap of the front: more attack than {:.3} at more realism than {:.3}, between its members at \
             ({:.3}, {:.3}) and ({:.3}, {:.3}) (attack, realism).",
            low.attack, high.realism, low.attack, low.realism, high.attack, high.realism
        ),
        (_, Some(only)) => format!(
            "The front has one member, at attack {:.3} and realism {:.3}: reach a trade-off that it does not dominate, by a mechanism \
             that was not tried.",
            only.attack, only.realism
        ),
        _ => "Reach any trade-off: nothing is on the front yet.".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::{BTreeMap, BTreeSet};

    fn parent(attack: f64, realism: f64) -> ParentOutcome {
        let diagnostics = BTreeMap::from([("bounded_jerk".into(), 0.61), ("map_validity".into(), 0.99)]);
        let objectives = Objectives { attack, realism };
        ParentOutcome { objectives, scenes: 20, failures: 0, coverage: 1.0, diagnostics, near_misses: None }
    }

    fn of(parent: &ParentOutcome, front: &[Objectives], epoch: u32, slot: u32) -> Target {
        let aims = Aims {
            parent,
            seen: None,
            inherits: front.len() > 1,
            front,
            realism_min: 0.95,
            epsilon_r: 0.01,
            epsilon_a: 0.02,
        };
        target(&aims, epoch, slot, 6)
    }

    #[test]
    fn no_parent_is_asked_to_keep_a_realism_that_it_does_not_have() {
        let weak = of(&parent(0.3, 0.7), &[], 0, 0).text;
        assert!(!weak.contains("0.950") && weak.contains("0.300") && weak.contains("0.700"), "{weak}");
        assert!(of(&parent(0.3, 0.96), &[], 0, 0).text.contains("at or above 0.950"));
        let realism = of(&parent(0.3, 0.7), &[], 0, 1).text;
        assert!(realism.contains("toward 0.950") && realism.contains("bounded_jerk at 0.610"), "{realism}");
        assert!(realism.contains("at or above 0.280"), "{realism}");
        assert_eq!(of(&parent(0.3, 1.0), &[], 0, 1).kind, TargetKind::RaiseAttack, "there is nothing to raise");
    }

    #[test]
    fn the_slots_of_an_epoch_and_of_the_next_one_differ() {
        let parent = parent(0.3, 0.7);
        let asked = |epoch| (0..6).map(move |slot| (slot, epoch));
        let all: BTreeSet<(TargetKind, String)> = asked(0)
            .chain(asked(1))
            .map(|(slot, epoch)| {
                let target = of(&parent, &[], epoch, slot);
                (target.kind, target.instruction)
            })
            .collect();
        assert_eq!(all.len(), 12, "{all:?}");
        let perfect = super::tests::parent(0.3, 1.0);
        assert_ne!(of(&perfect, &[], 0, 0).instruction, of(&perfect, &[], 0, 1).instruction);
    }

    /// The first epoch has one program and nothing inherited; later ones come round to every instruction.
    #[test]
    fn nobody_is_asked_for_what_there_is_not_yet() {
        let parent = parent(0.3, 0.7);
        let chosen = |front: &[Objectives]| -> BTreeSet<String> {
            (0..20).flat_map(|epoch| [2, 5].map(|slot| of(&parent, front, epoch, slot).instruction)).collect()
        };
        let point = |attack, realism| Objectives { attack, realism };
        let first = chosen(&[point(0.3, 0.7)]);
        assert!(
            first.len() == 4
                && first.iter().all(|chosen| !chosen.contains("another member") && !chosen.contains("Undo")),
            "{first:?}"
        );
        assert_eq!(chosen(&[point(0.3, 0.7), point(0.2, 0.9)]).len(), PORTFOLIO.len());
    }

    #[test]
    fn the_gap_is_the_widest_one_of_the_front() {
        let point = |attack, realism| Objectives { attack, realism };
        let front = [point(0.8, 0.5), point(0.2, 0.95), point(0.3, 0.9)];
        let text = of(&parent(0.3, 0.9), &front, 0, 2).text;
        assert!(text.contains("more attack than 0.300 at more realism than 0.500"), "{text}");
    }
}
