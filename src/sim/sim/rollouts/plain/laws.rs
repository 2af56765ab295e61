//! Laws in their plainest form: every step observes everything that can be observed, of everyone who is there, and walks over the
//! road piece by piece. Every number is written out here once more; nothing of `obedience.rs` is used.

use crate::kernel::{Vec2, num};
use crate::scene::{DT_S, Sample};
use crate::sim::encounters::gaps::time_to_collision_s;
use crate::sim::prepared::body::{Place, SUBSTEPS, Size};
use crate::sim::prepared::path::{Along, Path};
use crate::sim::road_users::bicycle::{Car, DEFAULT_LIMITS};
use crate::sim::road_users::law::{Law, Observation, Observed};
use crate::sim::road_users::skills::EgoForecast;
use crate::sim::{ActorRef, Plant};

use super::Other;

/// A law under way.
pub(super) struct Obeying<'a> {
    law: &'a Law,
    from_step: usize,
    samples: &'a [Sample],
    path: Path,
    along: Along,
    seen: Observation,
    driving: Option<Driving>,
}

struct Driving {
    car: Car,
    wheel_rad: f64,
    offset_m: f64,
    steps: usize,
}

/// Everyone at a decision step, before anybody moves.
pub(super) struct Around<'a> {
    pub plant: &'a Plant,
    /// Everyone but the ego, its own body among them.
    pub others: &'a [Other],
    pub k: usize,
    pub ego: &'a EgoForecast,
    /// Distance of the ego along its route, metres.
    pub ego_s_m: f64,
    pub count: usize,
}

/// The road user itself.
pub(super) struct Own {
    pub index: usize,
    pub who: ActorRef,
    pub size: Size,
    pub now: Sample,
    pub axis: Vec2,
}

