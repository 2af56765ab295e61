//! A scenario of triggered road users, with the result of its simulation.

use std::sync::Arc;

use super::script_space::ScriptSpace;
use crate::sim::Action;

/// Bonus for a contact in [`Scripted::loss`], metres of distance.
const CONTACT: f64 = 10.0;

/// A scenario and its result.
#[derive(Clone, Debug, PartialEq)]
pub struct Scripted {
    /// In the simulator's order; the first is the reference actor.
    pub actions: Vec<Action>,
    /// True if the ego touched one of the scripted road users.
    pub contact: bool,
    /// Smallest distance of the ego to one of them, metres.
    pub distance_m_min: f64,
    /// Share of the ego's route driven, 0..=1.
    pub route_completion: f64,
    /// The space in which a search may change the scenario; `None` if there are only the listed candidates.
    pub space: Option<Arc<ScriptSpace>>,
}

impl Scripted {
    /// Black-box objective of the SafeBench ports, smaller is better: first contact, then nearness.
    pub fn loss(&self) -> f64 {
        if self.contact { self.distance_m_min - CONTACT } else { self.distance_m_min }
    }
}
