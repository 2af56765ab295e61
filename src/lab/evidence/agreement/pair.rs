//! A rollout as two simulators had it.

use serde::Serialize;

use crate::kernel::num;

/// One rollout as one of the simulators had it.
#[derive(Clone, Debug, PartialEq)]
pub struct Side {
    pub contact: Option<Meeting>,
    /// Its end, in a word.
    pub end: String,
    /// The ego's places, one a decision step of 0.1 s; a contact within a step ends the list. `[steps]`
    pub ego: Vec<[f64; 2]>,
    /// Smallest distance of the ego to an adversary, or to anyone where there is none, metres.
    pub distance_m_min: Option<f64>,
    /// True if it is a success of the program as published work counts it: a contact that the program brought about.
    pub published: bool,
    /// True if it is one that a careful ego could have prevented.
    pub preventable: bool,
}

/// The road user that the ego met.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Meeting {
    /// Name of the other road user.
    pub with: String,
    pub adversary: bool,
    /// Time in hundredths of a second after the start: physics steps are 0.02 s.
    pub at_cs: u32,
    /// Class of the contact and who struck, in a word each.
    pub class: String,
    pub striker: String,
    /// True if the ego could have avoided it; `None` where nobody asks (contacts with others than adversaries).
    pub avoidable: Option<bool>,
    pub relative_speed_mps: f64,
}

impl Meeting {
    pub fn time_s(&self) -> f64 {
        f64::from(self.at_cs) / 100.0
    }
}

/// The same rollout in both simulators.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// The program's name; in a scene without one, the ego against which it is replayed.
    pub program: String,
    /// The program's family; `None` without one.
    pub family: Option<String>,
    /// True if the program is a proposal of the run, which another run of the study may not have.
    pub proposed: bool,
    /// The scene's cluster: the first of its tags.
    pub cluster: String,
    pub scene: String,
    pub ego: String,
    pub a: Side,
    pub b: Side,
    /// Distance of the partner of the one contact from its place in the rollout without it, at the last step before it, metres; `None` if
    /// it is not on the road there. 0 where there is no such contact.
    pub partner_apart_m: Option<f64>,
    /// Contact in our own simulator with one option of its plant changed, the commands unchanged: one for each of the changes
    /// that a report names. Empty where neither simulator is ours.
    pub changed: Vec<bool>,
}

/// Changes tried with our own simulator's plant, by name, and which of the two simulators is ours (0 or 1).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tried {
    pub own: usize,
    pub changes: Vec<String>,
}

impl Pair {
    /// Returns `true` if both say the same about contact.
    pub fn agrees(&self) -> bool {
        self.a.contact.is_some() == self.b.contact.is_some()
    }

    /// Distance of the two egos at a time, metres; `None` after the end of either rollout.
    pub fn ego_apart_m(&self, seconds: f64) -> Option<f64> {
        let step = (10.0 * seconds).round();
        if step < 0.0 {
            return None;
        }
        let ([ax, ay], [bx, by]) = (self.a.ego.get(step as usize)?, self.b.ego.get(step as usize)?);
        Some(num::hypot(ax - bx, ay - by))
    }

    /// The earlier of the contacts, s.
    pub fn first_contact_s(&self) -> Option<f64> {
        let times = [&self.a, &self.b].map(|side| side.contact.as_ref().map(Meeting::time_s));
        times.into_iter().flatten().reduce(f64::min)
    }
}
