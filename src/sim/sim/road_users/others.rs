//! Everyone but the ego at one decision step: replayed rows of the plant, and simulated road users.

use crate::kernel::Vec2;
use crate::sim::prepared::body::Size;
use crate::sim::prepared::plant::Plant;
use crate::sim::prepared::rows::Rows;

use super::actors::Actor;
use super::intervention::ActorRef;

/// The buffers of a rollout; reused, so that a step allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct Others {
    /// Adversaries first (in the order of the actions), then traffic in the order in which it turns reactive.
    pub(in crate::sim) actors: Vec<Actor>,
    /// True for tracks that are simulated: their recorded rows are passed over.
    pub(in crate::sim) simulated: Vec<bool>,
}

/// Another road user as the ego sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// The road user.
    pub actor: ActorRef,
    /// The centre of its box, metres.
    pub position: Vec2,
    /// Heading as a vector of length 1.
    pub axis: Vec2,
    /// Velocity in the scene's frame, m/s.
    pub velocity: Vec2,
    /// Its box.
    pub size: Size,
}

/// Someone near a place; the velocity of a recorded road user lies in the scene and is fetched when it is asked for.
pub(in crate::sim) struct Near<'a> {
    pub who: ActorRef,
    pub position: Vec2,
    pub axis: Vec2,
    pub size: &'a Size,
    motion: Motion<'a>,
}

enum Motion<'a> {
    Recorded { rows: &'a Rows, k: usize, row: usize },
    Simulated(Vec2),
}

impl Near<'_> {
    pub fn velocity(&self) -> Vec2 {
        match self.motion {
            Motion::Recorded { rows, k, row } => rows.sample(k, row).velocity,
            Motion::Simulated(velocity) => velocity,
        }
    }
}

impl Others {
    /// Calls `f` for everyone present whose centre lies within `radius_m` of `center`: recorded ones by x, then simulated
    /// ones.
    pub(in crate::sim) fn for_each_near<'a>(
        &'a self,
        plant: &'a Plant,
        k: usize,
        center: Vec2,
        radius_m: f64,
        mut f: impl FnMut(&Near<'a>),
    ) {
        let rows = &plant.rows;
        let squared = radius_m * radius_m;
        for row in rows.strip(k, center.x, radius_m) {
            let (dx, dy) = (rows.x[row] - center.x, rows.y[row] - center.y);
            if dx * dx + dy * dy > squared {
                continue;
            }
            let track = rows.track[row] as usize;
            if self.simulated[track] {
                continue;
            }
            f(&Near {
                who: ActorRef::Track(track),
                position: Vec2::new(rows.x[row], rows.y[row]),
                axis: rows.axis[row],
                size: &plant.sizes[track],
                motion: Motion::Recorded { rows, k, row },
            });
        }
        for actor in &self.actors {
            let Some(now) = &actor.now else { continue };
            if (now.position - center).norm_squared() <= squared {
                f(&Near {
                    who: actor.who,
                    position: now.position,
                    axis: actor.axis,
                    size: &actor.size,
                    motion: Motion::Simulated(now.velocity),
                });
            }
        }
    }

    /// Does the same as [`Others::for_each_near`] with everything that a driver may see.
    pub(in crate::sim) fn for_each_within(
        &self,
        plant: &Plant,
        k: usize,
        center: Vec2,
        radius_m: f64,
        mut f: impl FnMut(&Seen),
    ) {
        self.for_each_near(plant, k, center, radius_m, |near| {
            let (position, axis, velocity) = (near.position, near.axis, near.velocity());
            f(&Seen { actor: near.who, position, axis, velocity, size: *near.size });
        });
    }
}
