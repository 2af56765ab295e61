//! Everyone but the ego at one decision step: replayed rows of the plant, and simulated road users.

use crate::kernel::Vec2;

use super::actors::Actor;
use super::driver::Seen;
use super::intervention::ActorRef;
use super::plant::Plant;

/// The buffers of a rollout; reused, so that a step allocates nothing.
#[derive(Clone, Debug, Default)]
pub struct World {
    /// Adversaries first (in the order of the actions), then reactive traffic as it turns so.
    pub(super) actors: Vec<Actor>,
    /// Tracks that are simulated: their recorded rows are passed over.
    pub(super) simulated: Vec<bool>,
}

impl World {
    /// Calls `f` for everyone present whose centre lies within `radius_m` of `center`: recorded ones by x, then simulated
    /// ones.
    pub(super) fn for_each_within(
        &self,
        plant: &Plant,
        k: usize,
        center: Vec2,
        radius_m: f64,
        mut f: impl FnMut(&Seen),
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
            f(&Seen {
                actor: ActorRef::Track(track),
                position: Vec2::new(rows.x[row], rows.y[row]),
                axis: rows.axis[row],
                velocity: rows.velocity[row],
                size: plant.sizes[track],
            });
        }
        for actor in &self.actors {
            let Some(now) = &actor.now else { continue };
            if (now.position - center).norm_squared() <= squared {
                f(&Seen {
                    actor: actor.who,
                    position: now.position,
                    axis: actor.axis,
                    velocity: now.velocity,
                    size: actor.size,
                });
            }
        }
    }
}
