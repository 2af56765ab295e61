//! STRIVE's solution pass: is there a motion of the ego, near the one it would drive undisturbed, that touches nobody?
//! Searched by Adam over the ego's own latent, from its undisturbed motion, from braking and from driving on faster.

use super::loss::beside_road;
use crate::kernel::OrientedBox;
use crate::motion::Driven;
use crate::motion::bicycle::State;
use crate::motion::kinematics::Slope;
use crate::motion::latent::{LatentOptions, LatentSpace};
use crate::motion::separation::disc_overlap;
use crate::scene::Sample;
use crate::search::adam::{Adam, Rates};
use crate::search::descent::{Mover, covered};
use crate::stage::{Bystanders, Situation};

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
/// Road users farther than this from the undisturbed ego cannot be met, metres.
const NEAR_M: f64 = 40.0;

/// Returns `true` if the ego can get through the movers' motions and the recorded traffic without contact.
pub fn exists(situation: &Situation, movers: &[Mover], others: &Bystanders, solution: &Solution) -> bool {
    Solver::new(situation, others, *solution).solves(movers)
}

/// The pass over several motions of the same movers: a way that got through one of them is tried first on the next, for
/// neighbouring iterates of a search differ little.
#[derive(Debug)]
pub struct Solver<'a> {
    situation: &'a Situation,
    others: &'a Bystanders,
    solution: Solution,
    /// The ego's boxes along every way found so far.
    known: Vec<Vec<OrientedBox>>,
}

impl<'a> Solver<'a> {
    pub fn new(situation: &'a Situation, others: &'a Bystanders, solution: Solution) -> Solver<'a> {
        Solver { situation, others, solution, known: vec![] }
    }

    /// Returns `true` if the ego can get through without contact.
    pub fn solves(&mut self, movers: &[Mover]) -> bool {
        let steps = covered(movers);
        let first = steps.start.saturating_sub(1);
        let Some(start) = self.situation.ego.at(first) else { return false };
        let undisturbed: Vec<Sample> = steps.map_while(|step| self.situation.ego.at(step).copied()).collect();
        if undisturbed.is_empty() {
            return true;
        }
        let task = Task::new(self.situation, movers, self.others, first, start, &undisturbed);
        if self.known.iter().any(|boxes| task.is_free(boxes)) {
            return true;
        }
        let space = LatentSpace::new(State::of(start), &undisturbed, &[], &LATENT);
        let solution =
            STARTS_MPS2.iter().find_map(|acceleration| task.solved_from(&space, *acceleration, &self.solution));
        let solved = solution.is_some();
        self.known.extend(solution);
        solved
    }
}

/// Obstacles in the ego's way.
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
        others: &Bystanders,
        first: usize,
        start: &Sample,
        undisturbed: &[Sample],
    ) -> Task<'a> {
        let makes_way = others.making_way(situation, first, start, undisturbed.len());
        let near = |k: usize, body: &OrientedBox| body.center.distance(undisturbed[k].position) < NEAR_M;
        let at = |k: usize| {
            let step = first + 1 + k;
            let driven = movers.iter().filter_map(|m| m.body_at(situation, step));
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
        self.situation.road_field().map_or(0.0, |field| field.departure_m(body))
    }

    /// The ego's boxes, its start first, along a way that touches nobody.
    fn solved_from(
        &self,
        space: &LatentSpace,
        acceleration_mps2: f64,
        solution: &Solution,
    ) -> Option<Vec<OrientedBox>> {
        let mut place = space.start().to_vec();
        place[0] += acceleration_mps2 / LATENT.acceleration_spread_mps2;
        let mut adam = Adam::new(solution.rates, place.len());
        for _ in 0..=solution.iterations {
            let drive = space.drive(&place);
            let boxes: Vec<OrientedBox> = drive.states.iter().map(|s| self.body(s)).collect();
            if self.is_free(&boxes) {
                return Some(boxes);
            }
            let mut slope = space.pull(&drive, &self.slopes(&boxes, solution.buffer_m));
            slope.iter_mut().zip(&place).for_each(|(slope, z)| *slope += WEIGHTS.2 * z);
            adam.step(&mut place, &slope);
        }
        None
    }

    /// Returns `true` if no box after the start touches anyone or leaves the road too far.
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
