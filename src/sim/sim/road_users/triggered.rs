//! Carries a script out: waits for the ego, then drives or walks phase by phase. A step allocates nothing; paths are
//! prepared when the rollout begins.

use crate::kernel::{Vec2, num};
use crate::scene::{AgentKind, DT_S, Sample};
use crate::sim::prepared::body::SUBSTEPS;
use crate::sim::prepared::path::{Along, Path};

use super::bicycle::{Car, DEFAULT_LIMITS};
use super::script::{Phase, Script, Speed, Until, Way};
use super::skills::EgoForecast;

/// Distance that pure pursuit looks ahead, metres, or its way in [`LOOK_AHEAD_S`], whichever is more.
pub(super) const LOOK_AHEAD_M: f64 = 4.0;
pub(super) const LOOK_AHEAD_S: f64 = 0.6;
/// Largest turn of the wheels in a decision step, radians: a tenth of their range, as CARLA's vehicle controller.
pub(super) const WHEEL_STEP_RAD: f64 = 0.1 * DEFAULT_LIMITS.steering_rad;
/// Distance ahead, on foot, at which the way of a sideways move is looked up, metres.
const WALK_LOOK_M: f64 = 0.5;
/// Distance along its line below which the ego has passed, metres.
const PASSED_M: f64 = 0.5;

/// A script under way.
#[derive(Clone, Debug)]
pub(in crate::sim) struct Play {
    car: Car,
    pub awake: bool,
    phase: usize,
    /// Number of decision steps of the present phase.
    tick: usize,
    driven_m: f64,
    wheel_rad: f64,
    /// Place on the present phase's path.
    along: Option<Along>,
    /// Position and heading vector at the beginning of the present phase, for ways that are relative to it.
    origin: Option<(Vec2, Vec2)>,
    /// Paths of the phases that have one.
    paths: Vec<Option<Path>>,
}

/// Motion in one decision step. It lives on the stack for a moment; a box would allocate in every step.
#[allow(clippy::large_enum_variant)]
pub(in crate::sim) enum Moved {
    Cars([Car; SUBSTEPS]),
    /// On foot: the sample at the end; straight in between.
    Walked(Sample),
}

impl Play {
    pub fn new(script: &Script) -> Play {
        let path = |phase: &Phase| match &phase.way {
            Way::Path { points } => Path::new(points, script.spawn.heading_rad),
            _ => None,
        };
        Play {
            car: Car::new(&standing(script), script.length_m),
            awake: false,
            phase: 0,
            tick: 0,
            driven_m: 0.0,
            wheel_rad: 0.0,
            along: None,
            origin: None,
            paths: script.phases.iter().map(path).collect(),
        }
    }

    /// Returns `true` if the ego sets it off, given the place of its reference.
    pub fn is_set_off(script: &Script, reference: Vec2, ego: &EgoForecast) -> bool {
        let trigger = &script.trigger;
        ego.place.position.distance(reference) < trigger.distance_m && ego.velocity.norm() >= trigger.ego_speed_mps_min
    }

    /// Does the next decision step. `route` is the ego's.
    pub fn step(&mut self, script: &Script, ego: &EgoForecast, route: &Path) -> Moved {
        if self.awake {
            while let Some(phase) = script.phases.get(self.phase)
                && self.is_over(phase, ego, route)
            {
                (self.phase, self.tick, self.along, self.origin) = (self.phase + 1, 0, None, None);
            }
        }
        let phase = script.phases.get(self.phase).filter(|_| self.awake);
        let before = self.car.position;
        let moved = if script.kind == AgentKind::Pedestrian {
            Moved::Walked(self.walk(phase, ego))
        } else {
            Moved::Cars(self.drive(phase, ego))
        };
        self.driven_m += before.distance(self.car.position);
        self.tick += usize::from(phase.is_some());
        moved
    }

    fn is_over(&self, phase: &Phase, ego: &EgoForecast, route: &Path) -> bool {
        match phase.until {
            Until::Forever => false,
            Until::Driven { m } => self.driven_m >= m,
            Until::EgoWithin { m } => self.car.position.distance(ego.place.position) < m,
            Until::NearRoute { m } => route.project(self.car.position).offset_m.abs() < m,
            // Half a step of slack: ten steps of 0.1 s are one second.
            Until::Lasted { s } => (self.tick as f64 + 0.5) * DT_S > s,
        }
    }

    fn asked_mps(&self, speed: &Speed, ego: &EgoForecast) -> f64 {
        match speed {
            Speed::Constant { mps } => *mps,
            Speed::Profile { mps } => mps[self.tick.min(mps.len() - 1)],
            Speed::MatchEgo { mps_max } => ego.velocity.norm().min(*mps_max),
            Speed::Intercept { mps_min, mps_max } => {
                let delta = self.car.position - ego.place.position;
                let (ahead_m, aside_m) = (delta.dot(ego.place.axis), ego.place.axis.cross(delta).abs());
                if ahead_m < PASSED_M {
                    return *mps_max;
                }
                (aside_m * ego.velocity.norm() / ahead_m).clamp(*mps_min, *mps_max)
            }
        }
    }

