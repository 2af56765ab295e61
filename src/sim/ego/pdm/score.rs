//! Score of a proposal: is nobody struck, does it stay on the road and in its direction, how far does it come, how near is
//! a collision, is it comfortable (`PDMScorer`).

use super::areas::{Areas, areas};
use super::centreline::Centreline;
use super::comfort::Comfort;
use super::forecast::{Other, contact_kind};
use super::settings::{AHEAD_RAD, PROGRESS_MIN_M, STATES, STEP_S, Settings};
use super::simulated::{Car, State};
use crate::kernel::{Extent, OrientedBox};
use crate::sim::Plant;
use crate::sim::fault::{BEHIND_RAD, ContactKind, OTHER_STANDS_MPS, seen_at_rad};

/// Bound on the rounding error of a distance, metres.
const SLACK_M: f64 = 0.01;

/// The judgement of a proposal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// Product of the multipliers and weighted mean of the rest, 0 to 1.
    pub score: f64,
    /// Seconds to the first contact for which the ego is at fault.
    pub at_fault_s: Option<f64>,
}

/// Data by which all proposals of a decision are judged.
pub struct Judge<'a> {
    pub plant: &'a Plant,
    /// Lanes of the route. `[lanes]`
    pub on_route: &'a [bool],
    pub centreline: &'a Centreline,
    pub car: &'a Car,
    pub others: &'a [Other],
    pub comfort: &'a Comfort,
    pub settings: &'a Settings,
}

/// Measures of one proposal before it is compared with the others.
struct Parts {
    multiplier: f64,
    progress_m: f64,
    is_far_from_collision: bool,
    is_comfortable: bool,
    at_fault_s: Option<f64>,
}

impl Judge<'_> {
    /// Returns the judgements, in the order of the proposals.
    pub fn judged(&self, proposals: &[[State; STATES]]) -> Vec<Judgement> {
        let moving = self.moving();
        let parts: Vec<Parts> = proposals.iter().map(|states| self.parts(states, &moving)).collect();
        let worth = |part: &Parts| part.progress_m * part.multiplier;
        let best_m = parts.iter().map(worth).fold(0.0, f64::max);
        let judged = |part: &Parts| {
            let progress = if part.multiplier == 0.0 {
                0.0
            } else if best_m <= PROGRESS_MIN_M {
                1.0
            } else {
                worth(part) / best_m
            };
            let of = self.settings;
            let weights = of.progress_weight + of.time_to_collision_weight + of.comfort_weight;
            let sum = of.progress_weight * progress
                + of.time_to_collision_weight * f64::from(part.is_far_from_collision)
                + of.comfort_weight * f64::from(part.is_comfortable);
            Judgement { score: part.multiplier * sum / weights, at_fault_s: part.at_fault_s }
        };
        parts.iter().map(judged).collect()
    }

    fn parts(&self, states: &[State; STATES], moving: &[(&Other, Extent)]) -> Parts {
        let boxes = states.each_ref().map(|state| self.car.footprint(state.position, state.heading_rad));
        let areas = boxes.each_ref().map(|own| areas(self.plant, self.on_route, own));
        let near = self.near(moving, states, &boxes);
        let (struck, at_fault_s) = collisions(&near, states, &boxes, &areas);
        let on_road = f64::from(!areas.iter().any(|area| area.off_road));
        let (from_m, _) = self.centreline.project(boxes[0].center);
        let (to_m, _) = self.centreline.project(boxes[STATES - 1].center);
        Parts {
            multiplier: struck * on_road * self.direction(&boxes, &areas),
            progress_m: (to_m - from_m).max(0.0),
            is_far_from_collision: self.is_far_from_collision(&near, states, &boxes, &areas),
            is_comfortable: self.comfort.holds(states, self.car.wheelbase_m, self.settings),
            at_fault_s,
        }
    }

    /// Returns the others but lights, each with the rectangle that holds it while proposals are looked at.
    fn moving(&self) -> Vec<(&Other, Extent)> {
        let last = STATES + (self.looks_s() / STEP_S) as usize;
        let around = |other: &Other| {
            let ends = [other.at_step(0).center, other.at_step(last).center];
            Extent::around(ends).grown(other.now.radius() + SLACK_M)
        };
        self.others.iter().filter(|other| !other.is_light).map(|other| (other, around(other))).collect()
    }

    /// Returns the others that some box may meet, now or looking ahead: the rest is excluded at once.
    fn near<'o>(
        &self,
        moving: &[(&'o Other, Extent)],
        states: &[State; STATES],
        boxes: &[OrientedBox; STATES],
    ) -> Vec<&'o Other> {
        let fastest_mps = states.iter().map(|state| state.speed_mps.abs()).fold(0.0, f64::max);
        let reach_m = boxes[0].radius() + fastest_mps * self.looks_s();
        let way = Extent::around(boxes.iter().map(|own| own.center)).grown(reach_m + SLACK_M);
        moving.iter().filter(|(_, around)| way.meets(around)).map(|(other, _)| *other).collect()
    }

    /// Returns the farthest look ahead, s.
    fn looks_s(&self) -> f64 {
        self.settings.collision_looks_s.into_iter().fold(0.0, f64::max)
    }

    /// Returns 1, .5 or 0 by the longest way against traffic.
    fn direction(&self, boxes: &[OrientedBox; STATES], areas: &[Areas; STATES]) -> f64 {
        let (mut longest_m, mut way_m) = (0.0_f64, 0.0);
        for k in 1..STATES {
            way_m = if areas[k].oncoming { way_m + (boxes[k].center - boxes[k - 1].center).norm() } else { 0.0 };
            longest_m = longest_m.max(way_m);
        }
        let [half_m, all_m] = self.settings.oncoming_m;
        match longest_m {
            way if way < half_m => 1.0,
            way if way < all_m => 0.5,
            _ => 0.0,
        }
    }

    /// Returns `true` if nobody ahead would be met within a second if the ego went straight on.
    fn is_far_from_collision(
        &self,
        near: &[&Other],
        states: &[State; STATES],
        boxes: &[OrientedBox; STATES],
        areas: &[Areas; STATES],
    ) -> bool {
        near.iter().all(|other| {
            for k in 0..STATES {
                let (state, own) = (&states[k], &boxes[k]);
                if state.speed_mps < OTHER_STANDS_MPS {
                    continue;
                }
                for ahead_s in self.settings.collision_looks_s {
                    let there = OrientedBox { center: own.center + own.axis * (state.speed_mps * ahead_s), ..*own };
                    let theirs = other.at_step(k + (ahead_s / STEP_S + 0.5) as usize);
                    if !there.overlaps(&theirs) {
                        continue;
                    }
                    let seen_rad = seen_at_rad(own, state.position, &theirs);
                    let is_off = areas[k].in_several_lanes || areas[k].off_road;
                    // After a contact of another kind, this road user is not looked at again.
                    return !(seen_rad < AHEAD_RAD || is_off && seen_rad <= BEHIND_RAD);
                }
            }
            true
        })
    }
}

