//! KING's loss: mean over time of the least distance from the ego's corners to an adversary, plus the mean Gaussian
//! off-road cost of all adversaries, minus the least distance between two adversaries, capped, plus the deepest approach of
//! each adversary to a bystander. As in KING a rollout is broken off where an adversary leaves the road or runs into
//! another one; nothing after that counts.

use crate::kernel::{OrientedBox, Vec2, num};
use crate::motion::kinematics::Slope;
use crate::motion::separation::{box_to_box, disc_overlap, on_body, point_to_box};
use crate::search::descent::{Asked, Mover, Objective, Slopes, Terms, covered};
use crate::stage::road_field::{RoadField, gaussian_mass, gaussian_pull, gaussian_reach_m};
use crate::stage::{Bystanders, EgoPath};

/// Which adversaries the ego attracts at each time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attraction {
    /// The adversary that is nearest, its distance divided by its weight.
    Nearest,
    /// All, by weight.
    Everyone,
}

/// The loss of one scene.
#[derive(Clone, Debug)]
pub struct Loss<'a> {
    pub pursuit: Attraction,
    /// One a mover, above 0.
    pub pursuer_weights: Vec<f64>,
    pub attraction_weight: f64,
    pub departure_weight: f64,
    pub departure_sigma_m: f64,
    pub repulsion_weight: f64,
    pub repulsion_m_max: f64,
    /// Weight of the deepest approach of each adversary to a bystander, within `repulsion_m_max` beside both bodies.
    pub bystander_weight: f64,
    pub bystanders: &'a Bystanders,
    /// `None`: nothing is off the road.
    pub field: Option<&'a RoadField>,
    /// How far a corner of each mover may be off the road, metres: see [`departures_allowed_m`].
    pub off_road_m_max: Vec<f64>,
    /// True if the movers overlap each other where they follow their records.
    pub overlapping_at_record: bool,
}

/// A corner may be off the road by this much more than in the record: the field is right to half a cell's diagonal, metres.
const OFF_ROAD_M: f64 = 0.5;

/// How far each mover may leave the road: as far as where it follows its record, and half a metre.
pub fn departures_allowed_m(field: Option<&RoadField>, at_record: &[Mover]) -> Vec<f64> {
    let deepest = |mover: &Mover| mover.boxes.iter().map(|body| off_road_m(field, body)).fold(0.0, f64::max);
    at_record.iter().map(|mover| deepest(mover) + OFF_ROAD_M).collect()
}

/// Depth of a body's outermost corner beside the road, metres; 0 on it.
fn off_road_m(field: Option<&RoadField>, body: &OrientedBox) -> f64 {
    field.map_or(0.0, |field| field.departure_m(body))
}

/// Returns `true` if two movers overlap at a scene step.
fn overlap_at(movers: &[Mover], step: usize) -> bool {
    let body = |mover: &Mover| mover.index(step).map(|k| mover.boxes[k]);
    let pairs = movers.iter().enumerate().flat_map(|(i, one)| movers[i + 1..].iter().map(move |other| (one, other)));
    pairs.filter_map(|(one, other)| Some((body(one)?, body(other)?))).any(|(a, b)| {
        let reach = a.radius() + b.radius();
        (a.center - b.center).norm_squared() < reach * reach && a.overlaps(&b)
    })
}

/// Returns `true` if movers run into each other at any time.
pub fn overlap(movers: &[Mover]) -> bool {
    covered(movers).any(|step| overlap_at(movers, step))
}

/// Points of a vehicle whose ground counts, metres along and across.
const FEET_M: [(f64, f64); 4] = [(2.5, 1.0), (2.5, -1.0), (-2.5, 1.0), (-2.5, -1.0)];
/// KING sums every second pixel of its raster in both directions: a quarter of the Gaussian's mass.
const RASTER_SHARE: f64 = 0.25;

