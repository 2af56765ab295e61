//! How a fleet drives: what is observed, what a step is worth, when a new episode begins, what is kept.

use crate::ego::{Setting, arrays};
use crate::sim::View;

use crate::learn::reward::Reward;
use crate::learn::ride::Keeps;

/// When a place whose episode ended begins another one, in Gymnasium's terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Autoreset {
    /// With the next step, whose action is not looked at.
    NextStep,
    /// With the step that ended it: the observation is the new episode's, and the last one of the old is handed out apart.
    SameStep,
    /// When it is told to.
    Disabled,
}

/// What is observed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seeing {
    /// The numbers of a learned ego's setting.
    Setting(Setting),
    /// Arrays of road users, lanes and route, for encoders of one's own ([`arrays`]). Actions are `metadrive-1`'s.
    Arrays,
}

impl Seeing {
    /// Numbers in an observation.
    pub fn length(self) -> usize {
        match self {
            Seeing::Setting(setting) => setting.length(),
            Seeing::Arrays => arrays::LENGTH,
        }
    }

    /// What an action means.
    pub fn setting(self) -> Setting {
        match self {
            Seeing::Setting(setting) => setting,
            Seeing::Arrays => Setting::Metadrive1,
        }
    }

    pub(super) fn observe(self, view: &View<'_>, out: &mut Vec<f32>) {
        match self {
            Seeing::Setting(setting) => setting.observe(view, out),
            Seeing::Arrays => arrays::observe(view, out),
        }
    }
}

/// How a fleet drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FleetOptions {
    pub seeing: Seeing,
    pub reward: Reward,
    pub autoreset: Autoreset,
    /// Whether it is asked of every contact with an adversary if it could have been avoided, for which the episode is driven
    /// once more.
    pub assesses: bool,
    /// Whether the decisions of the last episode of each place are kept.
    pub keeps: bool,
    /// Whether everyone's motion is kept, to be drawn.
    pub keeps_motion: bool,
}

impl FleetOptions {
    pub(super) fn keeping(&self) -> Keeps {
        Keeps { controls: self.assesses || self.keeps, motion: self.keeps_motion }
    }
}
