//! The tasks of the places of a fleet: scenes, as they are or as programs change them, and how often each program comes up.

use std::sync::Arc;

use crate::kernel::Stream;
use crate::sim::{Intervention, Plant};

use super::error::FleetError;

/// A scene with what others do to the ego there.
#[derive(Clone, Debug)]
pub struct Task {
    /// Number of this scene; for the caller that gave the tasks.
    pub scene: usize,
    pub plant: Arc<Plant>,
    pub intervention: Arc<Intervention>,
}

/// The tasks of one program, or of none.
#[derive(Clone, Debug)]
pub struct TaskSet {
    /// Frequency with which it comes up, relative to the others' shares. Any scale.
    pub share: f64,
    pub tasks: Vec<Task>,
}

/// All tasks of a fleet.
#[derive(Clone, Debug)]
pub struct Tasks {
    sets: Vec<TaskSet>,
    shares: f64,
}

impl Tasks {
    /// Refuses shares by which nothing can be drawn, sets that come up and hold nothing, and scenes without a step.
    pub fn new(sets: Vec<TaskSet>) -> Result<Tasks, FleetError> {
        for (set, of) in sets.iter().enumerate() {
            if !of.share.is_finite() || of.share < 0.0 {
                return Err(FleetError::Share { set, found: of.share });
            }
            if of.share > 0.0 && of.tasks.is_empty() {
                return Err(FleetError::NoTask { set });
            }
            if let Some(task) = of.tasks.iter().find(|task| task.plant.steps() == 0) {
                return Err(FleetError::NoStep { scene: task.plant.scene_id().to_string() });
            }
        }
        let shares = sets.iter().fold(0.0, |sum, of| sum + of.share);
        if shares > 0.0 { Ok(Tasks { sets, shares }) } else { Err(FleetError::NoShare) }
    }

    /// Returns the sets in the order in which they were given.
    pub fn sets(&self) -> &[TaskSet] {
        &self.sets
    }

    /// Draws a set by the shares, and one of its tasks evenly: the set's index and the task's index in it.
    pub fn draw(&self, stream: &mut Stream) -> (usize, usize) {
        let mut left = stream.unit() * self.shares;
        let mut drawn = 0;
        for (set, of) in self.sets.iter().enumerate().filter(|(_, of)| of.share > 0.0) {
            drawn = set;
            if left < of.share {
                break;
            }
            left -= of.share;
        }
        (drawn, stream.below(self.sets[drawn].tasks.len()))
    }
}