/// Returns 0 where a road user is struck for which the ego is at fault, .5 where a thing is, else 1; and the time of the first.
fn collisions(
    near: &[&Other],
    states: &[State; STATES],
    boxes: &[OrientedBox; STATES],
    areas: &[Areas; STATES],
) -> (f64, Option<f64>) {
    let (mut worth, mut first) = (1.0_f64, None);
    for other in near {
        // Only the first contact with each counts.
        let meets = |k: &usize| boxes[*k].overlaps(&other.at_step(*k));
        let Some(k) = (0..STATES).find(meets) else { continue };
        let theirs = other.at_step(k);
        let is_at_fault = match contact_kind(&boxes[k], states[k].position, states[k].speed_mps, other, &theirs) {
            ContactKind::EgoStands | ContactKind::Rear => false,
            ContactKind::OtherStands | ContactKind::Front => true,
            ContactKind::Side => areas[k].in_several_lanes || areas[k].off_road,
        };
        if is_at_fault {
            worth = worth.min(if other.is_agent { 0.0 } else { 0.5 });
            let at_s = k as f64 * STEP_S;
            first = Some(first.map_or(at_s, |before: f64| before.min(at_s)));
        }
    }
    (worth, first)
}

#[cfg(test)]
mod tests {
    use super::super::centreline::route_lanes;
    use super::super::settings::PUBLISHED;
    use super::*;
    use crate::kernel::Vec2;
    use crate::scene::AgentKind;
    use crate::scene::fixture::two_lane_scene;
    use crate::sim::Size;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn whoever_is_passed_over_is_met_by_no_box_now_or_ahead(
            speed_mps in 0.0..30.0f64, turn_radps in -0.4..0.4f64,
            x in -120.0..120.0f64, y in -120.0..120.0f64, heading_rad in -4.0..4.0f64, theirs_mps in 0.0..30.0f64,
        ) {
            let plant = Plant::new(&two_lane_scene()).unwrap();
            let (centreline, car) = (Centreline::of(&plant).unwrap(), Car::of(Size::new(AgentKind::Vehicle, 4.5, 1.9)));
            let course = Vec2::from_heading(heading_rad);
            let now = OrientedBox::along(Vec2::new(x, y), course, 4.5, 1.9);
            let other = Other { now, course, speed_mps: theirs_mps, is_agent: true, is_light: false };
            let on_route = route_lanes(&plant, &centreline);
            let others = [other];
            let judge = Judge { plant: &plant, on_route: &on_route, centreline: &centreline, car: &car, others: &others, comfort: &Comfort::new(), settings: &PUBLISHED };
            let mut position = Vec2::ZERO;
            let states: [State; STATES] = std::array::from_fn(|k| {
                let heading_rad = turn_radps * STEP_S * k as f64;
                let at = position;
                position = position + Vec2::from_heading(heading_rad) * (STEP_S * speed_mps);
                State { position: at, heading_rad, speed_mps, acceleration_mps2: 0.0, steering_rad: 0.0, steering_rate_radps: 0.0 }
            });
            let boxes = states.each_ref().map(|state| car.footprint(state.position, state.heading_rad));
            let met = (0..STATES).any(|k| {
                let own = &boxes[k];
                [0.0].into_iter().chain(PUBLISHED.collision_looks_s).any(|ahead_s| {
                    let there = OrientedBox { center: own.center + own.axis * (speed_mps * ahead_s), ..*own };
                    there.overlaps(&other.at_step(k + (ahead_s / STEP_S + 0.5) as usize))
                })
            });
            prop_assert!(!met || !judge.near(&judge.moving(), &states, &boxes).is_empty());
        }
    }
}
