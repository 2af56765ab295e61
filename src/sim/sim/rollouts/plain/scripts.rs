//! Scripts in their plainest form: every step determines anew which phase is on, and every number of the language is
//! written out here once more. Nothing of `triggered.rs` is used.

use crate::kernel::{Vec2, num};
use crate::scene::{AgentKind, DT_S, Sample};
use crate::sim::prepared::body::SUBSTEPS;
use crate::sim::prepared::path::{Along, Path};
use crate::sim::road_users::bicycle::{Car, DEFAULT_LIMITS};
use crate::sim::road_users::script::{Phase, Speed, Until, Way};
use crate::sim::road_users::skills::EgoForecast;
use crate::sim::{Action, Intervention, Script};

use super::bodies::{Body, Mind};

/// A script under way. The state of a phase is forgotten where the next one begins.
pub(super) struct Acting<'a> {
    script: &'a Script,
    car: Car,
    awake: bool,
    wheel_rad: f64,
    /// Way of all steps so far, metres.
    gone_m: f64,
    phase: usize,
    /// Number of steps of the present phase so far.
    ticks: usize,
    /// Start of the present phase: position and heading vector.
    began: Option<(Vec2, Vec2)>,
    along: Option<Along>,
}

/// Sets those scripts off to which the ego has come near enough, fast enough.
pub(super) fn set_off(bodies: &mut [Body<'_>], act: &Intervention, ego: &EgoForecast) {
    let places: Vec<Option<Vec2>> = bodies.iter().map(|body| body.now.map(|now| now.position)).collect();
    for (i, action) in act.actions.iter().enumerate() {
        let (Action::Triggered(script), Mind::Script(acting)) = (action, &mut bodies[i].mind) else { continue };
        let Some(reference) = places[script.trigger.reference] else { continue };
        let near = (ego.place.position - reference).norm() < script.trigger.distance_m;
        let fast = ego.velocity.norm() >= script.trigger.ego_speed_mps_min;
        acting.awake |= near && fast;
    }
}

impl<'a> Acting<'a> {
    pub fn new(script: &'a Script) -> Acting<'a> {
        let heading_rad = num::wrap_angle(script.spawn.heading_rad);
        let stands = Sample { position: script.spawn.position, heading_rad, velocity: Vec2::ZERO };
        Acting {
            script,
            car: Car::new(&stands, script.length_m),
            awake: false,
            wheel_rad: 0.0,
            gone_m: 0.0,
            phase: 0,
            ticks: 0,
            began: None,
            along: None,
        }
    }

    pub fn walks(&self) -> bool {
        self.script.kind == AgentKind::Pedestrian
    }

    /// Returns the phase that is on, after those that are over; `None` before the first and behind the last.
    fn phase(&mut self, ego: &EgoForecast, route: &Path) -> Option<&'a Phase> {
        let phases = if self.awake { &self.script.phases[..] } else { &[] };
        loop {
            let phase = phases.get(self.phase)?;
            let over = match phase.until {
                Until::Forever => false,
                Until::Driven { m } => self.gone_m >= m,
                Until::EgoWithin { m } => (self.car.position - ego.place.position).norm() < m,
                Until::NearRoute { m } => route.project(self.car.position).offset_m.abs() < m,
                Until::Lasted { s } => (self.ticks as f64 + 0.5) * DT_S > s,
            };
            if !over {
                return Some(phase);
            }
            self.phase += 1;
            (self.ticks, self.began, self.along) = (0, None, None);
        }
    }

    fn asked_mps(&self, phase: &Phase, ego: &EgoForecast) -> f64 {
        let ego_mps = ego.velocity.norm();
        match &phase.speed {
            Speed::Constant { mps } => *mps,
            Speed::Profile { mps } => *mps.get(self.ticks).unwrap_or(&mps[mps.len() - 1]),
            Speed::MatchEgo { mps_max } => ego_mps.min(*mps_max),
            Speed::Intercept { mps_min, mps_max } => {
                let away = self.car.position - ego.place.position;
                let along_m = away.dot(ego.place.axis);
                let has_passed = along_m < 0.5;
                let mps = ego.place.axis.cross(away).abs() * ego_mps / along_m;
                if has_passed { *mps_max } else { mps.clamp(*mps_min, *mps_max) }
            }
        }
    }

    /// Returns the start of the present phase; the first call in a phase sets it to the present place.
    fn began(&mut self) -> (Vec2, Vec2) {
        *self.began.get_or_insert((self.car.position, self.car.axis))
    }

    /// Returns the place so far ahead on the line of a sideways move, which is left and reached without a kink.
    fn beside(&mut self, left_m: f64, over_m: f64, look_m: f64) -> Vec2 {
        let (from, axis) = self.began();
        let ahead_m = (self.car.position - from).dot(axis) + look_m;
        let share = (ahead_m / over_m).clamp(0.0, 1.0);
        from + axis * ahead_m + axis.left() * (left_m * share * share * (3.0 - 2.0 * share))
    }

    /// Makes the present phase's path anew.
    fn path(&self, points: &[Vec2]) -> Option<Path> {
        Path::new(points, self.script.spawn.heading_rad)
    }

    /// Drives one decision step on wheels.
    pub fn drive(&mut self, ego: &EgoForecast, route: &Path) -> [Car; SUBSTEPS] {
        let limits = &DEFAULT_LIMITS;
        let phase = self.phase(ego, route);
        let (acceleration, wanted_rad) = match phase {
            None => (-limits.brake_mps2, 0.0),
            Some(phase) => {
                let faster = self.car.speed_mps > self.asked_mps(phase, ego);
                let pedal = if faster { -phase.brake * limits.brake_mps2 } else { phase.throttle * limits.engine_mps2 };
                (pedal, self.wheel_for(&phase.way))
            }
        };
        let most_rad = 0.1 * limits.steering_rad;
        self.wheel_rad += (wanted_rad - self.wheel_rad).clamp(-most_rad, most_rad);
        let cars = self.car.drive(acceleration, self.wheel_rad, limits);
        self.gone(cars[SUBSTEPS - 1], phase.is_some());
        cars
    }

    fn wheel_for(&mut self, way: &Way) -> f64 {
        let look_m = f64::max(4.0, 0.6 * self.car.speed_mps);
        let most_rad = DEFAULT_LIMITS.steering_rad;
        match way {
            Way::Straight => 0.0,
            Way::Wheel { rad } => (*rad.get(self.ticks).unwrap_or(&rad[rad.len() - 1])).clamp(-most_rad, most_rad),
            Way::Points { points } => {
                self.car.steering_towards(*points.get(self.ticks).unwrap_or(&points[points.len() - 1]))
            }
            Way::Shift { left_m, over_m } => {
                let target = self.beside(*left_m, *over_m, look_m);
                self.car.steering_towards(target)
            }
            Way::Turn { left_rad, radius_m } => {
                let (_, axis) = self.began();
                let turned_rad = num::atan2(axis.cross(self.car.axis), axis.dot(self.car.axis));
                let side = left_rad.signum();
                if turned_rad * side < left_rad.abs() { self.car.steering_for(side / radius_m) } else { 0.0 }
            }
            Way::Path { points } => {
                let Some(path) = self.path(points) else { return 0.0 };
                // As far ahead as the fastest car comes in a step, and a little.
                let ahead_m = 2.0 + DT_S * DEFAULT_LIMITS.speed_mps;
                let along = match &self.along {
                    None => path.project(self.car.position),
                    Some(known) => path.project_near(self.car.position, known, 2.0, ahead_m),
                };
                let target = path.at(along.s_m + look_m, along.segment);
                self.along = Some(along);
                self.car.steering_towards(target)
            }
        }
    }

    /// Walks one decision step: returns the sample at its end.
    pub fn walk(&mut self, ego: &EgoForecast, route: &Path) -> Sample {
        let phase = self.phase(ego, route);
        let way_m = phase.map_or(0.0, |phase| self.asked_mps(phase, ego)) * DT_S;
        let place = self.car.position;
        let to = match phase.map(|phase| &phase.way) {
            None | Some(Way::Straight | Way::Wheel { .. }) => place + self.car.axis * way_m,
            Some(Way::Points { points }) => {
                let away = *points.get(self.ticks).unwrap_or(&points[points.len() - 1]) - place;
                let left_m = away.norm();
                if left_m > 1e-9 { place + away * (way_m.min(left_m) / left_m) } else { place }
            }
            Some(Way::Path { points }) => self.along_on_foot(points, way_m),
            Some(Way::Shift { left_m, over_m }) => {
                let away = self.beside(*left_m, *over_m, 0.5) - place;
                place + away * (way_m / away.norm().max(0.5))
            }
            Some(Way::Turn { left_rad, .. }) => place + self.began().1.rotated(*left_rad) * way_m,
        };
        let step = to - place;
        let heading_rad = if step.norm() > 1e-9 { num::wrap_angle(step.heading()) } else { self.car.heading_rad };
        let mut car = self.car;
        (car.position, car.heading_rad, car.axis) = (to, heading_rad, Vec2::from_heading(heading_rad));
        self.gone(car, phase.is_some());
        Sample { position: to, heading_rad, velocity: step * (1.0 / DT_S) }
    }

    /// Returns the place so far along a path, from its nearest point to the place at which its phase began to move.
    fn along_on_foot(&mut self, points: &[Vec2], way_m: f64) -> Vec2 {
        let place = self.car.position;
        let Some(path) = self.path(points).filter(|_| way_m > 0.0) else { return place };
        let mut along = self.along.unwrap_or_else(|| path.project(place));
        along.s_m += way_m;
        along.segment = path.segment_near(along.s_m, 0);
        self.along = Some(along);
        path.at(along.s_m, along.segment)
    }

    fn gone(&mut self, car: Car, in_phase: bool) {
        self.gone_m += (car.position - self.car.position).norm();
        self.ticks += usize::from(in_phase);
        self.car = car;
    }
}
