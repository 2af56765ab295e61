//! Many episodes side by side, for learners from outside: one array of actions in, arrays of observations and rewards out, and
//! a new episode where one ended. A place depends on its seed and its actions alone, so the numbers are the same
//! for any number of threads.

mod error;
mod options;
mod place;
mod rows;
mod seeing;
mod sheets;
mod state;
mod tasks;

pub use error::FleetError;
pub use options::{Autoreset, FleetOptions};
pub use place::Kept;
pub use seeing::{Frames, Kind, Seeing};
pub use sheets::{Reports, Sheets};
pub use state::FleetState;
pub use tasks::{Task, TaskSet, Tasks};

use std::sync::{Arc, Mutex, PoisonError};

use crate::ego::observation::ACTION;
use crate::kernel::Threads;
use crate::sim::{End, Episode, Plant};

use place::Place;
use rows::Rows;
use state::PlaceState;

/// Most places of a fleet.
pub const PLACES_MAX: usize = 1 << 20;
/// Nor are scenes preferred more than this.
pub const BY_FAILURE_MAX: f64 = 1e6;
/// Parts that each thread gets: a part with many new episodes takes longer, and the others take what is left.
const PARTS_A_THREAD: usize = 4;

/// Episodes side by side.
pub struct Fleet {
    tasks: Arc<Tasks>,
    options: FleetOptions,
    places: Vec<Place>,
    sheets: Sheets,
    /// Index of the sheet of observations that was written last.
    sheet: usize,
    is_begun: bool,
    steps: u64,
}

impl Fleet {
    /// Makes a fleet of so many places; the first step comes after a [`Fleet::reset`].
    pub fn new(tasks: Arc<Tasks>, places: usize, options: FleetOptions) -> Result<Fleet, FleetError> {
        if !(1..=PLACES_MAX).contains(&places) {
            return Err(FleetError::Places { found: places, most: PLACES_MAX });
        }
        // NaN lies in no range.
        if !(1.0..=BY_FAILURE_MAX).contains(&options.by_failure) {
            return Err(FleetError::ByFailure { found: options.by_failure, most: BY_FAILURE_MAX });
        }
        let sheets = Sheets::new(places, options.seeing.length());
        let places = (0..places as u64).map(Place::new).collect();
        Ok(Fleet { tasks, options, places, sheets, sheet: 0, is_begun: false, steps: 0 })
    }

    /// Returns the state from which [`Fleet::resumed`] goes on.
    pub fn state(&self) -> FleetState {
        FleetState {
            places: self.places.iter().map(PlaceState::of).collect(),
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
        let again = |at: usize, of: &PlaceState| of.resumed(at, plants, &options);
        fleet.places = threads.map(&state.places, again).into_iter().collect::<Result<_, FleetError>>()?;
        (fleet.sheets.reports, fleet.is_begun, fleet.steps) = (state.reports, state.is_begun, state.steps);
        if !state.weights.is_empty() {
            Arc::make_mut(&mut fleet.tasks).weights = state.weights;
        }
        let sheet = fleet.sheet;
        Rows::all(&mut fleet.places, &mut fleet.sheets, sheet).show(&options.seeing);
        Ok(fleet)
    }

    /// Returns the number of places.
    pub fn places(&self) -> usize {
        self.places.len()
    }

    /// Returns the number of steps so far, summed over the places.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Returns the numbers of the last step.
    pub fn sheets(&self) -> &Sheets {
        &self.sheets
    }

    /// Returns the actions, to be written before a step: steering and pedal a place.
    pub fn actions_mut(&mut self) -> &mut [f32] {
        &mut self.sheets.actions
    }

    /// Returns the index of the sheet that holds the present observations.
    pub fn sheet(&self) -> usize {
        self.sheet
    }

    /// Returns the present observations.
    pub fn observations(&self) -> &[f32] {
        &self.sheets.observations[self.sheet]
    }

    /// Returns the last episode of a place, where that is kept.
    pub fn kept(&self, place: usize) -> Option<&Kept> {
        self.places.get(place)?.last.as_ref()
    }

    /// Returns the episode at a place.
    pub fn episode(&self, place: usize) -> Option<&Episode<'static>> {
        Some(self.places.get(place)?.ride.as_ref()?.episode())
    }

    /// Returns the tasks.
    pub fn tasks(&self) -> &Arc<Tasks> {
        &self.tasks
    }