    fn drive(&mut self, phase: Option<&Phase>, ego: &EgoForecast) -> [Car; SUBSTEPS] {
        let limits = &DEFAULT_LIMITS;
        let (acceleration, wanted_rad) = match phase {
            None => (-limits.brake_mps2, 0.0),
            Some(phase) => {
                let slow = self.car.speed_mps <= self.asked_mps(&phase.speed, ego);
                let pedal = if slow { phase.throttle * limits.engine_mps2 } else { -phase.brake * limits.brake_mps2 };
                (pedal, self.wanted_wheel_rad(&phase.way))
            }
        };
        let turn = (wanted_rad - self.wheel_rad).clamp(-WHEEL_STEP_RAD, WHEEL_STEP_RAD);
        self.wheel_rad += turn;
        let cars = self.car.drive(acceleration, self.wheel_rad, limits);
        self.car = cars[SUBSTEPS - 1];
        cars
    }

    fn wanted_wheel_rad(&mut self, way: &Way) -> f64 {
        match way {
            Way::Straight => 0.0,
            Way::Wheel { rad } => {
                rad[self.tick.min(rad.len() - 1)].clamp(-DEFAULT_LIMITS.steering_rad, DEFAULT_LIMITS.steering_rad)
            }
            Way::Points { points } => self.car.steering_towards(points[self.tick.min(points.len() - 1)]),
            Way::Shift { left_m, over_m } => {
                let target = self.shifted(*left_m, *over_m, self.look_ahead_m());
                self.car.steering_towards(target)
            }
            Way::Turn { left_rad, radius_m } => {
                if self.is_turned(*left_rad) {
                    return 0.0;
                }
                self.car.steering_for(left_rad.signum() / radius_m)
            }
            Way::Path { .. } => {
                let look_m = self.look_ahead_m();
                match self.on_path(0.0) {
                    Some((path, along)) => {
                        let target = path.at(along.s_m + look_m, along.segment);
                        self.car.steering_towards(target)
                    }
                    None => 0.0,
                }
            }
        }
    }

    fn look_ahead_m(&self) -> f64 {
        LOOK_AHEAD_M.max(LOOK_AHEAD_S * self.car.speed_mps)
    }

    /// Returns the start of the present phase.
    fn origin(&mut self) -> (Vec2, Vec2) {
        *self.origin.get_or_insert((self.car.position, self.car.axis))
    }

    /// Returns the point of a sideways move that lies `look_m` further along it.
    fn shifted(&mut self, left_m: f64, over_m: f64, look_m: f64) -> Vec2 {
        let (from, axis) = self.origin();
        let ahead_m = (self.car.position - from).dot(axis) + look_m;
        let share = (ahead_m / over_m).clamp(0.0, 1.0);
        // Smooth at both ends: heading and line change without a jump.
        let moved_m = left_m * share * share * (3.0 - 2.0 * share);
        from + axis * ahead_m + axis.left() * moved_m
    }

    /// Returns `true` if it has turned that far since the phase began.
    fn is_turned(&mut self, left_rad: f64) -> bool {
        let (_, axis) = self.origin();
        let turned_rad = num::atan2(axis.cross(self.car.axis), axis.dot(self.car.axis));
        turned_rad * left_rad.signum() >= left_rad.abs()
    }

    /// Returns the present phase's path with the place on it, `gone_m` further along it than the last time.
    fn on_path(&mut self, gone_m: f64) -> Option<(&Path, Along)> {
        let path = self.paths.get(self.phase)?.as_ref()?;
        let place = self.car.position;
        let along = match self.along {
            None => path.project(place),
            Some(known) if gone_m > 0.0 => {
                let s_m = known.s_m + gone_m;
                Along { s_m, segment: path.segment_near(s_m, known.segment), ..known }
            }
            Some(known) => path.project_near(place, &known, 2.0, 2.0 + DT_S * DEFAULT_LIMITS.speed_mps),
        };
        self.along = Some(along);
        Some((path, along))
    }

    fn walk(&mut self, phase: Option<&Phase>, ego: &EgoForecast) -> Sample {
        let mps = phase.map_or(0.0, |phase| self.asked_mps(&phase.speed, ego));
        let way_m = mps * DT_S;
        let place = self.car.position;
        let target = match phase.map(|phase| &phase.way) {
            Some(Way::Points { points }) => {
                let delta = points[self.tick.min(points.len() - 1)] - place;
                let left_m = delta.norm();
                if left_m > 1e-9 { place + delta * (way_m.min(left_m) / left_m) } else { place }
            }
            Some(Way::Path { .. }) if way_m > 0.0 => {
                // The first step leads onto the path.
                if self.along.is_none() {
                    self.on_path(0.0);
                }
                self.on_path(way_m).map_or(place, |(path, along)| path.at(along.s_m, along.segment))
            }
            Some(Way::Shift { left_m, over_m }) => {
                let step = self.shifted(*left_m, *over_m, WALK_LOOK_M) - place;
                place + step * (way_m / step.norm().max(WALK_LOOK_M))
            }
            Some(Way::Turn { left_rad, .. }) => {
                let (_, axis) = self.origin();
                place + axis.rotated(*left_rad) * way_m
            }
            _ => place + self.car.axis * way_m,
        };
        let step = target - place;
        let heading_rad = if step.norm() > 1e-9 { num::wrap_angle(step.heading()) } else { self.car.heading_rad };
        let sample = Sample { position: target, heading_rad, velocity: step * (1.0 / DT_S) };
        (self.car.position, self.car.heading_rad) = (target, heading_rad);
        self.car.axis = Vec2::from_heading(heading_rad);
        sample
    }
}

/// Returns the sample at which a scripted road user stands.
pub(in crate::sim) fn standing(script: &Script) -> Sample {
    let heading_rad = num::wrap_angle(script.spawn.heading_rad);
    Sample { position: script.spawn.position, heading_rad, velocity: Vec2::ZERO }
}
