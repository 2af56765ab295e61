//! The observation of an adversary under a law at a decision step: the ego, the others, the road. Only the values that its
//! formulas read are computed, and nothing is allocated.

use crate::kernel::{Vec2, num};
use crate::scene::DT_S;
use crate::sim::encounters::gaps::time_to_collision_s;
use crate::sim::prepared::body::{Place, Size};
use crate::sim::prepared::path::Along;
use crate::sim::prepared::plant::Plant;
use crate::sim::prepared::ray::room_m;

use super::intervention::ActorRef;
use super::law::{FAR_M, NEVER_S, NO_CONFLICT_M, Observation, Observed};
use super::obedience::{Obedience, Sight};
use super::others::Others;
use super::skills::EgoForecast;

/// Distance beside its own half width within which a road user is in its way, metres.
const SIDE_ROOM_M: f64 = 0.5;
/// Bound on the rounding error of a box's half size, metres.
const ROUNDING_M: f64 = 1e-6;
/// Distance from every lane beyond which a place belongs to none, metres.
const LANE_WITHIN_M: f64 = 4.0;

/// The inputs of an observation besides the vehicle's own memory.
pub(in crate::sim) struct Surroundings<'a> {
    pub plant: &'a Plant,
    pub world: &'a Others,
    /// Simulated step.
    pub k: usize,
    pub ego: &'a EgoForecast,
    /// The ego's place along its route.
    pub ego_along: &'a Along,
    /// Number of adversaries, and this one's index among them.
    pub count: usize,
    pub own: usize,
}

impl Obedience {
    /// Returns this road user's observation at a decision step; `None` while it is not there or its samples have not begun.
    pub fn observe(&self, around: &Surroundings<'_>) -> Option<Sight> {
        let actor = &around.world.actors[around.own];
        let now = actor.now.as_ref()?;
        let step = around.plant.first_step() + around.k;
        if step < self.from_step {
            return None;
        }
        let place = Place { position: now.position, axis: actor.axis };
        let speed_mps = self.driving.as_ref().map_or(now.speed_mps(), |driving| driving.car.speed_mps);
        let window = 2.0 + speed_mps * DT_S;
        let along = self.path.project_near(place.position, &self.along, window, window);
        let mut sight = Sight { seen: [0.0; Observed::ALL.len()], along, road_hint: self.road_hint };
        let mut see = |observed: Observed, value: f64| sight.seen[observed as usize] = value;
        see(Observed::SinceOnset, self.driving.as_ref().map_or(0.0, |driving| driving.steps as f64 * DT_S));
        see(Observed::OwnSpeed, speed_mps);
        see(Observed::OwnPathLeft, (self.path.length_m() - along.s_m).max(0.0));
        see(Observed::PlannedAcceleration, (self.planned_mps(step + 1) - speed_mps) / DT_S);
        see(Observed::AdversaryIndex, around.own as f64);
        see(Observed::AdversaryCount, around.count as f64);
        let (ego_m, own_m) = self.conflict.map_or((NO_CONFLICT_M, NO_CONFLICT_M), |(own_s_m, ego_s_m)| {
            (ego_s_m - around.ego_along.s_m, own_s_m - along.s_m)
        });
        see(Observed::EgoToConflict, ego_m);
        see(Observed::OwnToConflict, own_m);
        self.see_ego(&mut sight.seen, around.ego, place, now.velocity, &actor.size);
        self.see_others(&mut sight.seen, around, place, &actor.size);
        self.see_road(&mut sight, around.plant, place, &actor.size);
        Some(sight)
    }

    fn planned_mps(&self, step: usize) -> f64 {
        self.speeds_mps[step.saturating_sub(self.from_step).min(self.speeds_mps.len() - 1)]
    }

