//! STRIVE's solution pass: is there a motion of the ego, near the one it would drive undisturbed, that touches nobody?
//! Searched by Adam over the ego's own latent, from its undisturbed motion, from braking and from driving on faster.

use super::loss::{Others, beside_road};
use crate::kernel::{OrientedBox, Pose};
use crate::motion::Driven;
use crate::motion::bicycle::State;
use crate::motion::kinematics::Slope;
use crate::motion::latent::{LatentOptions, LatentSpace};
use crate::motion::separation::disc_overlap;
use crate::scene::{Sample, TrackIx};
use crate::search::adam::{Adam, Rates};
use crate::search::descent::{Mover, covered};
use crate::stage::Situation;

/// How the pass runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    pub iterations: usize,
    pub rates: Rates,
    pub buffer_m: f64,
}

/// Spreads of the ego's latent: STRIVE's acceleration, and a curvature that moves it a lane within some seconds.
const LATENT: LatentOptions = LatentOptions { modes: 4, acceleration_spread_mps2: 1.05, curvature_spread_1pm: 0.005 };
/// Mean accelerations that the pass starts from, m/s².
const STARTS_MPS2: [f64; 3] = [0.0, -4.0, 1.5];
/// Weights of contact, road and likelihood (coll_veh, coll_env, prior).
const WEIGHTS: (f64, f64, f64) = (10.0, 10.0, 0.005);
/// A corner may leave the road this much farther than the undisturbed ego does, metres.
const OFF_ROAD_M: f64 = 0.5;
/// MetaDrive's reactive traffic: this far behind the ego, and no farther aside, others make way for it, metres.
const BEHIND_M: f64 = 1.0;
const ASIDE_M: f64 = 15.0;
/// Who is farther than this from the undisturbed ego cannot be met, metres.
const NEAR_M: f64 = 40.0;

/// Whether the ego can get through the movers' motions and the recorded traffic without contact.
pub fn exists(situation: &Situation, movers: &[Mover], others: &Others, solution: &Solution) -> bool {
    let steps = covered(movers);
    let first = steps.start.saturating_sub(1);
    let Some(start) = situation.ego.at(first) else { return false };
    let undisturbed: Vec<Sample> = steps.map_while(|step| situation.ego.at(step).copied()).collect();
    if undisturbed.is_empty() {
        return true;
    }
    let task = Task::new(situation, movers, others, first, start, &undisturbed);
    let space = LatentSpace::new(State::of(start), &undisturbed, &[], &LATENT);
    STARTS_MPS2.iter().any(|acceleration| task.solved_from(&space, *acceleration, solution))
}

/// What is in the ego's way.
struct Task<'a> {
    situation: &'a Situation,
    /// Boxes near the ego at every step after the start.
    obstacles: Vec<Vec<OrientedBox>>,
    off_road_m_max: f64,
}

