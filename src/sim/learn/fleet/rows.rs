//! A part of a fleet, stepped by one thread: some places, and their rows of every sheet.

use std::ops::Range;

use crate::ego::observation::ACTION;
use crate::learn::reward::Step;
use crate::sim::{End, SimError};

use super::error::FleetError;
use super::options::{Autoreset, FleetOptions};
use super::place::Place;
use super::seeing::Seeing;
use super::sheets::Sheets;
use super::tasks::Tasks;

/// Rows of some places.
pub(super) struct Rows<'r> {
    /// The first place.
    from: usize,
    places: &'r mut [Place],
    actions: &'r [f32],
    observations: &'r mut [f32],
    final_observations: &'r mut [f32],
    rewards: &'r mut [f64],
    terminated: &'r mut [u8],
    truncated: &'r mut [u8],
    scene: &'r mut [i32],
    program: &'r mut [i32],
    end: &'r mut [i8],
    contact_class: &'r mut [i8],
    adversary: &'r mut [u8],
    preventable: &'r mut [i8],
    route_completion: &'r mut [f32],
    length: &'r mut [i32],
    sum: &'r mut [f64],
    steps: &'r mut [f64],
    now_scene: &'r mut [i32],
    now_program: &'r mut [i32],
}

/// The first so many of a slice; the rest stays in it.
fn cut<'r, T>(from: &mut &'r mut [T], count: usize) -> &'r mut [T] {
    let (first, rest) = std::mem::take(from).split_at_mut(count);
    *from = rest;
    first
}