impl Objective for Loss<'_> {
    /// The attack keeps its slopes while the ego is being met: KING's loss knows no other term that moves an adversary
    /// on free road.
    fn loss(&self, asked: &Asked<'_>, slopes: &mut Slopes) -> Terms {
        let (movers, until) = (asked.movers, asked.until);
        Terms {
            attack: self.attraction(movers, asked.ego, until, slopes),
            rest: self.departure(movers, until, asked.is_eligible, slopes)
                + self.repulsion(movers, until, slopes)
                + self.bystanders(movers, until, slopes),
        }
    }

    fn broken_off(&self, movers: &[Mover]) -> Option<usize> {
        let left = |step: usize| {
            let mut with_bound = movers.iter().zip(&self.off_road_m_max);
            with_bound.any(|(m, most)| m.index(step).is_some_and(|k| off_road_m(self.field, &m.boxes[k]) > *most))
        };
        covered(movers).find(|step| left(*step) || (!self.overlapping_at_record && overlap_at(movers, *step)))
    }
}

impl Loss<'_> {
    /// The value of whole motions against an ego's path; its slopes at the movers' states are added to `slopes`.
    pub fn of(&self, movers: &[Mover], ego: &EgoPath, slopes: &mut Slopes) -> f64 {
        self.loss(&Asked { movers, ego, until: usize::MAX, attacks: true, is_eligible: true }, slopes).total()
    }

    fn attraction(&self, movers: &[Mover], ego: &EgoPath, until: usize, slopes: &mut Slopes) -> f64 {
        let known = ego.steps();
        let steps = covered(movers);
        let steps = steps.start.max(known.start)..steps.end.min(known.end).min(until);
        let share = self.attraction_weight / steps.len().max(1) as f64;
        let total_weight: f64 = self.pursuer_weights.iter().sum();
        let mut value = 0.0;
        for step in steps {
            let Some(body) = ego.body(step) else { continue };
            let corners = body.corners();
            let mut least: Option<(f64, usize, usize, f64, Slope)> = None;
            for (which, mover) in movers.iter().enumerate() {
                let Some(index) = mover.index(step) else { continue };
                let (distance, slope) = corners_to_box(&corners, &mover.boxes[index]);
                let weight = self.pursuer_weights[which];
                if self.pursuit == Attraction::Everyone {
                    let part = share * weight / total_weight;
                    value += part * distance;
                    slopes.states[which][index].add(part, &slope);
                } else if least.as_ref().is_none_or(|l| distance / weight < l.0) {
                    least = Some((distance / weight, which, index, distance, slope));
                }
            }
            if let Some((_, which, index, distance, slope)) = least {
                value += share * distance;
                slopes.states[which][index].add(share, &slope);
            }
        }
        value
    }

    /// Up to and with the step at which the rollout is broken off, as KING's simulator sees it. The value costs as much as the
    /// slopes; where nobody needs it, it is 0.
    fn departure(&self, movers: &[Mover], until: usize, is_valued: bool, slopes: &mut Slopes) -> f64 {
        let Some(field) = self.field else { return 0.0 };
        let steps = covered(movers);
        // So deep in the road no foot costs anything: a raster's distances change by at most √2 a metre.
        let free_m = gaussian_reach_m(self.departure_sigma_m) + 1.5 * num::hypot(FEET_M[0].0, FEET_M[0].1);
        let share =
            self.departure_weight * RASTER_SHARE / steps.end.min(until).saturating_sub(steps.start).max(1) as f64;
        let mut value = 0.0;
        for (mover, slopes) in movers.iter().zip(&mut slopes.states) {
            let seen = until.saturating_sub(mover.from_step).saturating_add(1);
            for (body, slope) in mover.boxes.iter().zip(slopes).skip(1).take(seen) {
                if field.distance_m(body.center) > free_m {
                    continue;
                }
                for (along, across) in FEET_M {
                    let arm = body.axis * along + body.axis.left() * across;
                    let foot = body.center + arm;
                    let Some((t, pull)) = gaussian_pull(field, foot, self.departure_sigma_m) else { continue };
                    slope.add(share, &on_body(pull, arm));
                    if is_valued {
                        value += share * gaussian_mass(t);
                    }
                }
            }
        }
        value
    }

    fn repulsion(&self, movers: &[Mover], until: usize, slopes: &mut Slopes) -> f64 {
        let mut least: Option<(f64, [usize; 4], Slope, Slope)> = None;
        for (i, one) in movers.iter().enumerate() {
            for (j, other) in movers.iter().enumerate().skip(i + 1) {
                for step in one.steps().take_while(|step| *step <= until) {
                    let (Some(k), Some(l)) = (one.index(step), other.index(step)) else { continue };
                    let (a, b) = (&one.boxes[k], &other.boxes[l]);
                    let bound = least.as_ref().map_or(self.repulsion_m_max, |l| l.0);
                    let reach = a.radius() + b.radius() + bound;
                    if (a.center - b.center).norm_squared() > reach * reach {
                        continue;
                    }
                    let (distance, to_a, to_b) = box_to_box(a, b);
                    if distance < bound {
                        least = Some((distance, [i, k, j, l], to_a, to_b));
                    }
                }
            }
        }
        let Some((distance, [i, k, j, l], to_a, to_b)) = least else {
            return if movers.len() > 1 { -self.repulsion_weight * self.repulsion_m_max } else { 0.0 };
        };
        slopes.states[i][k].add(-self.repulsion_weight, &to_a);
        slopes.states[j][l].add(-self.repulsion_weight, &to_b);
        -self.repulsion_weight * distance
    }

    /// KING moves everybody, so that its repulsion covers all; here others only replay their records. Each mover pays for
    /// its deepest approach to one of them, and, unlike the capped distance, the deeper it is in the more.
    fn bystanders(&self, movers: &[Mover], until: usize, slopes: &mut Slopes) -> f64 {
        let mut value = 0.0;
        for (which, mover) in movers.iter().enumerate() {
            let mut deepest: Option<(f64, usize, Slope)> = None;
            for step in mover.steps().take_while(|step| *step <= until) {
                let Some(index) = mover.index(step) else { continue };
                for (_, other) in self.bystanders.at(step) {
                    let Some((overlap, own, _)) = disc_overlap(&mover.boxes[index], other, self.repulsion_m_max) else {
                        continue;
                    };
                    if deepest.as_ref().is_none_or(|d| overlap > d.0) {
                        deepest = Some((overlap, index, own));
                    }
                }
            }
            if let Some((overlap, index, slope)) = deepest {
                value += self.bystander_weight * overlap;
                slopes.states[which][index].add(self.bystander_weight, &slope);
            }
        }
        value
    }
}