impl<'a> Obeying<'a> {
    /// Makes it at the samples' first step. `None` where the samples have no path.
    pub fn new(law: &'a Law, from_step: usize, samples: &'a [Sample]) -> Option<Obeying<'a>> {
        let points: Vec<Vec2> = samples.iter().map(|sample| sample.position).collect();
        let path = Path::bare(&points, samples[0].heading_rad)?;
        let along = path.project(points[0]);
        Some(Obeying { law, from_step, samples, path, along, seen: [0.0; Observed::ALL.len()], driving: None })
    }

    /// Looks at everything, and takes over where the law says so.
    pub fn look(&mut self, around: &Around<'_>, own: &Own) {
        let step = around.plant.first_step() + around.k;
        if step < self.from_step {
            return;
        }
        let speed_mps = self.driving.as_ref().map_or(own.now.speed_mps(), |driving| driving.car.speed_mps);
        let window_m = 2.0 + speed_mps * DT_S;
        self.along = self.path.project_near(own.now.position, &self.along, window_m, window_m);
        self.seen = core::array::from_fn(|i| self.value(Observed::ALL[i], around, own, speed_mps));
        let begins = self.law.onset.as_ref().is_none_or(|onset| onset.value(&self.seen) != 0.0);
        if begins && self.driving.is_none() {
            let car = Car::new(&own.now, 2.0 * own.size.half_length_m);
            let ahead = self.path.at(self.along.s_m + look_m(&car), self.along.segment);
            self.driving = Some(Driving { car, wheel_rad: car.steering_towards(ahead), offset_m: 0.0, steps: 0 });
        }
    }

    fn value(&self, observed: Observed, around: &Around<'_>, own: &Own, speed_mps: f64) -> f64 {
        let (place, ego) = (Place { position: own.now.position, axis: own.axis }, around.ego);
        let (own_box, ego_box) = (own.size.at(place), ego.size.at(ego.place));
        let delta = ego.place.position - place.position;
        match observed {
            Observed::SinceOnset => self.driving.as_ref().map_or(0.0, |driving| driving.steps as f64 * DT_S),
            Observed::OwnSpeed => speed_mps,
            Observed::OwnPathLeft => (self.path.length_m() - self.along.s_m).max(0.0),
            Observed::OwnLaneOffset => {
                let lane = around.plant.lanes().nearest_lane(place.position, place.axis.heading(), 4.0);
                lane.map_or(0.0, |lane| lane.offset_m)
            }
            Observed::OwnOffRoad => {
                let road = &around.plant.drivable;
                own_box.corners().iter().map(|corner| road.distance_by_walk_m(*corner)).fold(0.0, f64::max)
            }
            Observed::RoadLeft => room_m(around.plant, place, own.size.half_width_m, 1.0),
            Observed::RoadRight => room_m(around.plant, place, own.size.half_width_m, -1.0),
            Observed::PlannedAcceleration => {
                let at = (around.plant.first_step() + around.k + 1 - self.from_step).min(self.samples.len() - 1);
                (self.samples[at].speed_mps() - speed_mps) / DT_S
            }
            Observed::SeenGap => own_box.distance(&ego_box),
            Observed::SeenClosing => {
                let apart_m = delta.norm();
                let rate = if apart_m > 1e-9 { delta.dot(ego.velocity - own.now.velocity) / apart_m } else { 0.0 };
                -rate
            }
            Observed::SeenTtc => {
                let ttc_s = time_to_collision_s(&own_box, own.now.velocity, &ego_box, ego.velocity);
                ttc_s.map_or(20.0, |ttc_s| ttc_s.min(20.0))
            }
            Observed::SeenEgoSpeed => ego.velocity.norm(),
            Observed::SeenEgoAcceleration => ego.acceleration_mps2,
            Observed::SeenEgoHeading => num::atan2(place.axis.cross(ego.place.axis), place.axis.dot(ego.place.axis)),
            Observed::SeenEgoAhead => delta.dot(place.axis),
            Observed::SeenEgoLeft => place.axis.cross(delta),
            Observed::EgoToConflict => self.conflict(around).map_or(200.0, |(_, ego_s_m)| ego_s_m - around.ego_s_m),
            Observed::OwnToConflict => self.conflict(around).map_or(200.0, |(own_s_m, _)| own_s_m - self.along.s_m),
            Observed::OthersGap => nearest_m(around, own, place, |_| true),
            Observed::OthersAheadGap => nearest_m(around, own, place, |other| {
                let delta = other.samples[0].position - place.position;
                let half_m = other.size.half_length_m * other.axis.cross(place.axis).abs()
                    + other.size.half_width_m * other.axis.dot(place.axis).abs();
                let room_m = own.size.half_width_m + half_m + 0.5;
                delta.dot(place.axis) > 0.0 && place.axis.cross(delta).abs() < room_m
            }),
            Observed::AdversaryIndex => own.index as f64,
            Observed::AdversaryCount => around.count as f64,
        }
    }

    /// Returns the distances along both ways at which the samples first come within 2 m of the ego's route, metres, looked up every step.
    fn conflict(&self, around: &Around<'_>) -> Option<(f64, f64)> {
        let (route, points) = (&around.plant.route, self.path.points());
        let mut known = route.project(points[0]);
        let mut gone_m = 0.0;
        for (i, point) in points.iter().enumerate() {
            if i > 0 {
                gone_m += (*point - points[i - 1]).norm();
            }
            known = route.project_near(*point, &known, 30.0, 30.0);
            if known.offset_m.abs() <= 2.0 && known.s_m >= 0.0 && known.s_m <= route.length_m() {
                return Some((gone_m, known.s_m));
            }
        }
        None
    }

    /// Drives one decision step under the law; `None` before its onset.
    pub fn drive(&mut self) -> Option<[Car; SUBSTEPS]> {
        let driving = self.driving.as_mut()?;
        let car = driving.car;
        let wanted_m = self.law.offset.as_ref().map_or(0.0, |offset| offset.value(&self.seen)).clamp(-8.0, 8.0);
        // 2 m/s to the side.
        driving.offset_m += (wanted_m - driving.offset_m).clamp(-2.0 * DT_S, 2.0 * DT_S);
        let s_m = self.along.s_m + look_m(&car);
        let segment = self.path.segment_near(s_m, 0);
        let aside = self.path.direction(segment).left() * driving.offset_m;
        let wanted_rad = car.steering_towards(self.path.at(s_m, segment) + aside);
        let most_rad = 0.1 * DEFAULT_LIMITS.steering_rad;
        driving.wheel_rad += (wanted_rad - driving.wheel_rad).clamp(-most_rad, most_rad);
        let cars = car.drive(self.law.acceleration.value(&self.seen), driving.wheel_rad, &DEFAULT_LIMITS);
        driving.car = cars[SUBSTEPS - 1];
        driving.steps += 1;
        Some(cars)
    }
}

fn look_m(car: &Car) -> f64 {
    f64::max(4.0, 0.6 * car.speed_mps)
}

/// Returns how far the road goes on beside a vehicle, metres: ten places half a metre apart, each looked for among all pieces.
fn room_m(plant: &Plant, place: Place, half_width_m: f64, side: f64) -> f64 {
    let left = place.axis.left();
    let (from, aside) = (place.position + left * (side * half_width_m), left * side);
    let probes: Vec<bool> =
        (0..=10).map(|i| plant.drivable.holds_by_walk(from + aside * (f64::from(i) * 0.5))).collect();
    let held = probes.iter().take_while(|held| **held).count();
    held.saturating_sub(1) as f64 * 0.5
}

/// Returns the smallest distance of boxes to others whose centres lie within 50 m; 50 where nobody is.
fn nearest_m(around: &Around<'_>, own: &Own, place: Place, counts: impl Fn(&Other) -> bool) -> f64 {
    let apart = |other: &Other| (other.samples[0].position - place.position).norm_squared();
    let near = around.others.iter().filter(|other| other.who != own.who && apart(other) <= 50.0 * 50.0);
    let at = |other: &Other| Place { position: other.samples[0].position, axis: other.axis };
    let distances =
        near.filter(|other| counts(other)).map(|other| own.size.at(place).distance(&other.size.at(at(other))));
    distances.fold(50.0, f64::min)
}
