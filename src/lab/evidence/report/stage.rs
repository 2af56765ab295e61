//! Rollouts that the report plays, and the scenes in which they happened.

use std::collections::BTreeMap;

use super::manoeuvre::Gained;
use crate::draw::{Actor, Contact, Drawing};
use crate::objects::SolutionId;

/// Rollouts to play, and the scenes in which they happened.
#[derive(Clone, Debug, Default)]
pub struct Stage {
    /// Scene id -> the scene as it was recorded.
    pub scenes: BTreeMap<String, Drawing>,
    pub rollouts: Vec<Playable>,
    /// Programs that would be played but have no rollout.
    pub unplayed: Vec<Unplayed>,
    /// Lineages that repeat one that is played with other draws.
    pub repetitions_left_out: usize,
    /// For each chosen program, what happens in the scenes that it gains.
    pub gained: BTreeMap<SolutionId, Gained>,
}

/// A program that has no rollout in a scene that the report plays.
#[derive(Clone, Debug)]
pub struct Unplayed {
    pub solution: String,
    pub scene: String,
    /// Reason why it cannot be compiled or rolled out there.
    pub reason: String,
}

/// A rollout as what it changed: actors not named here move as recorded.
#[derive(Clone, Debug)]
pub struct Playable {
    pub solution: String,
    /// `parent`, `active`, `front`, ...
    pub role: String,
    pub scene: String,
    pub changed: Vec<Actor>,
    pub contact: Option<Contact>,
    /// One line on how it ended.
    pub caption: String,
    /// True if it came out as the record has it; `None` where the record holds no label of it.
    pub as_recorded: Option<bool>,
}
