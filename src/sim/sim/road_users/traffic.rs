//! Traffic that reacts: MetaDrive's rule for who turns reactive, and IDM along the recorded path.
//!
//! A moving vehicle that appears behind the ego (more than 1 m back, within 15 m to the side, headings less than 90°
//! apart, at least 5 m of recorded path) follows its recorded path by IDM instead of the clock, and leaves 2 m before
//! the path's end. The rule is applied once, when it appears. MetaDrive renews a car's throttle every fifth decision
//! step to save time; here it is renewed at each.

use crate::kernel::{Vec2, num};
use crate::sim::prepared::path::{Along, Path};
use crate::sim::prepared::plant::Plant;

use super::actors::{Actor, Mind};
use super::driver::EgoState;
use super::idm::{self, Front, NORMAL_SPEED_KMPH, SIGHT_M};
use super::others::Others;

const BEHIND_M: f64 = 1.0;
const SIDE_M: f64 = 15.0;

/// Turns those reactive that appear behind the ego at the k-th step.
pub(in crate::sim) fn wake(plant: &Plant, world: &mut Others, ego: &EgoState, k: usize, replays: bool) {
    if !plant.options().plant.reactive_traffic.is_on(replays) || k >= plant.steps() {
        return;
    }
    for (index, candidate) in plant.candidates[k].iter().enumerate() {
        let row = candidate.row as usize;
        let track = plant.rows.track[row] as usize;
        let delta = plant.rows.place(row).position - ego.sample.position;
        let behind = delta.dot(ego.axis) < -BEHIND_M && ego.axis.cross(delta).abs() < SIDE_M;
        let turn = num::wrap_angle(plant.rows.sample(k, row).heading_rad - ego.sample.heading_rad).abs();
        if behind && turn < num::FRAC_PI_2 && !world.simulated[track] {
            world.simulated[track] = true;
            world.actors.push(Actor::reacting(plant, k, index));
        }
    }
}

/// Sets the throttle of every reactive road user from what it sees at the k-th step.
pub(in crate::sim) fn decide(plant: &Plant, world: &mut Others, ego: &EgoState, k: usize) {
    for own in 0..world.actors.len() {
        let actor = &world.actors[own];
        let (Mind::Path { born, index, along, speed_mps, .. }, Some(now)) = (&actor.mind, &actor.now) else {
            continue;
        };
        let path = &plant.candidates[*born][*index].path;
        let front = front_of(plant, world, ego, k, own, path, along, now.position);
        let wanted = idm::throttle(*speed_mps, now.velocity, actor.axis, NORMAL_SPEED_KMPH, front.as_ref());
        if let Mind::Path { throttle, .. } = &mut world.actors[own].mind {
            *throttle = wanted;
        }
    }
}

/// The nearest road user ahead on a reactive one's path, the ego included; the first of equals.
#[allow(clippy::too_many_arguments)]
fn front_of(
    plant: &Plant,
    world: &Others,
    ego: &EgoState,
    k: usize,
    own: usize,
    path: &Path,
    along: &Along,
    position: Vec2,
) -> Option<Front> {
    let who = world.actors[own].who;
    let obstacle = plant.options().plant.obstacle;
    let mut nearest = None;
    world.for_each_near(plant, k, position, SIGHT_M, |near| {
        if near.who != who {
            idm::nearer(&mut nearest, path, along, near.position, near.axis, || near.velocity(), near.size, obstacle);
        }
    });
    if ego.sample.position.distance(position) <= SIGHT_M {
        let seen = &ego.sample;
        idm::nearer(&mut nearest, path, along, seen.position, ego.axis, || seen.velocity, &ego.size, obstacle);
    }
    nearest
}
