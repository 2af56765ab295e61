//! Keeps the motion of a rollout on demand; the outcome does not depend on it.

use crate::scene::Sample;

use super::contact::row_during;
use super::intervention::ActorRef;
use super::others::Others;
use super::outcome::{ActorTrace, Trace};
use super::plant::Plant;

pub(super) struct Recorder {
    trace: Trace,
    /// Tracks come first in `trace.actors`, then inserted ones.
    tracks: usize,
}

impl Recorder {
    pub fn new(plant: &Plant, world: &Others, adversaries: usize) -> Recorder {
        let acts = |who: ActorRef| world.actors.iter().take(adversaries).any(|a| a.who == who);
        let of = |actor: ActorRef, size: &super::body::Size| ActorTrace {
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

    /// The state at the k-th simulated step.
    pub fn push(&mut self, plant: &Plant, world: &Others, ego: &Sample, k: usize) {
        self.push_row(plant, world, ego, k, |row| *plant.rows.sample(k, row));
    }

    /// The state after a physics step of the k-th step, at the moment of contact.
    pub fn push_during(&mut self, plant: &Plant, world: &Others, ego: &Sample, k: usize, substep: usize) {
        self.push_row(plant, world, ego, k, |row| row_during(plant, k, row, substep).1);
    }

    fn push_row(&mut self, plant: &Plant, world: &Others, ego: &Sample, k: usize, of: impl Fn(usize) -> Sample) {
        self.trace.ego.push(*ego);
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

    pub fn finish(self) -> Trace {
        self.trace
    }
}