/// Least distance of the ego's corners from an adversary's box: zero exactly when one touches it.
fn corners_to_box(corners: &[Vec2; 4], body: &OrientedBox) -> (f64, Slope) {
    let mut best = (f64::INFINITY, Slope::default());
    for corner in corners {
        let distance = point_to_box(*corner, body);
        if distance.0 < best.0 {
            best = distance;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::actions::ActionSpace;
    use super::*;
    use crate::ego::Policy;
    use crate::motion::Driven;
    use crate::motion::{Window, following};
    use crate::scene::fixture::two_lane_scene;
    use crate::search::descent::{open, slope_error};
    use crate::stage::road_field::gaussian_departure;
    use crate::stage::{Part, Situation};
    use std::sync::Arc;

    fn situation() -> Situation {
        Situation::new(Arc::new(two_lane_scene()), &Policy::Idm).unwrap()
    }

    fn parts(situation: &Situation) -> Vec<Part> {
        let part = |actor: usize| {
            let window = Window { from_step: 1, steps: 30 };
            let mut part = Part { actor, window, candidates: vec![], offsets: None, driven: None, simulated: 0 };
            let (start, samples) = following::record(&situation.scene.tracks[actor], window).unwrap();
            let space: Arc<dyn Driven> = Arc::new(ActionSpace::following(start, &samples, 0.25, 3.0, 4.952399));
            open(&mut part, situation, Some(space));
            part
        };
        vec![part(0), part(1)]
    }

    fn loss<'a>(situation: &'a Situation, bystanders: &'a Bystanders, pursuit: Attraction) -> Loss<'a> {
        Loss {
            pursuit,
            pursuer_weights: vec![1.0, 1.3],
            attraction_weight: 1.0,
            departure_weight: 23.0,
            departure_sigma_m: 1.0,
            repulsion_weight: 5.0,
            repulsion_m_max: 30.0,
            bystander_weight: 5.0,
            bystanders,
            field: situation.road_field(),
            off_road_m_max: vec![OFF_ROAD_M; 2],
            overlapping_at_record: false,
        }
    }

    #[test]
    fn the_whole_losss_slope_matches_finite_differences_through_the_bicycle() {
        let (situation, shift) = (situation(), |k: usize| 0.02 * ((k % 7) as f64 - 2.5));
        let parts = parts(&situation);
        let bystanders = Bystanders::of(&situation, &[0, 1], 1..31);
        for pursuit in [Attraction::Nearest, Attraction::Everyone] {
            let loss = loss(&situation, &bystanders, pursuit);
            let error = slope_error(&situation, &parts, shift, |m, slopes| loss.of(m, &situation.ego, slopes));
            assert!(error < 1e-5, "{pursuit:?}: {error}");
        }
    }

    #[test]
    fn skipping_bodies_deep_in_the_road_changes_no_bit_of_the_off_road_cost() {
        let situation = situation();
        let parts = parts(&situation);
        let bystanders = Bystanders::of(&situation, &[0, 1], 1..31);
        let field = situation.road_field().unwrap();
        let (mut costly, mut free) = (0, 0);
        for (steering, sigma_m) in [(-0.2, 1.0), (-0.05, 0.3), (0.0, 0.3), (0.1, 0.4), (0.2, 3.0)] {
            let loss = Loss { departure_sigma_m: sigma_m, ..loss(&situation, &bystanders, Attraction::Nearest) };
            let moved = |part: &Part| {
                let space = part.driven.as_deref().unwrap();
                let place = space.start().iter().enumerate().map(|(k, x)| x + if k % 2 == 0 { steering } else { 0.0 });
                Mover::new(&situation, part, space, place.collect())
            };
            let movers: Vec<Mover> = parts.iter().map(moved).collect();
            let share = loss.departure_weight * RASTER_SHARE / covered(&movers).len() as f64;
            let (mut fast, mut plain) = (Slopes::of(&movers), Slopes::of(&movers));
            let mut value = 0.0;
            for (mover, slopes) in movers.iter().zip(&mut plain.states) {
                for (body, slope) in mover.boxes.iter().zip(slopes).skip(1) {
                    for (along, across) in FEET_M {
                        let arm = body.axis * along + body.axis.left() * across;
                        let (cost, pull) = gaussian_departure(field, body.center + arm, sigma_m);
                        value += share * cost;
                        slope.add(share, &on_body(pull, arm));
                        *(if cost > 0.0 { &mut costly } else { &mut free }) += 1;
                    }
                }
            }
            assert_eq!(loss.departure(&movers, usize::MAX, true, &mut fast), value, "{steering} {sigma_m}");
            assert_eq!(fast.states, plain.states, "{steering} {sigma_m}");
            let mut unvalued = Slopes::of(&movers);
            assert_eq!(loss.departure(&movers, usize::MAX, false, &mut unvalued), 0.0);
            assert_eq!(unvalued.states, plain.states, "{steering} {sigma_m}");
        }
        assert!(costly > 50 && free > 50, "{costly} {free}");
    }

    #[test]
    fn the_terms_by_hand() {
        let (body, corner) = (OrientedBox::new(Vec2::ZERO, 0.0, 4.0, 2.0), Vec2::new(5.0, 5.0));
        let corners = [corner, corner + Vec2::new(2.0, 0.0), Vec2::new(9.0, 9.0), Vec2::new(-9.0, 9.0)];
        // From (2, 1): 3 and 4.
        assert_eq!(corners_to_box(&corners, &body).0, 5.0);
        assert_eq!(corners_to_box(&[Vec2::new(1.0, 0.5), corner, corner, corner], &body).0, 0.0);
    }
}