    fn see_ego(&self, seen: &mut Observation, ego: &EgoForecast, place: Place, velocity: Vec2, size: &Size) {
        let delta = ego.place.position - place.position;
        let apart_m = delta.norm();
        let mut see = |observed: Observed, value: f64| seen[observed as usize] = value;
        let rate = if apart_m > 1e-9 { delta.dot(ego.velocity - velocity) / apart_m } else { 0.0 };
        see(Observed::SeenClosing, -rate);
        see(Observed::SeenEgoSpeed, ego.velocity.norm());
        see(Observed::SeenEgoAcceleration, ego.acceleration_mps2);
        see(Observed::SeenEgoAhead, delta.dot(place.axis));
        see(Observed::SeenEgoLeft, place.axis.cross(delta));
        if self.reads.any(&[Observed::SeenEgoHeading]) {
            let (sine, cosine) = (place.axis.cross(ego.place.axis), place.axis.dot(ego.place.axis));
            see(Observed::SeenEgoHeading, num::atan2(sine, cosine));
        }
        let (own, other) = (size.at(place), ego.size.at(ego.place));
        if self.reads.any(&[Observed::SeenGap]) {
            see(Observed::SeenGap, own.distance(&other));
        }
        if self.reads.any(&[Observed::SeenTtc]) {
            let ttc_s = time_to_collision_s(&own, velocity, &other, ego.velocity);
            see(Observed::SeenTtc, ttc_s.unwrap_or(NEVER_S).min(NEVER_S));
        }
    }

    fn see_others(&self, seen: &mut Observation, around: &Surroundings<'_>, place: Place, size: &Size) {
        let (of_all, of_ahead) = (self.reads.any(&[Observed::OthersGap]), self.reads.any(&[Observed::OthersAheadGap]));
        if !of_all && !of_ahead {
            return;
        }
        let own = size.at(place);
        let (mut gap_m, mut ahead_m) = (FAR_M, FAR_M);
        let who: ActorRef = around.world.actors[around.own].who;
        around.world.for_each_near(around.plant, around.k, place.position, FAR_M, |near| {
            if near.who == who {
                return;
            }
            let delta = near.position - place.position;
            // A test that excludes most of them comes first: behind, or farther aside than a box that is turned across.
            let aside_m = place.axis.cross(delta).abs();
            let room_m = size.half_width_m + SIDE_ROOM_M;
            let may_be_ahead =
                of_ahead && delta.dot(place.axis) > 0.0 && aside_m < room_m + near.size.radius_m + ROUNDING_M;
            if !of_all && !may_be_ahead {
                return;
            }
            // Boxes are never nearer than their circles, and the distance of boxes costs most of the time here.
            let apart_m = delta.norm() - near.size.radius_m - size.radius_m;
            let nearer = of_all && apart_m < gap_m;
            let ahead = may_be_ahead && apart_m < ahead_m && {
                let half_m = near.size.half_length_m * near.axis.cross(place.axis).abs()
                    + near.size.half_width_m * near.axis.dot(place.axis).abs();
                aside_m < size.half_width_m + half_m + SIDE_ROOM_M
            };
            if !nearer && !ahead {
                return;
            }
            let distance_m = own.distance(&near.size.at(Place { position: near.position, axis: near.axis }));
            gap_m = if nearer { gap_m.min(distance_m) } else { gap_m };
            ahead_m = if ahead { ahead_m.min(distance_m) } else { ahead_m };
        });
        seen[Observed::OthersGap as usize] = gap_m;
        seen[Observed::OthersAheadGap as usize] = ahead_m;
    }

    fn see_road(&self, sight: &mut Sight, plant: &Plant, place: Place, size: &Size) {
        let (road, hint) = (&plant.drivable, &mut sight.road_hint);
        if self.reads.any(&[Observed::OwnOffRoad]) {
            let corners = size.at(place).corners();
            let off_m = corners.iter().fold(0.0, |most: f64, corner| most.max(road.distance_m(*corner, most, hint)));
            sight.seen[Observed::OwnOffRoad as usize] = off_m;
        }
        for (observed, side) in [(Observed::RoadLeft, 1.0), (Observed::RoadRight, -1.0)] {
            if self.reads.any(&[observed]) {
                let from = place.position + place.axis.left() * (side * size.half_width_m);
                sight.seen[observed as usize] = room_m(road, from, place.axis.left() * side, hint);
            }
        }
        if self.reads.any(&[Observed::OwnLaneOffset]) {
            let lane = plant.lanes().nearest_lane(place.position, place.axis.heading(), LANE_WITHIN_M);
            sight.seen[Observed::OwnLaneOffset as usize] = lane.map_or(0.0, |lane| lane.offset_m);
        }
    }
}
