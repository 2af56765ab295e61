//! The time line of a contact in words: the time before it at which the threat was seen, the driver's reaction, the last moment at which
//! each manoeuvre would have helped. Times in words count back from the contact.

use super::{Chance, ContactClass, Manoeuvre, Reacted, Side, Timeline};
use crate::kernel::num;

/// Describes the manner of a contact, and the side from which the other came.
pub fn manner(class: ContactClass, timeline: Option<&Timeline>) -> String {
    let side = match timeline.map(|of| of.from) {
        Some(Side::Left) => " from the left",
        Some(Side::Right) => " from the right",
        Some(Side::Front | Side::Rear) | None => "",
    };
    match class {
        ContactClass::EgoStrikes => "ran into somebody ahead".into(),
        ContactClass::EgoSideswipes => format!("brushed somebody{}", side.replace("from", "on")),
        ContactClass::StationaryHit => "ran into somebody who stands".into(),
        ContactClass::CutIn => format!("cut-in{side}"),
        ContactClass::Crossing => format!("crossing{side}"),
        ContactClass::HeadOn => "head on".into(),
        ContactClass::Sideswipe => format!("sideswiped{side}"),
        ContactClass::RearEndEgoStruck => "rammed from behind".into(),
    }
}

/// The manner of a contact by the class that a file names; of none that there is none.
pub fn class_in_words(name: &str) -> String {
    let class = ContactClass::ALL.into_iter().find(|class| class.name() == name);
    class.map_or_else(|| "no contact".into(), |class| manner(class, None))
}

/// Describes the driver's response in the light of the manoeuvres that would have helped.
pub fn response(timeline: &Timeline) -> &'static str {
    let until = |by: Manoeuvre| timeline.chances.iter().find(|chance| chance.by == by).and_then(|chance| chance.last_s);
    let helps_after = |last_s: Option<f64>, at_s: f64| last_s.is_some_and(|last_s| at_s <= last_s + 1e-9);
    let any_s = timeline.last_chance().and_then(|chance| chance.last_s);
    match timeline.reaction {
        None if any_s.is_none() => "no reaction, and nothing would have helped",
        None => "no reaction",
        Some(_) if any_s.is_none() => "reacted, and nothing would have helped",
        Some(of) if of.by != Reacted::Braked && helps_after(any_s, of.at_s) => {
            let (swerve, with_brakes) = match of.by {
                Reacted::SteeredLeft => (Manoeuvre::SwerveLeft, Manoeuvre::BrakeLeft),
                Reacted::SteeredRight | Reacted::Braked => (Manoeuvre::SwerveRight, Manoeuvre::BrakeRight),
            };
            let helps = |by: Manoeuvre| helps_after(until(by), of.at_s);
            if helps(swerve) {
                "steered in time, and not enough"
            } else if helps(Manoeuvre::Brake) || helps(with_brakes) {
                "steered where only braking helped"
            } else {
                "steered to the side that did not help"
            }
        }
        Some(of) => match (of.by, helps_after(any_s, of.at_s)) {
            (Reacted::Braked, _) if helps_after(until(Manoeuvre::Brake), of.at_s) => "braked in time, and too little",
            (Reacted::Braked, true) => "braked when only a swerve still helped",
            (Reacted::Braked, false) => "braked too late",
            (Reacted::SteeredLeft | Reacted::SteeredRight, _) => "steered too late",
        },
    }
}

/// The whole time line in a sentence or two.
pub fn sentences(timeline: &Timeline) -> String {
    let before = |at_s: f64| num::fixed((timeline.contact_s - at_s).max(0.0), 1);
    let seen = match timeline.visible_s {
        Some(at_s) => format!("seen {} s before the contact", before(at_s)),
        None => "never seen before the contact".to_string(),
    };
    let did = timeline.reaction.map_or(String::new(), |of| {
        let did = match of.by {
            Reacted::Braked => format!("braked (at most {} m/s²)", num::fixed(timeline.braked_mps2_max, 1)),
            Reacted::SteeredLeft => "steered left".to_string(),
            Reacted::SteeredRight => "steered right".to_string(),
        };
        format!(", {did} from {} s before on", before(of.at_s))
    });
    format!("{seen}{did}: {}; {}", response(timeline), chances(timeline, &before))
}

