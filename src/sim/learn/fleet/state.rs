//! A fleet as it stands, to go on elsewhere: what each place drew and did. Whoever does the same again is where it was.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::error::FleetError;
use super::options::FleetOptions;
use super::place::Place;
use super::sheets::Reports;
use super::tasks::Task;
use crate::ego::observation::ACTION;
use crate::sim::{Intervention, Plant};

/// All that a fleet is besides its tasks and options.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FleetState {
    pub(super) places: Vec<PlaceState>,
    pub(super) reports: Reports,
    pub(super) weights: Vec<f64>,
    pub(super) is_begun: bool,
    pub(super) steps: u64,
}

/// All that a place is besides its options.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct PlaceState {
    seed: u64,
    episodes: u64,
    now: Option<Drive>,
    last: Option<Drive>,
}

/// An episode, which may be of tasks that the fleet has no longer.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Drive {
    program: usize,
    scene: usize,
    intervention: Intervention,
    actions: Vec<[f32; ACTION]>,
}

impl Drive {
    fn of(program: usize, task: &Task, actions: &[[f32; ACTION]]) -> Drive {
        Drive { program, scene: task.scene, intervention: (*task.intervention).clone(), actions: actions.to_vec() }
    }
}

impl PlaceState {
    /// The state of a place.
    pub fn of(place: &Place) -> PlaceState {
        PlaceState {
            seed: place.seed,
            episodes: place.episodes,
            now: place.task.as_ref().map(|(program, task)| Drive::of(*program, task, &place.actions)),
            last: place.last.as_ref().map(|kept| Drive::of(kept.program, &kept.task, &kept.actions)),
        }
    }

    /// Returns the place that goes on from this state. `plants` are those of the scenes, by their numbers.
    pub fn resumed(&self, at: usize, plants: &[Arc<Plant>], options: &FleetOptions) -> Result<Place, FleetError> {
        let task = |drive: &Drive| {
            let (found, below) = (drive.scene, plants.len());
            let plant = plants.get(drive.scene).cloned().ok_or(FleetError::Place { what: "scene", found, below })?;
            Ok((drive.program, Task { scene: drive.scene, plant, intervention: Arc::new(drive.intervention.clone()) }))
        };
        let mut place = Place::new(self.seed);
        place.episodes = self.episodes;
        if let Some(last) = &self.last
            && let Some(end) = place.drive_again(at, task(last)?, &last.actions, options)?
        {
            place.keep(end);
        }
        if let Some(now) = &self.now {
            place.drive_again(at, task(now)?, &now.actions, options)?;
        }
        Ok(place)
    }
}