    /// Sets other tasks for every episode that begins from now on; the scenes' weights stay.
    pub fn set_tasks(&mut self, tasks: Arc<Tasks>) {
        let former = std::mem::replace(&mut self.tasks, tasks);
        if !former.weights.is_empty() {
            Arc::make_mut(&mut self.tasks).weights.clone_from(&former.weights);
        }
    }

    /// When new episodes begin, from the next reset on.
    pub fn set_autoreset(&mut self, autoreset: Autoreset) {
        self.options.autoreset = autoreset;
    }

    /// Gives a place another seed: its episodes are drawn anew from the first one on.
    pub fn seed(&mut self, place: usize, seed: u64) -> Result<(), FleetError> {
        let below = self.places.len();
        let of = self.places.get_mut(place).ok_or(FleetError::Place { what: "place", found: place, below })?;
        (of.seed, of.episodes) = (seed, 0);
        Ok(())
    }

    /// Begins an episode at the places for which `is_meant` is true, or a given task (indices of set and task) there.
    pub fn reset(
        &mut self,
        is_meant: &(dyn Fn(usize) -> bool + Sync),
        task: Option<(usize, usize)>,
        threads: &Threads,
    ) -> Result<(), FleetError> {
        if let Some((set, task)) = task {
            let missing = |what, found, below| Err(FleetError::Place { what, found, below });
            match self.tasks.sets().get(set) {
                None => return missing("program", set, self.tasks.sets().len()),
                Some(of) if task >= of.tasks.len() => return missing("task", task, of.tasks.len()),
                Some(_) => {}
            }
        }
        self.is_begun |= (0..self.places.len()).all(|place| is_meant(place) || self.places[place].ride.is_some());
        self.each_part(threads, |rows, tasks, options| rows.reset(is_meant, task, tasks, options).map(|()| 0))?;
        Ok(())
    }

    /// Carries the actions out, and returns how many episodes ended. After an error other than one of the actions the fleet is not to be
    /// used any more: some places have made the step.
    pub fn step(&mut self, threads: &Threads) -> Result<usize, FleetError> {
        if !self.is_begun {
            return Err(FleetError::NotBegun);
        }
        let is_read = |place: usize| self.options.autoreset != Autoreset::NextStep || !self.places[place].is_over();
        let mut wrong = self.sheets.actions.iter().enumerate().filter(|(_, x)| !(-1.0..=1.0).contains(*x));
        if let Some((at, found)) = wrong.find(|(at, _)| is_read(at / ACTION)) {
            return Err(FleetError::Action { place: at / ACTION, which: at % ACTION, found: *found });
        }
        if self.options.autoreset == Autoreset::Disabled
            && let Some(place) = self.places.iter().position(Place::is_over)
        {
            return Err(FleetError::Over { place });
        }
        let ended = self.each_part(threads, |rows, tasks, options| rows.step(tasks, options))?;
        self.steps += self.places.len() as u64;
        if ended > 0 && self.options.by_failure > 1.0 {
            // Behind the step, in the order of the places: what a place draws does not depend on who steps it.
            let tasks = Arc::make_mut(&mut self.tasks);
            let Reports { scene, end, .. } = &self.sheets.reports;
            for (scene, end) in scene.iter().zip(end).filter(|(_, end)| **end >= 0) {
                let is_failed = [End::Contact, End::OffRoad].iter().any(|failed| *failed as i8 == *end);
                tasks.weigh(*scene as usize, is_failed, self.options.by_failure);
            }
        }
        Ok(ended)
    }

    /// Does `work` for all places, in parts by the threads, and returns the sum of its results.
    fn each_part(
        &mut self,
        threads: &Threads,
        work: impl Fn(&mut Rows<'_>, &Tasks, &FleetOptions) -> Result<usize, FleetError> + Sync + Send,
    ) -> Result<usize, FleetError> {
        self.sheet = 1 - self.sheet;
        let (tasks, options, count) = (&*self.tasks, &self.options, self.places.len());
        let mut rows = Rows::all(&mut self.places, &mut self.sheets, self.sheet);
        if threads.count() == 1 || count < 2 * threads.count() {
            return work(&mut rows, tasks, options);
        }
        let parts = rows.in_parts_of(count.div_ceil(PARTS_A_THREAD * threads.count()));
        let parts: Vec<Mutex<Rows<'_>>> = parts.into_iter().map(Mutex::new).collect();
        let done = threads
            .map(&parts, |_, part| work(&mut part.lock().unwrap_or_else(PoisonError::into_inner), tasks, options));
        done.into_iter().sum()
    }
}
