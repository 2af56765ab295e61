//! Keeps the motion of a rollout on demand; the outcome does not depend on it.

use crate::scene::Sample;
use crate::sim::accounts::outcome::{ActorTrace, Trace};
use crate::sim::encounters::contact::row_during;
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::intervention::ActorRef;

use super::closed_loop::ClosedLoop;

/// A writer of a rollout, state by state.
pub(in crate::sim) trait Records {
    /// Writes the state at the k-th simulated step.
    fn push(&mut self, state: &ClosedLoop<'_>, k: usize);

    /// Writes the state after a physics step of the k-th step, at the moment of contact.
    fn push_during(&mut self, state: &ClosedLoop<'_>, k: usize, substep: usize);
}

pub(in crate::sim) struct Recorder {
    trace: Trace,
    /// Number of tracks, which come first in `trace.actors`, before inserted ones.
    tracks: usize,
}

impl Recorder {
    pub fn new(plant: &Plant, state: &ClosedLoop<'_>) -> Recorder {
        let world = &state.world;
        let acts = |who: ActorRef| world.actors.iter().take(state.count).any(|a| a.who == who);
        let of = |actor: ActorRef, size: &crate::sim::prepared::body::Size| ActorTrace {
            actor,
            length_m: 2.0 * size.half_length_m,
            width_m: 2.0 * size.half_width_m,
            adversary: acts(actor),
            samples: Vec::with_capacity(plant.steps() + 1),
        };
        let tracks = plant.sizes.iter().enumerate().map(|(i, size)| of(ActorRef::Track(i), size));
        let inserted = world.actors.iter().filter(|a| matches!(a.who, ActorRef::Inserted(_)));
        let actors = tracks.chain(inserted.map(|a| of(a.who, &a.size))).collect();
        Recorder {
            trace: Trace { from_step: plant.first_step(), ego: Vec::with_capacity(plant.steps() + 1), actors },
            tracks: plant.tracks(),
        }
    }

    fn push_row(&mut self, state: &ClosedLoop<'_>, k: usize, of: impl Fn(usize) -> Sample) {
        let (plant, world) = (&*state.plant, &state.world);
        self.trace.ego.push(state.ego.sample);
        for actor in &mut self.trace.actors {
            actor.samples.push(None);
        }
        let last = self.trace.ego.len() - 1;
        for row in plant.rows.of_step(k) {
            let track = plant.rows.track[row] as usize;
            if !world.simulated[track] {
                self.trace.actors[track].samples[last] = Some(of(row));
            }
        }
        for actor in &world.actors {
            let at = match actor.who {
                ActorRef::Track(track) => track,
                ActorRef::Inserted(i) => self.tracks + i,
            };
            self.trace.actors[at].samples[last] = actor.now;
        }
    }

    pub fn so_far(&self) -> &Trace {
        &self.trace
    }

    pub fn finish(self) -> Trace {
        self.trace
    }
}

impl Records for Recorder {
    fn push(&mut self, state: &ClosedLoop<'_>, k: usize) {
        self.push_row(state, k, |row| *state.plant.rows.sample(k, row));
    }

    fn push_during(&mut self, state: &ClosedLoop<'_>, k: usize, substep: usize) {
        self.push_row(state, k, |row| row_during(&state.plant, k, row, substep).1);
    }
}
