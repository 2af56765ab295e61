//! How a fleet drives: its observations, the reward of a step, when a new episode begins, and the data kept.

use crate::learn::reward::Reward;
use crate::learn::ride::Keeps;

use super::seeing::Seeing;

/// When a place whose episode ended begins another one, in Gymnasium's terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Autoreset {
    /// With the next step, whose action is ignored.
    NextStep,
    /// With the step that ended it: the observation is the new episode's, and the last one of the old is handed out separately.
    SameStep,
    /// When a reset asks for it.
    Disabled,
}

/// How a fleet drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FleetOptions {
    pub seeing: Seeing,
    pub reward: Reward,
    pub autoreset: Autoreset,
    /// Weight of a scene in which every episode fails (contact, off the road) in units of that of one in which none does.
    pub by_failure: f64,
    /// True if every contact with an adversary is tested for being avoidable, for which the episode is driven once more.
    pub assesses: bool,
    /// True if the decisions of the last episode of each place are kept.
    pub keeps: bool,
    /// True if everyone's motion is kept, to be drawn.
    pub keeps_motion: bool,
}

impl FleetOptions {
    pub(super) fn keeping(&self) -> Keeps {
        Keeps { controls: self.assesses || self.keeps, motion: self.keeps_motion }
    }
}
