//! The ego's ways to evade: full braking, and swerves by pure pursuit of its route shifted aside, with and without
//! braking.

use serde::{Deserialize, Serialize};

use crate::kernel::num;
use crate::scene::DT_S;
use crate::sim::prepared::options::AvoidanceOptions;
use crate::sim::prepared::path::Path;
use crate::sim::road_users::bicycle::Car;
use crate::sim::road_users::driver::EgoState;

/// A swerve looks as far ahead on the shifted route as the ego goes in this time, at least so many metres.
const PURSUIT_S: f64 = 0.6;
const PURSUIT_M: f64 = 4.0;

/// A way to evade.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Manoeuvre {
    /// Full braking along the route.
    Brake,
    /// A swerve to the left, with the brakes that the tyres have left.
    BrakeLeft,
    /// The same to the right.
    BrakeRight,
    /// A swerve to the left at constant speed.
    SwerveLeft,
    /// The same to the right.
    SwerveRight,
}

impl Manoeuvre {
    /// All manoeuvres in the order in which they are tried: most contacts need braking.
    pub const ALL: [Manoeuvre; 5] =
        [Manoeuvre::Brake, Manoeuvre::BrakeLeft, Manoeuvre::BrakeRight, Manoeuvre::SwerveLeft, Manoeuvre::SwerveRight];

    /// Returns the manoeuvre in words.
    pub fn in_words(self) -> &'static str {
        match self {
            Manoeuvre::Brake => "braking",
            Manoeuvre::BrakeLeft => "braking and swerving left",
            Manoeuvre::BrakeRight => "braking and swerving right",
            Manoeuvre::SwerveLeft => "swerving left",
            Manoeuvre::SwerveRight => "swerving right",
        }
    }

    /// Returns 1 to the left, -1 to the right, 0 straight on.
    pub(super) fn side(self) -> f64 {
        match self {
            Manoeuvre::Brake => 0.0,
            Manoeuvre::BrakeLeft | Manoeuvre::SwerveLeft => 1.0,
            Manoeuvre::BrakeRight | Manoeuvre::SwerveRight => -1.0,
        }
    }

    fn brakes(self) -> bool {
        !matches!(self, Manoeuvre::SwerveLeft | Manoeuvre::SwerveRight)
    }
}

/// A manoeuvre under way.
pub(in crate::sim) struct Evasion<'a> {
    options: &'a AvoidanceOptions,
    brake_mps2: f64,
    /// Deceleration when it began, m/s²: the ego does not brake less than that.
    braked_mps2: f64,
    /// Offset beside the route that it leads to, metres.
    offset_m: f64,
}

impl<'a> Evasion<'a> {
    /// Begins a manoeuvre. `swerve_m` is how far a swerve goes aside.
    pub fn new(manoeuvre: Manoeuvre, swerve_m: f64, ego: &EgoState, options: &'a AvoidanceOptions) -> Evasion<'a> {
        let swerve_mps2 = if manoeuvre.side() == 0.0 { 0.0 } else { options.swerve_mps2 };
        let left_for_brakes = options.brake_mps2 * options.brake_mps2 - swerve_mps2 * swerve_mps2;
        let brake_mps2 = if manoeuvre.brakes() { left_for_brakes.max(0.0).sqrt() } else { 0.0 };
        let aside_m = manoeuvre.side() * swerve_m;
        let offset_m =
            if aside_m == 0.0 { ego.along.offset_m } else { (ego.along.offset_m + aside_m).clamp(-swerve_m, swerve_m) };
        Evasion { options, brake_mps2, braked_mps2: (-ego.acceleration_mps2).clamp(0.0, brake_mps2), offset_m }
    }

    /// Returns acceleration (m/s²) and steering (radians) some decision steps after it began.
    pub fn control(&self, route: &Path, ego: &EgoState, car: &Car, steps: usize) -> (f64, f64) {
        let risen = if self.options.brake_rise_s > 0.0 {
            ((steps + 1) as f64 * DT_S / self.options.brake_rise_s).min(1.0)
        } else {
            1.0
        };
        let deceleration = (self.brake_mps2 * risen).max(self.braked_mps2);
        (-deceleration, self.steering_rad(route, ego, car))
    }

    fn steering_rad(&self, route: &Path, ego: &EgoState, car: &Car) -> f64 {
        let look_m = PURSUIT_M.max(PURSUIT_S * ego.speed_mps);
        let s_m = ego.along.s_m + look_m;
        let direction = route.direction(route.segment_near(s_m, ego.along.segment));
        let aim = route.at(s_m, ego.along.segment) + direction.left() * self.offset_m;
        let delta = aim - ego.sample.position;
        let curvature_1pm = 2.0 * ego.axis.cross(delta) / delta.norm_squared().max(1.0);
        let most_1pm = self.options.swerve_mps2 / num::powu(ego.speed_mps.max(1.0), 2);
        car.steering_for(curvature_1pm.clamp(-most_1pm, most_1pm))
    }
}
