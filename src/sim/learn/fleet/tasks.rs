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
    /// Weight of each scene by its number; those beyond have 1.
    pub(super) weights: Vec<f64>,
}

/// Share of the newest episode in a scene's weight.
const NEWEST: f64 = 0.2;

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
        if sets.iter().any(|of| of.share > 0.0) {
            Ok(Tasks { sets, weights: Vec::new() })
        } else {
            Err(FleetError::NoShare)
        }
    }

    /// Returns the sets in the order in which they were given.
    pub fn sets(&self) -> &[TaskSet] {
        &self.sets
    }

    /// Returns the weight of each scene by its number; those beyond have 1.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Moves the weight of a scene whose episode is over towards `most` if it failed, else towards 1.
    pub(super) fn weigh(&mut self, scene: usize, is_failed: bool, most: f64) {
        let len = self.weights.len().max(scene + 1);
        self.weights.resize(len, 1.0);
        let of = &mut self.weights[scene];
        *of += NEWEST * (if is_failed { most } else { 1.0 } - *of);
    }

    /// Draws a set by the shares, and one of its tasks by the scenes' weights: the set's index and the task's index in it.
    pub fn draw(&self, stream: &mut Stream) -> (usize, usize) {
        let set = weighted(stream, self.sets.iter().map(|of| of.share));
        let tasks = &self.sets[set].tasks;
        if self.weights.is_empty() {
            return (set, stream.below(tasks.len()));
        }
        let weight = |task: &Task| self.weights.get(task.scene).copied().unwrap_or(1.0);
        (set, weighted(stream, tasks.iter().map(weight)))
    }
}

/// Draws a place by weights that are not all 0.
fn weighted(stream: &mut Stream, weights: impl Iterator<Item = f64> + Clone) -> usize {
    let mut left = stream.unit() * weights.clone().fold(0.0, |sum, of| sum + of);
    let mut drawn = 0;
    for (place, weight) in weights.enumerate().filter(|(_, weight)| *weight > 0.0) {
        drawn = place;
        if left < weight {
            break;
        }
        left -= weight;
    }
    drawn
}
