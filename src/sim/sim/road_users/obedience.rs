//! Carries a law out: waits for the onset in the values of `observing.rs`, then drives the bicycle along the path of the samples.
//! A step allocates nothing; the path is prepared when the rollout begins.

use crate::kernel::Vec2;
use crate::scene::{DT_S, Sample};
use crate::sim::prepared::body::{Place, SUBSTEPS};
use crate::sim::prepared::path::{Along, Path};
use crate::sim::prepared::plant::Plant;

use super::bicycle::{Car, DEFAULT_LIMITS};
use super::law::{Law, OFFSET_M_MAX, OFFSET_MPS_MAX, Observation, Observed, Reads};
use super::triggered::{LOOK_AHEAD_M, LOOK_AHEAD_S, WHEEL_STEP_RAD};

/// Distance up to which two paths meet, metres.
const CONFLICT_M: f64 = 2.0;
/// Length of route in which the next meeting place is looked for, metres.
const ROUTE_WINDOW_M: f64 = 30.0;

/// A law under way.
#[derive(Clone, Debug)]
pub(in crate::sim) struct Obedience {
    pub(super) reads: Reads,
    /// Way of the samples, and their speeds, one a step from `from_step` on.
    pub(super) path: Path,
    pub(super) speeds_mps: Vec<f64>,
    pub(super) from_step: usize,
    /// Meeting place of this path and the ego's route: distance along each, metres.
    pub(super) conflict: Option<(f64, f64)>,
    /// Last observation.
    seen: Observation,
    pub(super) along: Along,
    pub(super) road_hint: u32,
    pub(super) driving: Option<Driving>,
}

/// The vehicle once the law has taken over.
#[derive(Clone, Debug)]
pub(super) struct Driving {
    pub car: Car,
    wheel_rad: f64,
    offset_m: f64,
    /// Number of decision steps so far.
    pub steps: usize,
}

/// An observation, and the place at which the vehicle was found.
pub(in crate::sim) struct Sight {
    pub(super) seen: Observation,
    pub(super) along: Along,
    pub(super) road_hint: u32,
}

impl Obedience {
    /// Makes it ready at the start of a rollout. `None` where the samples have no path.
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

    /// Stores an observation, and begins to obey where the law says so.
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

    /// Drives one decision step under the law; `None` before its onset.
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

/// Returns the distances along a path and along the ego's route at which the path first reaches the route, metres.
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
