//! The road users other than the ego that an adversary touches on its way. A pair whose recorded boxes overlap already does not count:
//! boxes of recordings are drawn by hand or by a tracker, and a lorry overlaps its trailer.

use super::contact::{near_rows, touches, touches_row};
use crate::scene::{AgentKind, TrackIx};
use crate::sim::prepared::body::SUBSTEPS;
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::intervention::ActorRef;
use crate::sim::road_users::others::Others;

/// Farthest distance that a parked road user gets from the place where it was first seen, metres.
pub const PARKED_M: f64 = 1.0;

/// Kinds of bystanders that were touched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::sim) struct Touched {
    pub moving: bool,
    pub parked: bool,
}

impl Touched {
    pub fn any(self) -> bool {
        self.moving || self.parked
    }

    fn add(&mut self, parked: bool) {
        self.moving |= !parked;
        self.parked |= parked;
    }
}

/// Returns the kinds of road users that the one at `own` in `world.actors` touches up to a physics step of the k-th step.
pub(in crate::sim) fn touched(plant: &Plant, world: &Others, k: usize, own: usize, until: usize) -> Touched {
    let actor = &world.actors[own];
    let mover = actor.mover();
    let mut touched = Touched::default();
    near_rows(plant, world, k, &mover, |row| {
        let track = plant.rows.track[row] as usize;
        if touches_row(&mover, plant, k, row, until).is_some() && !overlapped(plant, actor.who, track) {
            touched.add(is_parked(plant, track));
        }
    });
    for (_, other) in world.actors.iter().enumerate().filter(|(i, other)| *i != own && other.now.is_some()) {
        if touches(&mover, &other.mover(), until).is_some() {
            match other.who {
                ActorRef::Track(track) if overlapped(plant, actor.who, track) => {}
                ActorRef::Track(track) => touched.add(other.action.is_none() && is_parked(plant, track)),
                ActorRef::Inserted(_) => touched.add(false),
            }
        }
    }
    touched
}

/// Returns `true` if a track stands all through its recording.
pub(in crate::sim) fn is_parked(plant: &Plant, track: TrackIx) -> bool {
    let recorded = &plant.scene().tracks[track];
    let mut places = recorded.samples.iter().flatten().map(|sample| sample.position);
    let first = places.next().unwrap_or_default();
    recorded.kind == AgentKind::Static || places.all(|place| place.distance(first) <= PARKED_M)
}

/// Returns `true` if the recordings of two road users overlap at some time; `false` for one that was not recorded.
pub(in crate::sim) fn overlapped(plant: &Plant, who: ActorRef, other: TrackIx) -> bool {
    let ActorRef::Track(own) = who else { return false };
    let rows = &plant.rows;
    let meet = |k: usize| {
        let (Some(a), Some(b)) = (rows.find(k, own), rows.find(k, other)) else { return false };
        let ends = [(rows.place(a), rows.next_place(k, a)), (rows.place(b), rows.next_place(k, b))];
        let at = |which: usize, j: usize| ends[which].0.towards(&ends[which].1, j as f64 / SUBSTEPS as f64);
        (0..=SUBSTEPS).any(|j| plant.sizes[own].at(at(0, j)).overlaps(&plant.sizes[other].at(at(1, j))))
    };
    (0..=plant.steps()).any(meet)
}