impl<'r> Rows<'r> {
    /// All places and the sheet of observations that is written now.
    pub fn all(places: &'r mut [Place], sheets: &'r mut Sheets, sheet: usize) -> Rows<'r> {
        let reports = &mut sheets.reports;
        Rows {
            from: 0,
            places,
            actions: &sheets.actions,
            observations: &mut sheets.observations[sheet],
            final_observations: &mut sheets.final_observations,
            rewards: &mut sheets.rewards,
            terminated: &mut sheets.terminated,
            truncated: &mut sheets.truncated,
            scene: &mut reports.scene,
            program: &mut reports.program,
            end: &mut reports.end,
            contact_class: &mut reports.contact_class,
            adversary: &mut reports.adversary,
            preventable: &mut reports.preventable,
            route_completion: &mut reports.route_completion,
            length: &mut reports.length,
            sum: &mut reports.sum,
            steps: &mut sheets.steps,
            now_scene: &mut sheets.now_scene,
            now_program: &mut sheets.now_program,
        }
    }

    /// In parts of so many places.
    pub fn in_parts_of(mut self, count: usize) -> Vec<Rows<'r>> {
        let mut parts = Vec::with_capacity(self.places.len() / count + 1);
        let width = self.observations.len() / self.places.len();
        while !self.places.is_empty() {
            let n = count.min(self.places.len());
            let (actions, rest) = self.actions.split_at(n * ACTION);
            self.actions = rest;
            parts.push(Rows {
                from: self.from,
                places: cut(&mut self.places, n),
                actions,
                observations: cut(&mut self.observations, n * width),
                final_observations: cut(&mut self.final_observations, n * width),
                rewards: cut(&mut self.rewards, n),
                terminated: cut(&mut self.terminated, n),
                truncated: cut(&mut self.truncated, n),
                scene: cut(&mut self.scene, n),
                program: cut(&mut self.program, n),
                end: cut(&mut self.end, n),
                contact_class: cut(&mut self.contact_class, n),
                adversary: cut(&mut self.adversary, n),
                preventable: cut(&mut self.preventable, n),
                route_completion: cut(&mut self.route_completion, n),
                length: cut(&mut self.length, n),
                sum: cut(&mut self.sum, n),
                steps: cut(&mut self.steps, n * Step::NAMES.len()),
                now_scene: cut(&mut self.now_scene, n),
                now_program: cut(&mut self.now_program, n),
            });
            self.from += n;
        }
        parts
    }

    fn failed(&self, row: usize, source: SimError) -> FleetError {
        FleetError::Scene { place: self.from + row, source }
    }

    fn row(&self, row: usize) -> Range<usize> {
        let width = self.observations.len() / self.places.len();
        row * width..(row + 1) * width
    }

    /// What is seen at every place now, and what goes on there.
    pub fn show(&mut self, seeing: &Seeing) {
        for row in 0..self.places.len() {
            let at = self.row(row);
            (self.now_scene[row], self.now_program[row]) = self.places[row].numbers();
            self.places[row].observe(seeing, &mut self.observations[at]);
        }
    }

    /// Begins a new episode at every place that `is_meant`; `task` is given where it is not to be drawn.
    pub fn reset(
        &mut self,
        is_meant: &dyn Fn(usize) -> bool,
        task: Option<(usize, usize)>,
        tasks: &Tasks,
        options: &FleetOptions,
    ) -> Result<(), FleetError> {
        for row in 0..self.places.len() {
            let at = self.row(row);
            if is_meant(self.from + row) {
                self.begin(row, task, tasks, options)?;
                (self.rewards[row], self.terminated[row], self.truncated[row]) = (0.0, 0, 0);
                self.report(row, None, options)?;
            }
            self.places[row].observe(&options.seeing, &mut self.observations[at]);
        }
        Ok(())
    }

    fn begin(
        &mut self,
        row: usize,
        task: Option<(usize, usize)>,
        tasks: &Tasks,
        options: &FleetOptions,
    ) -> Result<(), FleetError> {
        let place = &mut self.places[row];
        let begun = match task {
            Some((program, task)) => place.begin_with(program, task, tasks, options),
            None => place.begin(tasks, options),
        };
        begun.map_err(|source| self.failed(row, source))?;
        (self.now_scene[row], self.now_program[row]) = self.places[row].numbers();
        Ok(())
    }

    /// One step of every place; how many episodes ended.
    pub fn step(&mut self, tasks: &Tasks, options: &FleetOptions) -> Result<usize, FleetError> {
        let mut ended = 0;
        for row in 0..self.places.len() {
            let at = self.row(row);
            if self.places[row].is_over() {
                match options.autoreset {
                    Autoreset::NextStep => self.reset_row(row, at, tasks, options)?,
                    _ => return Err(FleetError::Over { place: self.from + row }),
                }
                continue;
            }
            let action = [self.actions[row * ACTION], self.actions[row * ACTION + 1]];
            let (worth, end) = self.places[row].step(self.from + row, action, options)?;
            self.rewards[row] = worth;
            self.truncated[row] = u8::from(end == Some(End::Horizon));
            self.terminated[row] = u8::from(end.is_some_and(|end| end != End::Horizon));
            self.report(row, end, options)?;
            if let Some(end) = end {
                ended += 1;
                if options.keeps {
                    self.places[row].keep(end);
                }
                if options.autoreset == Autoreset::SameStep {
                    self.places[row].observe(&options.seeing, &mut self.final_observations[at.clone()]);
                    self.begin(row, None, tasks, options)?;
                }
            }
            self.places[row].observe(&options.seeing, &mut self.observations[at]);
        }
        Ok(ended)
    }

    fn reset_row(
        &mut self,
        row: usize,
        at: Range<usize>,
        tasks: &Tasks,
        options: &FleetOptions,
    ) -> Result<(), FleetError> {
        self.begin(row, None, tasks, options)?;
        (self.rewards[row], self.terminated[row], self.truncated[row]) = (0.0, 0, 0);
        self.report(row, None, options)?;
        self.places[row].observe(&options.seeing, &mut self.observations[at]);
        Ok(())
    }

    /// Says of the episode at a place how it stands.
    fn report(&mut self, row: usize, end: Option<End>, options: &FleetOptions) -> Result<(), FleetError> {
        let place = &self.places[row];
        let Some(ride) = &place.ride else { return Err(FleetError::NotBegun) };
        let episode = ride.episode();
        (self.scene[row], self.program[row]) = place.numbers();
        self.route_completion[row] = episode.route_completion() as f32;
        self.length[row] = episode.steps() as i32;
        self.sum[row] = place.sum;
        let step = ride.last().numbers();
        self.steps[row * step.len()..][..step.len()].copy_from_slice(&step);
        self.end[row] = end.map_or(-1, |end| end as i8);
        let contact = match end {
            Some(End::Contact) => place.contact(options).map_err(|source| self.failed(row, source))?,
            _ => None,
        };
        self.contact_class[row] = contact.map_or(-1, |contact| contact.class as i8);
        self.adversary[row] = u8::from(contact.is_some_and(|contact| contact.adversary));
        self.preventable[row] = contact.and_then(|contact| contact.preventable()).map_or(-1, i8::from);
        Ok(())
    }
}
