//! A fleet as it stands, to go on elsewhere: what each place drew and did. Whoever does the same again is where it was.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::error::FleetError;
use super::options::FleetOptions;
use super::place::Place;
use super::sheets::Reports;
use super::tasks::{Task, Tasks};
use super::{Fleet, rows::Rows};
use crate::ego::observation::ACTION;
use crate::kernel::Threads;
use crate::sim::{Intervention, Plant};

/// All that a fleet is besides its tasks and options.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FleetState {
    places: Vec<PlaceState>,
    reports: Reports,
    weights: Vec<f64>,
    is_begun: bool,
    steps: u64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct PlaceState {
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

impl Fleet {
    /// What [`Fleet::resumed`] goes on from.
    pub fn state(&self) -> FleetState {
        let of = |place: &Place| PlaceState {
            seed: place.seed,
            episodes: place.episodes,
            now: place.task.as_ref().map(|(program, task)| Drive::of(*program, task, &place.actions)),
            last: place.last.as_ref().map(|kept| Drive::of(kept.program, &kept.task, &kept.actions)),
        };
        FleetState {
            places: self.places.iter().map(of).collect(),
            reports: self.sheets.reports.clone(),
            weights: self.tasks.weights.clone(),
            is_begun: self.is_begun,
            steps: self.steps,
        }
    }

    /// A fleet that goes on as another one would. `plants` are those of the scenes, by their numbers.
    ///
    /// # Errors
    /// Those of [`Fleet::new`]; a state of another fleet.
    pub fn resumed(
        tasks: Arc<Tasks>,
        options: FleetOptions,
        state: FleetState,
        plants: &[Arc<Plant>],
        threads: &Threads,
    ) -> Result<Fleet, FleetError> {
        let mut fleet = Fleet::new(tasks, state.places.len(), options)?;
        let task = |drive: &Drive| {
            let (found, below) = (drive.scene, plants.len());
            let plant = plants.get(drive.scene).cloned().ok_or(FleetError::Place { what: "scene", found, below })?;
            Ok((drive.program, Task { scene: drive.scene, plant, intervention: Arc::new(drive.intervention.clone()) }))
        };
        let again = |at: usize, of: &PlaceState| {
            let mut place = Place::new(of.seed);
            place.episodes = of.episodes;
            if let Some(last) = &of.last
                && let Some(end) = place.drive_again(at, task(last)?, &last.actions, &options)?
            {
                place.keep(end);
            }
            if let Some(now) = &of.now {
                place.drive_again(at, task(now)?, &now.actions, &options)?;
            }
            Ok(place)
        };
        fleet.places = threads.map(&state.places, again).into_iter().collect::<Result<_, FleetError>>()?;
        (fleet.sheets.reports, fleet.is_begun, fleet.steps) = (state.reports, state.is_begun, state.steps);
        if !state.weights.is_empty() {
            Arc::make_mut(&mut fleet.tasks).weights = state.weights;
        }
        let sheet = fleet.sheet;
        Rows::all(&mut fleet.places, &mut fleet.sheets, sheet).show(options.seeing);
        Ok(fleet)
    }
}