impl<'a> Task<'a> {
    fn new(
        situation: &'a Situation,
        movers: &[Mover],
        others: &Others,
        first: usize,
        start: &Sample,
        undisturbed: &[Sample],
    ) -> Task<'a> {
        let makes_way = yielding(situation, others, first, start, undisturbed.len());
        let near = |k: usize, body: &OrientedBox| body.center.distance(undisturbed[k].position) < NEAR_M;
        let at = |k: usize| {
            let step = first + 1 + k;
            let driven = movers.iter().filter_map(|m| mover_box(situation, m, step));
            let recorded = others.at(step).iter().filter(|(ix, _)| !makes_way.contains(ix)).map(|(_, body)| *body);
            driven.chain(recorded).filter(|body| near(k, body)).collect()
        };
        let mut task = Task { situation, obstacles: (0..undisturbed.len()).map(at).collect(), off_road_m_max: 0.0 };
        let depths = undisturbed.iter().map(|s| task.off_road_m(&task.body(&State::of(s))));
        task.off_road_m_max = depths.fold(0.0, f64::max) + OFF_ROAD_M;
        task
    }

    fn body(&self, state: &State) -> OrientedBox {
        let track = &self.situation.scene.ego.track;
        OrientedBox::new(state.position, state.heading_rad, track.length_m, track.width_m)
    }

    fn off_road_m(&self, body: &OrientedBox) -> f64 {
        let Some(field) = self.situation.road_field() else { return 0.0 };
        body.corners().iter().map(|c| -field.at(*c).0).fold(0.0, f64::max)
    }

    fn solved_from(&self, space: &LatentSpace, acceleration_mps2: f64, solution: &Solution) -> bool {
        let mut place = space.start().to_vec();
        place[0] += acceleration_mps2 / LATENT.acceleration_spread_mps2;
        let mut adam = Adam::new(solution.rates, place.len());
        for _ in 0..=solution.iterations {
            let states = space.states(&place);
            let boxes: Vec<OrientedBox> = states.iter().map(|s| self.body(s)).collect();
            if self.is_free(&boxes) {
                return true;
            }
            let mut slope = space.pull(&place, &states, &self.slopes(&boxes, solution.buffer_m));
            slope.iter_mut().zip(&place).for_each(|(slope, z)| *slope += WEIGHTS.2 * z);
            adam.step(&mut place, &slope);
        }
        false
    }

    /// Whether no box after the start touches anyone or leaves the road too far.
    fn is_free(&self, boxes: &[OrientedBox]) -> bool {
        let clear = |(body, near): (&OrientedBox, &Vec<OrientedBox>)| {
            let apart = |other: &OrientedBox| {
                let reach = body.radius() + other.radius();
                (body.center - other.center).norm_squared() > reach * reach || !body.overlaps(other)
            };
            near.iter().all(apart)
        };
        boxes[1..].iter().zip(&self.obstacles).all(clear)
            && boxes[1..].iter().step_by(2).all(|body| self.off_road_m(body) <= self.off_road_m_max)
    }

    fn slopes(&self, boxes: &[OrientedBox], buffer_m: f64) -> Vec<Slope> {
        let mut slopes = vec![Slope::default(); boxes.len()];
        for ((body, near), slope) in boxes.iter().skip(1).zip(&self.obstacles).zip(&mut slopes[1..]) {
            for other in near {
                if let Some((_, own, _)) = disc_overlap(body, other, buffer_m) {
                    slope.add(WEIGHTS.0, &own);
                }
            }
            if let Some(field) = self.situation.road_field() {
                beside_road(field, body, WEIGHTS.1, slope);
            }
        }
        slopes
    }
}

/// Recorded road users that would not be in the way in a simulation: those behind the ego, which follow it, and those
/// that the undisturbed ego passes through (overlaps of the recording, which the simulator spares).
fn yielding(situation: &Situation, others: &Others, first: usize, start: &Sample, count: usize) -> Vec<TrackIx> {
    let frame = Pose { position: start.position, heading_rad: start.heading_rad };
    let follows = |body: &OrientedBox| {
        let local = frame.to_local(body.center);
        local.x < -BEHIND_M && local.y.abs() < ASIDE_M
    };
    let mut found: Vec<TrackIx> =
        others.at(first + 1).iter().filter(|(_, body)| follows(body)).map(|(ix, _)| *ix).collect();
    for step in first + 1..first + 1 + count {
        let Some(ego) = situation.ego.body(step) else { break };
        found.extend(others.at(step).iter().filter(|(_, body)| ego.overlaps(body)).map(|(ix, _)| *ix));
    }
    found
}

/// A mover's box at a scene step: its record before the window, its last velocity kept after it.
fn mover_box(situation: &Situation, mover: &Mover, step: usize) -> Option<OrientedBox> {
    if let Some(index) = mover.index(step) {
        return Some(mover.boxes[index]);
    }
    let Some(late) = step.checked_sub(mover.steps().end) else {
        return situation.scene.tracks[mover.actor].at(step).map(|s| situation.body(mover.actor, s));
    };
    let [.., before, last] = mover.boxes.as_slice() else { return None };
    Some(OrientedBox { center: last.center + (last.center - before.center) * (late + 1) as f64, ..*last })
}
