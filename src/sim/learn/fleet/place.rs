//! One place of a fleet: its episode, and its next task.

use crate::ego::observation::ACTION;
use crate::kernel::Seed;
use crate::sim::{Contact, Control, End, SimError};

use super::error::FleetError;
use super::options::FleetOptions;
use super::seeing::{Frames, Seeing};
use super::tasks::{Task, Tasks};
use crate::learn::ride::Ride;

/// A place and its episode.
pub(super) struct Place {
    /// Root of its random streams.
    pub seed: u64,
    /// Number of episodes that it began.
    pub episodes: u64,
    pub ride: Option<Ride<'static>>,
    /// The task that it drives, with the index of its set.
    pub task: Option<(usize, Task)>,
    /// Actions of the episode so far.
    pub actions: Vec<[f32; ACTION]>,
    pub sum: f64,
    /// The last episode that ended, where that is kept.
    pub last: Option<Kept>,
    /// Observations are made here, then copied into their row.
    frames: Frames,
}

/// An episode that ended, as it was driven.
#[derive(Clone, Debug)]
pub struct Kept {
    /// Index of its program among the sets.
    pub program: usize,
    pub task: Task,
    /// Actions as they were asked for, one a step.
    pub actions: Vec<[f32; ACTION]>,
    /// Decisions as they were carried out, one a step.
    pub controls: Vec<Control>,
    pub end: End,
}

impl Place {
    pub fn new(seed: u64) -> Place {
        Place {
            seed,
            episodes: 0,
            ride: None,
            task: None,
            actions: Vec::new(),
            sum: 0.0,
            last: None,
            frames: Frames::default(),
        }
    }

    /// Begins the next episode: a task drawn from this place's own stream, so that neither threads nor other places matter.
    pub fn begin(&mut self, tasks: &Tasks, options: &FleetOptions) -> Result<(), SimError> {
        let mut stream = Seed(self.seed).stream(&["learn", "fleet", &self.episodes.to_string()]);
        let (program, task) = tasks.draw(&mut stream);
        self.begin_with(program, task, tasks, options)
    }

    /// Begins an episode of a given task.
    pub fn begin_with(
        &mut self,
        program: usize,
        task: usize,
        tasks: &Tasks,
        options: &FleetOptions,
    ) -> Result<(), SimError> {
        self.begin_task(program, tasks.sets()[program].tasks[task].clone(), options)?;
        self.episodes += 1;
        Ok(())
    }

    fn begin_task(&mut self, program: usize, task: Task, options: &FleetOptions) -> Result<(), SimError> {
        let (plant, intervention) = (task.plant.clone(), task.intervention.clone());
        let ride = Ride::new(plant, intervention, options.seeing.setting(), options.keeping())?;
        (self.ride, self.task, self.sum) = (Some(ride), Some((program, task)), 0.0);
        self.actions.clear();
        self.frames.clear();
        Ok(())
    }

    /// Begins an episode as it was begun once, and repeats its actions.
    pub fn drive_again(
        &mut self,
        at: usize,
        (program, task): (usize, Task),
        actions: &[[f32; ACTION]],
        options: &FleetOptions,
    ) -> Result<Option<End>, FleetError> {
        let failed = |source| FleetError::Scene { place: at, source };
        self.begin_task(program, task, options).map_err(failed)?;
        let mut end = None;
        for action in actions {
            if options.seeing.stack > 1 {
                self.see(&options.seeing);
            }
            (_, end) = self.step(at, *action, options)?;
        }
        Ok(end)
    }

    /// Returns the numbers of scene and program; -1 before the first episode.
    pub fn numbers(&self) -> (i32, i32) {
        self.task.as_ref().map_or((-1, -1), |(program, task)| (task.scene as i32, *program as i32))
    }

    /// Returns `true` if it waits for a reset.
    pub fn is_over(&self) -> bool {
        self.ride.as_ref().is_some_and(|ride| ride.episode().end().is_some())
    }

    /// Does one step, and returns its reward, and the end if the episode ended. `at` is the place's own number.
    pub fn step(
        &mut self,
        at: usize,
        action: [f32; ACTION],
        options: &FleetOptions,
    ) -> Result<(f64, Option<End>), FleetError> {
        let ride = self.ride.as_mut().ok_or(FleetError::NotBegun)?;
        let (worth, end) =
            ride.step(action, &options.reward).map_err(|source| FleetError::Scene { place: at, source })?;
        self.sum += worth;
        self.actions.push(action);
        Ok((worth, end))
    }

    fn see(&mut self, seeing: &Seeing) -> Option<&[f32]> {
        Some(self.frames.seen(seeing, &self.ride.as_ref()?.view(), self.actions.len()))
    }

    /// Writes the present observation into a row.
    pub fn observe(&mut self, seeing: &Seeing, row: &mut [f32]) {
        if let Some(values) = self.see(seeing) {
            row.copy_from_slice(values);
        }
    }

    /// Returns the contact of an episode that ended, assessed where that is asked for.
    pub fn contact(&self, options: &FleetOptions) -> Result<Option<Contact>, SimError> {
        let Some(ride) = &self.ride else { return Ok(None) };
        if options.assesses { ride.episode().assessed_contact() } else { Ok(ride.episode().contact().copied()) }
    }

    /// Keeps the episode that just ended.
    pub fn keep(&mut self, end: End) {
        let controls = self.ride.as_ref().map(|ride| ride.episode().controls().to_vec()).unwrap_or_default();
        self.last = self.task.clone().map(|(program, task)| {
            let actions = self.actions.clone();
            Kept { program, task, actions, controls, end }
        });
    }
}
