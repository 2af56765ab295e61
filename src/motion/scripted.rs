//! A scenario of triggered road users, with what the ego made of it when it was simulated.

use std::sync::Arc;

use super::script_space::ScriptSpace;
use crate::sim::Action;

/// What a contact is worth against metres of distance in [`Scripted::loss`].
const CONTACT: f64 = 10.0;

/// A scenario and what the ego made of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Scripted {
    /// In the simulator's order; the first is the reference actor.
    pub actions: Vec<Action>,
    /// Whether the ego met one of the scripted.
    pub contact: bool,
    /// Smallest distance of the ego to one of them, metres.
    pub distance_m_min: f64,
    /// Share of the ego's route driven, 0..=1.
    pub route_completion: f64,
    /// The space that a search may move the scenario in; `None` where the candidates are all there is.
    pub space: Option<Arc<ScriptSpace>>,
}

impl Scripted {
    /// Black-box objective of the SafeBench ports, smaller is better: a contact first, nearness where there is none.
    pub fn loss(&self) -> f64 {
        if self.contact { self.distance_m_min - CONTACT } else { self.distance_m_min }
    }
}
