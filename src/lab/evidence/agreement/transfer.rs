//! Transfer of evolution's gains from one simulator to the other: evolved programs beside the parents of their families,
//! in the same scenes.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use serde::Serialize;

use super::interval::{Interval, RESAMPLES, middle};
use super::pair::{Pair, Side};
use crate::kernel::Seed;

/// An evolved program and the parent of its family, by the names that pairs have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Descent {
    pub evolved: String,
    pub parent: String,
}

/// Gains of an evolved program over its parent in either simulator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Transfer {
    /// Name of the evolved program; `all` for every one of them together.
    pub evolved: String,
    /// Name of its parent; `None` for all.
    pub parent: Option<String>,
    /// Scenes in which both were played in both simulators, counted once a program.
    pub rollouts: usize,
    /// Contact, published attack, preventable attack, in this order.
    pub gains: Vec<Gain>,
}

/// Labels that are counted: contact, and those that a search maximises.
pub const LABELS: [&str; 3] = ["contact", "published attack", "preventable attack"];

/// One label in the first and in the second simulator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Gain {
    pub label: &'static str,
    pub first: Difference,
    pub second: Difference,
}

/// Scenes in which a label holds, and what the evolved program has more of, as a share of the rollouts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Difference {
    pub parent: usize,
    pub evolved: usize,
    /// Gain with the middle 95 % of draws of scenes.
    pub gain: Interval,
}

/// Numbers of the differences not zero in the first simulator that have the same sign in the second, none there, and the
/// other sign.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Signs {
    pub same: usize,
    pub none: usize,
    pub other: usize,
}

/// Signs of a label over programs, `all` left out.
pub fn signs(transfers: &[Transfer], label: usize) -> Signs {
    let more = |difference: &Difference| difference.evolved.cmp(&difference.parent);
    let mut signs = Signs::default();
    let single = transfers.iter().filter(|transfer| transfer.parent.is_some());
    for gain in single.filter_map(|transfer| transfer.gains.get(label)) {
        match (more(&gain.first), more(&gain.second)) {
            (Ordering::Equal, _) => {}
            (_, Ordering::Equal) => signs.none += 1,
            (first, second) if first == second => signs.same += 1,
            _ => signs.other += 1,
        }
    }
    signs
}

/// All labels in the first simulator, then all in the second: true where the label holds.
type Held = [bool; 2 * LABELS.len()];

fn held(pair: &Pair) -> Held {
    let of = |side: &Side| [side.contact.is_some(), side.published, side.preventable];
    let ([a, b, c], [d, e, f]) = (of(&pair.a), of(&pair.b));
    [a, b, c, d, e, f]
}

/// A parent's rollout and its descendant's in one scene.
type Both = (String, Held, Held);

/// A row for each descent of which both programs were played somewhere, then one for all.
pub fn transfers(pairs: &[Pair], descents: &[Descent]) -> Vec<Transfer> {
    let of = |program: &str| -> BTreeMap<&str, Held> {
        let own = pairs.iter().filter(|pair| pair.program == program && !pair.proposed);
        own.map(|pair| (pair.scene.as_str(), held(pair))).collect()
    };
    let both = |descent: &Descent| -> Vec<Both> {
        let parents = of(&descent.parent);
        let beside = |(scene, evolved): (&str, Held)| Some((scene.to_string(), *parents.get(scene)?, evolved));
        of(&descent.evolved).into_iter().filter_map(beside).collect()
    };
    let each: Vec<(&Descent, Vec<Both>)> = descents.iter().map(|descent| (descent, both(descent))).collect();
    let each: Vec<(&Descent, Vec<Both>)> = each.into_iter().filter(|(_, both)| !both.is_empty()).collect();
    let mut rows: Vec<Transfer> =
        each.iter().map(|(of, both)| transfer(&of.evolved, Some(of.parent.clone()), both)).collect();
    if rows.len() > 1 {
        let all: Vec<Both> = each.into_iter().flat_map(|(_, both)| both).collect();
        rows.push(transfer("all", None, &all));
    }
    rows
}

fn transfer(evolved: &str, parent: Option<String>, both: &[Both]) -> Transfer {
    // Rollouts of one scene are drawn together: they resemble each other.
    let mut scenes: BTreeMap<&str, Vec<&Both>> = BTreeMap::new();
    both.iter().for_each(|one| scenes.entry(one.0.as_str()).or_default().push(one));
    let scenes: Vec<Vec<&Both>> = scenes.into_values().collect();
    let mut stream = Seed(1).stream(&["agreement", "transfer", evolved]);
    let draws: Vec<Vec<usize>> =
        (0..RESAMPLES).map(|_| (0..scenes.len()).map(|_| stream.below(scenes.len())).collect()).collect();
    let difference = |label: usize| -> Difference {
        let count = |of: &dyn Fn(&Both) -> bool| both.iter().filter(|one| of(one)).count();
        let gain = |drawn: &mut dyn Iterator<Item = &Vec<&Both>>| {
            let (mut more, mut n) = (0.0, 0.0);
            for (_, parent, evolved) in drawn.flatten() {
                more += f64::from(u8::from(evolved[label])) - f64::from(u8::from(parent[label]));
                n += 1.0;
            }
            more / f64::max(n, 1.0)
        };
        let drawn = draws.iter().map(|draw| gain(&mut draw.iter().map(|&scene| &scenes[scene]))).collect();
        Difference {
            parent: count(&|(_, parent, _)| parent[label]),
            evolved: count(&|(_, _, evolved)| evolved[label]),
            gain: middle(gain(&mut scenes.iter()), drawn),
        }
    };
    let gain = |(place, label): (usize, &&'static str)| {
        let (first, second) = (difference(place), difference(LABELS.len() + place));
        Gain { label, first, second }
    };
    let gains = LABELS.iter().enumerate().map(gain).collect();
    Transfer { evolved: evolved.to_string(), parent, rollouts: both.len(), gains }
}