/// Until when which manoeuvre would have helped.
fn chances(timeline: &Timeline, before: &dyn Fn(f64) -> String) -> String {
    let Some(best) = timeline.last_chance() else {
        return "no braking or swerving of the last four seconds avoids it".into();
    };
    let mut others: Vec<Chance> =
        timeline.chances.iter().copied().filter(|of| of.by != best.by && of.last_s.is_some()).collect();
    others.sort_by(|a, b| b.last_s.unwrap_or(0.0).total_cmp(&a.last_s.unwrap_or(0.0)));
    let said = |chance: &Chance| Some(format!("{} until {} s before", chance.by.in_words(), before(chance.last_s?)));
    let last = said(&best).unwrap_or_default();
    let others: Vec<String> = others.iter().filter_map(said).collect();
    let none: Vec<&str> = timeline.chances.iter().filter(|of| of.last_s.is_none()).map(|of| of.by.in_words()).collect();
    let others = if others.is_empty() { String::new() } else { format!(", {}", others.join(", ")) };
    let none = if none.is_empty() { String::new() } else { format!("; never by {}", none.join(", ")) };
    format!("avoided by {last} (the last chance){others}{none}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::Reaction;

    fn timeline(reaction: Option<(f64, Reacted)>, last: [Option<f64>; 5]) -> Timeline {
        let chances = Manoeuvre::ALL.into_iter().zip(last).map(|(by, last_s)| Chance { by, last_s }).collect();
        Timeline {
            contact_s: 6.0,
            visible_s: Some(3.9),
            reaction: reaction.map(|(at_s, by)| Reaction { at_s, by }),
            braked_mps2_max: 4.27,
            from: Side::Right,
            chances,
        }
    }

    #[test]
    fn a_response_is_judged_by_the_last_moment_of_its_own_manoeuvre_and_of_any() {
        let last = [Some(4.5), Some(5.0), None, Some(5.4), None];
        let of = |at_s, by| response(&timeline(Some((at_s, by)), last));
        assert_eq!(response(&timeline(None, last)), "no reaction");
        assert_eq!(of(4.5, Reacted::Braked), "braked in time, and too little");
        assert_eq!(of(4.6, Reacted::Braked), "braked when only a swerve still helped");
        assert_eq!(of(5.5, Reacted::Braked), "braked too late");
        assert_eq!(of(5.4, Reacted::SteeredLeft), "steered in time, and not enough");
        assert_eq!(of(4.5, Reacted::SteeredRight), "steered where only braking helped");
        assert_eq!(of(4.6, Reacted::SteeredRight), "steered to the side that did not help");
        assert_eq!(of(5.5, Reacted::SteeredRight), "steered too late");
        assert_eq!(
            response(&timeline(Some((4.0, Reacted::Braked)), [None; 5])),
            "reacted, and nothing would have helped"
        );
    }

    #[test]
    fn words_count_back_from_the_contact_and_name_the_last_chance_first() {
        let last = [Some(4.5), Some(5.0), None, Some(5.4), None];
        assert_eq!(
            sentences(&timeline(Some((5.5, Reacted::Braked)), last)),
            "seen 2.1 s before the contact, braked (at most 4.3 m/s²) from 0.5 s before on: braked too late; avoided by swerving left until 0.6 s \
             before (the last chance), braking and swerving left until 1.0 s before, braking until 1.5 s before; never by braking and swerving \
             right, swerving right"
        );
        let never = Timeline { visible_s: None, ..timeline(None, [None; 5]) };
        assert_eq!(
            sentences(&never),
            "never seen before the contact: no reaction, and nothing would have helped; no braking or swerving of the last four seconds avoids it"
        );
        assert_eq!(manner(ContactClass::Crossing, Some(&never)), "crossing from the right");
        assert_eq!(manner(ContactClass::EgoSideswipes, Some(&never)), "brushed somebody on the right");
        assert_eq!(manner(ContactClass::CutIn, None), "cut-in");
        assert_eq!((class_in_words("head_on"), class_in_words("none")), ("head on".into(), "no contact".into()));
    }
}
