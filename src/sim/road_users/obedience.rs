//! Carries a law out: observes, waits for the onset, then drives the bicycle along the path of the samples. A step
//! allocates nothing; the path is prepared when the rollout begins.

use crate::kernel::{Vec2, num};
use crate::scene::{DT_S, Sample};
use crate::sim::encounters::gaps::time_to_collision_s;
use crate::sim::prepared::body::{Place, SUBSTEPS, Size};
use crate::sim::prepared::path::{Along, Path};
use crate::sim::prepared::plant::Plant;
use crate::sim::prepared::ray::room_m;

use super::bicycle::{Car, DEFAULT_LIMITS};
use super::intervention::ActorRef;
use super::law::{FAR_M, Law, NEVER_S, NO_CONFLICT_M, OFFSET_M_MAX, OFFSET_MPS_MAX, Observation, Observed, Reads};
use super::others::Others;
use super::skills::EgoForecast;
use super::triggered::{LOOK_AHEAD_M, LOOK_AHEAD_S, WHEEL_STEP_RAD};

/// Paths nearer than this to each other meet, metres.
const CONFLICT_M: f64 = 2.0;
/// How far along the route the next meeting place is looked for, metres.
const ROUTE_WINDOW_M: f64 = 30.0;
/// Who is this far beside its own half width is in its way, metres.
const SIDE_ROOM_M: f64 = 0.5;
/// More than rounding can make of a box's half size, metres.
const ROUNDING_M: f64 = 1e-6;
/// A place farther than this from every lane belongs to none, metres.
const LANE_WITHIN_M: f64 = 4.0;

/// A law under way.
#[derive(Clone, Debug)]
pub(in crate::sim) struct Obedience {
    reads: Reads,
    /// The way of the samples, and their speeds, one a step from `from_step` on.
    path: Path,
    speeds_mps: Vec<f64>,
    from_step: usize,
    /// Where this path and the ego's route meet: along each, metres.
    conflict: Option<(f64, f64)>,
    /// What was observed last.
    seen: Observation,
    along: Along,
    road_hint: u32,
    driving: Option<Driving>,
}

/// The vehicle once the law has taken over.
#[derive(Clone, Debug)]
struct Driving {
    car: Car,
    wheel_rad: f64,
    offset_m: f64,
    /// Decision steps so far.
    steps: usize,
}

/// Everything that an observation is made of besides the vehicle's own memory.
pub(in crate::sim) struct Surroundings<'a> {
    pub plant: &'a Plant,
    pub world: &'a Others,
    /// Simulated step.
    pub k: usize,
    pub ego: &'a EgoForecast,
    /// The ego's place along its route.
    pub ego_along: &'a Along,
    /// Number of adversaries, and this one's place among them.
    pub count: usize,
    pub own: usize,
}

/// What was seen, and where the vehicle was found to be.
pub(in crate::sim) struct Sight {
    seen: Observation,
    along: Along,
    road_hint: u32,
}

impl Obedience {
    /// `None` where the samples have no path.
    pub fn new(law: &Law, plant: &Plant, from_step: usize, samples: &[Sample]) -> Option<Obedience> {
        let points: Vec<Vec2> = samples.iter().map(|sample| sample.position).collect();
        let path = Path::bare(&points, samples.first()?.heading_rad)?;
        let reads = Reads::of(law);
        let meets = reads.any(&[Observed::EgoToConflict, Observed::OwnToConflict]);
        Some(Obedience {
            conflict: if meets { conflict(&path, &plant.route) } else { None },
            along: path.project(points[0]),
            speeds_mps: samples.iter().map(Sample::speed_mps).collect(),
            path,
            reads,
            from_step,
            seen: [0.0; Observed::ALL.len()],
            road_hint: u32::MAX,
            driving: None,
        })
    }

    /// What this road user observes at a decision step; `None` while it is not there or its samples have not begun.
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
            // What rules most of them out comes first: behind, or farther aside than a box that is turned across.
            let aside_m = place.axis.cross(delta).abs();
            let room_m = size.half_width_m + SIDE_ROOM_M;
            let may_be_ahead =
                of_ahead && delta.dot(place.axis) > 0.0 && aside_m < room_m + near.size.radius_m + ROUNDING_M;
            if !of_all && !may_be_ahead {
                return;
            }
            // Boxes are never nearer than their circles, and the distance of boxes is what costs time here.
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

    /// Takes over what was observed, and begins to obey where the law says so.
    pub fn see(&mut self, law: &Law, sight: Sight, now: &Sample, length_m: f64) {
        (self.seen, self.along, self.road_hint) = (sight.seen, sight.along, sight.road_hint);
        let holds = law.onset.as_ref().is_none_or(|onset| onset.value(&self.seen) != 0.0);
        if self.driving.is_none() && holds {
            let car = Car::new(now, length_m);
            let ahead = self.path.at(self.along.s_m + look_ahead_m(&car), self.along.segment);
            let wheel_rad = car.steering_towards(ahead);
            self.driving = Some(Driving { car, wheel_rad, offset_m: 0.0, steps: 0 });
        }
    }

    /// One decision step under the law; `None` before its onset.
    pub fn step(&mut self, law: &Law) -> Option<([Car; SUBSTEPS], Place)> {
        let driving = self.driving.as_mut()?;
        let (car, limits) = (driving.car, &DEFAULT_LIMITS);
        let wanted_m = law.offset.as_ref().map_or(0.0, |offset| offset.value(&self.seen));
        let most_m = OFFSET_MPS_MAX * DT_S;
        driving.offset_m += (wanted_m.clamp(-OFFSET_M_MAX, OFFSET_M_MAX) - driving.offset_m).clamp(-most_m, most_m);
        let s_m = self.along.s_m + look_ahead_m(&car);
        let segment = self.path.segment_near(s_m, self.along.segment);
        let target = self.path.at(s_m, segment) + self.path.direction(segment).left() * driving.offset_m;
        let turn_rad = (car.steering_towards(target) - driving.wheel_rad).clamp(-WHEEL_STEP_RAD, WHEEL_STEP_RAD);
        driving.wheel_rad += turn_rad;
        let cars = car.drive(law.acceleration.value(&self.seen), driving.wheel_rad, limits);
        driving.car = cars[SUBSTEPS - 1];
        driving.steps += 1;
        Some((cars, car.place()))
    }
}

fn look_ahead_m(car: &Car) -> f64 {
    LOOK_AHEAD_M.max(LOOK_AHEAD_S * car.speed_mps)
}

/// Where a path first comes to the ego's route: along each, metres.
fn conflict(path: &Path, route: &Path) -> Option<(f64, f64)> {
    let points = path.points();
    let mut along = route.project(points[0]);
    let mut driven_m = 0.0;
    for (i, point) in points.iter().enumerate() {
        driven_m += if i > 0 { points[i - 1].distance(*point) } else { 0.0 };
        along = route.project_near(*point, &along, ROUTE_WINDOW_M, ROUTE_WINDOW_M);
        if along.offset_m.abs() <= CONFLICT_M && (0.0..=route.length_m()).contains(&along.s_m) {
            return Some((driven_m, along.s_m));
        }
    }
    None
}
