//! KING's solvability run: could a rule expert that knows where every adversary will be have got through? The expert
//! stays on the way that the ego took undisturbed and chooses how fast: on as it was, braking from some moment on, or
//! faster. A scene is solvable if one of these ways touches nobody.
//!
//! In KING the expert is CARLA's rule-based driver with privileged knowledge, which likewise follows the route and
//! brakes for forecast contact; only scenes that it solves are kept ("hard but solvable").

use crate::kernel::OrientedBox;
use crate::scene::{DT_S, Sample};
use crate::search::descent::{Mover, covered};
use crate::stage::{Bystanders, Situation};

/// Decelerations that the expert brakes with, m/s².
const BRAKING_MPS2: [f64; 3] = [3.0, 5.0, 8.0];
/// Accelerations with which it gets away, m/s².
const HURRY_MPS2: [f64; 2] = [1.5, 3.0];
/// It begins to brake now or a multiple of this later, steps.
const ONSET_STEPS: usize = 5;
/// Road users farther than this from the whole undisturbed way are ignored, metres.
const NEAR_M: f64 = 40.0;

/// Returns `true` if the rule expert gets through the movers' motions and the recorded traffic without contact.
pub fn solves(situation: &Situation, movers: &[Mover], bystanders: &Bystanders) -> bool {
    let steps = covered(movers);
    let first = steps.start.saturating_sub(1);
    let way: Vec<Sample> = (first..steps.end).map_while(|step| situation.ego.at(step).copied()).collect();
    if way.len() < 2 {
        return true;
    }
    let task = Task::new(situation, movers, bystanders, first, way);
    if task.is_free(|_| 0.0) {
        return true;
    }
    let onsets = || (0..task.way.len()).step_by(ONSET_STEPS);
    let brakes = |onset: usize| BRAKING_MPS2.iter().any(|by| task.is_free(|k| if k < onset { 0.0 } else { -*by }));
    onsets().any(brakes) || HURRY_MPS2.iter().any(|by| task.is_free(|_| *by))
}

/// Obstacles in the expert's way.
struct Task {
    way: Vec<Sample>,
    /// Way driven up to each sample, metres.
    lengths: Vec<f64>,
    /// Boxes near the way at every step after the first.
    obstacles: Vec<Vec<OrientedBox>>,
    length_m: f64,
    width_m: f64,
}

impl Task {
    fn new(situation: &Situation, movers: &[Mover], bystanders: &Bystanders, first: usize, way: Vec<Sample>) -> Task {
        let makes_way = bystanders.making_way(situation, first, &way[0], way.len() - 1);
        let near = |body: &OrientedBox| way.iter().any(|sample| sample.position.distance(body.center) < NEAR_M);
        let at = |k: usize| {
            let step = first + k;
            let driven = movers.iter().filter_map(|mover| mover.body_at(situation, step));
            let recorded = bystanders.at(step).iter().filter(|(ix, _)| !makes_way.contains(ix)).map(|(_, body)| *body);
            driven.chain(recorded).filter(near).collect()
        };
        let obstacles = (1..way.len()).map(at).collect();
        let mut lengths = vec![0.0];
        for pair in way.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + pair[0].position.distance(pair[1].position));
        }
        let (length_m, width_m) = (situation.ego.length_m, situation.ego.width_m);
        Task { way, lengths, obstacles, length_m, width_m }
    }

    /// Returns `true` if nobody is touched when the ego drives its way with this added to what it did, m/s² at each step.
    fn is_free(&self, added_mps2: impl Fn(usize) -> f64) -> bool {
        let (mut gained_mps, mut way_m) = (0.0, 0.0);
        let mut piece = 0;
        for (k, near) in self.obstacles.iter().enumerate() {
            gained_mps += added_mps2(k) * DT_S;
            let undisturbed_mps = (self.lengths[k + 1] - self.lengths[k]) / DT_S;
            // A standing ego that is told to brake does not remember it.
            gained_mps = f64::max(gained_mps, -undisturbed_mps);
            way_m += (undisturbed_mps + gained_mps) * DT_S;
            let body = self.body_at(way_m, &mut piece);
            let touches = |other: &OrientedBox| {
                let reach = body.radius() + other.radius();
                (body.center - other.center).norm_squared() < reach * reach && body.overlaps(other)
            };
            if near.iter().any(touches) {
                return false;
            }
        }
        true
    }

    /// The ego after a way; straight on beyond the way's end. `piece` is where the last look was and only grows.
    fn body_at(&self, way_m: f64, piece: &mut usize) -> OrientedBox {
        let last = self.way.len() - 1;
        while *piece + 1 < last && self.lengths[*piece + 1] <= way_m {
            *piece += 1;
        }
        let (from, to) = (&self.way[*piece], &self.way[*piece + 1]);
        let length = self.lengths[*piece + 1] - self.lengths[*piece];
        let left = way_m - self.lengths[*piece];
        let position = if left <= length {
            from.position.lerp(to.position, left / length.max(1e-9))
        } else {
            to.position + crate::kernel::Vec2::from_heading(to.heading_rad) * (left - length)
        };
        OrientedBox::new(position, from.heading_rad, self.length_m, self.width_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::Policy;
    use crate::kernel::Vec2;
    use crate::motion::Drive;
    use crate::motion::bicycle::State;
    use crate::scene::fixture::two_lane_scene;
    use std::sync::Arc;

    /// The second car of the fixture as a box that `at` places at every step.
    fn solved(at: impl Fn(usize, &Sample) -> Vec2) -> bool {
        let situation = Situation::new(Arc::new(two_lane_scene()), &Policy::Idm).unwrap();
        let state = |k: usize| {
            let position = at(k, situation.ego.at(k).unwrap_or(&Sample::default()));
            State { position, heading_rad: 0.0, speed_mps: 0.0 }
        };
        let states: Vec<State> = (0..31).map(state).collect();
        let boxes = states.iter().map(|s| situation.body(1, &s.sample())).collect();
        let mover = Mover {
            actor: 1,
            from_step: 1,
            place: vec![],
            drive: Drive { controls: vec![], states, turns: vec![] },
            boxes,
        };
        let bystanders = Bystanders::of(&situation, &[0, 1], 1..31);
        solves(&situation, &[mover], &bystanders)
    }

    #[test]
    fn the_expert_brakes_for_who_stands_in_its_way_if_there_is_room() {
        assert!(solved(|_, ego| ego.position + Vec2::new(0.0, 30.0)));
        assert!(solved(|_, _| Vec2::new(45.0, 0.0)));
        // Three metres before its bumper nobody can stop.
        assert!(!solved(|_, _| Vec2::new(17.0, 0.0)));
    }

    #[test]
    fn who_follows_the_ego_wherever_it_goes_cannot_be_escaped() {
        assert!(!solved(|k, ego| if k == 0 { Vec2::new(-60.0, 0.0) } else { ego.position }));
    }
}
