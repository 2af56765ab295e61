//! Kinematic single-track model about the centre of the box, with the limits of MetaDrive's default car. Its tyres have
//! a grip limit, and bends cost speed.

use serde::{Deserialize, Serialize};

use crate::kernel::{Vec2, num};
use crate::scene::{DT_S, Sample};
use crate::sim::prepared::body::{Place, SUBSTEP_S, SUBSTEPS};

/// Limits of a car.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest angle of the front wheels to either side, radians.
    pub steering_rad: f64,
    /// Top speed, m/s.
    pub speed_mps: f64,
    /// Acceleration at full throttle, m/s².
    pub engine_mps2: f64,
    /// Deceleration at half brake, m/s².
    pub half_brake_mps2: f64,
    /// Deceleration at full brake, m/s².
    pub brake_mps2: f64,
    /// Largest lateral acceleration the tyres hold, m/s²; beyond it the car understeers.
    pub grip_mps2: f64,
    /// Loss of speed in a bend.
    pub cornering_loss: CorneringLoss,
    /// Brakes at the beginning of an episode, where they differ.
    pub settling: Option<Settling>,
}

/// A simulated car that is put on the road with its springs pressed together rises on them at first. While it does, more weight than its
/// own rests on the wheels, and full brakes take more.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settling {
    /// Duration of the settling, s.
    pub seconds: f64,
    /// Full brake during that time, m/s².
    pub full_brake_mps2: f64,
}

impl Limits {
    /// Returns the limits so many decision steps after the beginning of an episode.
    pub fn at_step(&self, k: usize) -> Limits {
        match self.settling {
            Some(Settling { seconds, full_brake_mps2 }) if (k as f64) * DT_S < seconds - 1e-9 => {
                Limits { brake_mps2: full_brake_mps2, ..*self }
            }
            _ => *self,
        }
    }
}

/// Loss of speed in a bend, as a deceleration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "law", rename_all = "snake_case", deny_unknown_fields)]
pub enum CorneringLoss {
    /// The side force of a tyre, times the sine of its slip angle, works against the motion. With a lateral acceleration
    /// `a` all tyres slip by `a / (c g)`; front wheels that are turned by more than the curve needs slip by the rest, too
    /// (linear tyres: Gillespie, Fundamentals of Vehicle Dynamics, 1992, chapters 6 and 10).
    TyreSlip {
        /// `c`: cornering stiffness over load, 1/rad. About 9.2 (0.16 per degree) for a passenger car's radial tyres.
        cornering_coefficient: f64,
    },
    /// This share of `|v yaw rate| sin |δ|`: the result of a fit to MetaDrive at full throttle.
    Steering {
        /// The share, 0 to 2.
        share: f64,
    },
    /// `|v yaw rate| sin |δ| (share + skid s) + drive s t`, where the front wheels slide by the part `s = max(0, 1 - holds / a)` of
    /// the lateral acceleration `a` of the curve to which they are turned, and `t` is the acceleration by throttle. Wheels that slide drag,
    /// lose drive, and push along their own axle alone: turned by `δ` they have the grip `cos δ` to turn the car with. Measured on
    /// MetaDrive's car (docs/PLANT.md).
    Skid {
        /// Share while the wheels hold, 0 to 2.
        share: f64,
        /// Additional loss of wheels that slide altogether, 0 to 4.
        skid: f64,
        /// Part of the drive that wheels lose when they slide altogether, 0 to 1.
        drive: f64,
        /// Lateral acceleration at which they begin to slide, m/s².
        holds_mps2: f64,
    },
}

/// A car of MetaDrive's default size on tyres that hold 0.9 g: steering 40°, 80 km/h, four wheels of 759 N on 1100 kg
/// (2.76 m/s², as measured).
pub const DEFAULT_LIMITS: Limits = Limits {
    steering_rad: 40.0 * num::PI / 180.0,
    speed_mps: 80.0 / 3.6,
    engine_mps2: 2.76,
    half_brake_mps2: 0.45 * GRAVITY_MPS2,
    brake_mps2: 0.9 * GRAVITY_MPS2,
    grip_mps2: 0.9 * GRAVITY_MPS2,
    cornering_loss: CorneringLoss::TyreSlip { cornering_coefficient: 9.2 },
    settling: None,
};

const GRAVITY_MPS2: f64 = 9.81;
/// Distance up to which a waypoint is reached, so that the wheels go straight, metres.
const REACHED_M: f64 = 0.5;

// Axle offsets of MetaDrive's default car (1.05234 m front, 1.4166 m rear) as shares of its length 4.515 m.
/// Distance from the middle of the box to the front axle, as a share of its length.
pub const FRONT_SHARE: f64 = 1.05234 / 4.515;
/// Distance from the rear axle to the middle of the box, likewise.
pub const REAR_SHARE: f64 = 1.4166 / 4.515;

/// A car in motion. It never drives backwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Car {
    /// The centre of its box, metres.
    pub position: Vec2,
    /// Heading, (-π, π].
    pub heading_rad: f64,
    /// The same as a vector of length 1.
    pub axis: Vec2,
    /// Speed of the centre, m/s; at least 0.
    pub speed_mps: f64,
    /// Direction of motion of the centre: the axis turned by the slip angle.
    pub course: Vec2,
    front_m: f64,
    rear_m: f64,
}

impl Car {
    /// Makes a car of some length at a sample; its speed is the velocity's share along its heading, at least 0.
    pub fn new(sample: &Sample, length_m: f64) -> Car {
        let axis = Vec2::from_heading(sample.heading_rad);
        Car {
            position: sample.position,
            heading_rad: num::wrap_angle(sample.heading_rad),
            axis,
            speed_mps: sample.velocity.dot(axis).max(0.0),
            course: axis,
            front_m: FRONT_SHARE * length_m,
            rear_m: REAR_SHARE * length_m,
        }
    }

    /// Makes the car that is seen there with this axis: it slips in a bend, so it is faster than along its heading.
    pub(in crate::sim) fn seen(sample: &Sample, axis: Vec2, length_m: f64) -> Car {
        let mut car = Car { axis, ..Car::new(sample, length_m) };
        if car.speed_mps > 0.0 {
            car.speed_mps = sample.speed_mps();
            car.course = sample.velocity * (1.0 / car.speed_mps);
        }
        car
    }

    /// Returns its pose and velocity as a sample; the velocity points along the course.
    pub fn sample(&self) -> Sample {
        Sample { position: self.position, heading_rad: self.heading_rad, velocity: self.course * self.speed_mps }
    }

    /// Returns its centre and axis.
    pub fn place(&self) -> Place {
        Place { position: self.position, axis: self.axis }
    }

    /// Returns the sine of the slip angle of a steering angle, as far as grip allows at this speed.
    fn slip_sine(&self, steering_rad: f64, limits: &Limits) -> f64 {
        let steering = steering_rad.clamp(-limits.steering_rad, limits.steering_rad);
        let tan_slip = num::tan(steering) * self.rear_m / (self.front_m + self.rear_m);
        let sine = tan_slip / (1.0 + tan_slip * tan_slip).sqrt();
        let grip_mps2 = match limits.cornering_loss {
            CorneringLoss::Skid { .. } => limits.grip_mps2 * num::cos(steering),
            _ => limits.grip_mps2,
        };
        let most = grip_mps2 * self.rear_m / (self.speed_mps * self.speed_mps).max(1e-9);
        sine.clamp(-most, most)
    }

    /// Returns the lateral acceleration of the curve to which the wheels are turned, m/s², even if the tyres cannot hold it.
    fn steered_mps2(&self, turned_rad: f64) -> f64 {
        let tan_slip = num::tan(turned_rad) * self.rear_m / (self.front_m + self.rear_m);
        self.speed_mps * self.speed_mps * tan_slip / (1.0 + tan_slip * tan_slip).sqrt() / self.rear_m
    }

    /// Returns the steering angle that turns the car by `curvature_1pm` (1/m, positive to the left), grip aside; the inverse of
    /// its effect in [`Car::drive`].
    pub fn steering_for(&self, curvature_1pm: f64) -> f64 {
        let sine = (curvature_1pm * self.rear_m).clamp(-0.99, 0.99);
        let tan_slip = sine / (1.0 - sine * sine).sqrt();
        num::atan(tan_slip * (self.front_m + self.rear_m) / self.rear_m)
    }

    /// Returns the steering angle of the arc through a point; straight on where the point is reached or lies behind.
    pub fn steering_towards(&self, target: Vec2) -> f64 {
        let delta = target - self.position;
        let squared = delta.norm_squared();
        if squared < REACHED_M * REACHED_M || delta.dot(self.axis) <= 0.0 {
            return 0.0;
        }
        self.steering_for(2.0 * self.axis.cross(delta) / squared)
    }

    /// Returns the loss of speed in the bend that the car drives with a slip of this sine, m/s².
    fn cornering_loss_mps2(&self, acceleration_mps2: f64, steering_rad: f64, sine: f64, limits: &Limits) -> f64 {
        let lateral_mps2 = self.speed_mps * self.speed_mps * sine.abs() / self.rear_m;
        let turned_rad = steering_rad.clamp(-limits.steering_rad, limits.steering_rad).abs();
        if turned_rad == 0.0 {
            return 0.0;
        }
        match limits.cornering_loss {
            CorneringLoss::Steering { share } => share * lateral_mps2 * num::sin(turned_rad),
            CorneringLoss::Skid { share, skid, drive, holds_mps2 } => {
                let slides = (1.0 - holds_mps2 / self.steered_mps2(turned_rad).max(1e-9)).max(0.0);
                (share + skid * slides) * lateral_mps2 * num::sin(turned_rad)
                    + drive * slides * acceleration_mps2.max(0.0)
            }
            CorneringLoss::TyreSlip { cornering_coefficient } => {
                let slip_rad = lateral_mps2 / (cornering_coefficient * GRAVITY_MPS2);
                let needed_rad = self.steering_for(sine.abs() / self.rear_m);
                // The share of the weight on the front axle, which is that of its side force.
                let front = self.rear_m / (self.front_m + self.rear_m);
                let beyond_rad = (turned_rad - needed_rad).max(0.0);
                lateral_mps2 * (num::sin(slip_rad) + front * num::sin(beyond_rad))
            }
        }
    }

    /// Returns the curvature of the tightest bend that its wheels can steer, 1/m.
    pub(in crate::sim) fn curvature_max_1pm(&self, limits: &Limits) -> f64 {
        let tan_slip = num::tan(limits.steering_rad) * self.rear_m / (self.front_m + self.rear_m);
        tan_slip / (1.0 + tan_slip * tan_slip).sqrt() / self.rear_m
    }

    /// Returns the acceleration and steering angle under which it reaches a pose after so many physics steps: the inverse of [`Car::drive`].
    /// If its limits do not allow that, they lead somewhere else.
    pub(in crate::sim) fn controls_to(&self, next: &Sample, substeps: usize, limits: &Limits) -> (f64, f64) {
        let turn = num::wrap_angle(next.heading_rad - self.heading_rad);
        let moved = next.position - self.position;
        // A pose that rounding has put behind it is one that it has reached: it never drives backwards.
        let chord_m = if moved.dot(self.axis) > 0.0 { moved.norm() } else { 0.0 };
        let (mut way_m, mut acceleration, mut sine) = (chord_m, 0.0, 0.0);
        for _ in 0..3 {
            acceleration = self.acceleration_over(way_m, next.speed_mps(), substeps, limits);
            sine = if way_m > 1e-12 { (turn / way_m * self.rear_m).clamp(-0.99, 0.99) } else { 0.0 };
            let mut car = *self;
            let cosine = (1.0 - sine * sine).sqrt();
            (0..substeps).for_each(|_| car.substep(acceleration, sine, cosine, limits));
            let reached_m = self.position.distance(car.position);
            // The way is longer than its chord.
            way_m = if reached_m > 1e-12 { way_m * chord_m / reached_m } else { way_m };
        }
        let steering_rad = self.steering_for(sine / self.rear_m);
        // The loss in the bend comes on top; in some laws it grows with the throttle.
        let loss = |throttle: f64| self.cornering_loss_mps2(throttle, steering_rad, sine, limits);
        let (coasting, share) = (loss(0.0), loss(1.0) - loss(0.0));
        let wanted = acceleration + coasting;
        (if wanted > 0.0 { wanted / (1.0 - share).max(1e-9) } else { wanted }, steering_rad)
    }

    /// Returns the constant acceleration under which it drives this way and has this speed at its end.
    fn acceleration_over(&self, way_m: f64, speed_mps: f64, substeps: usize, limits: &Limits) -> f64 {
        let driven_m = |acceleration: f64| {
            let (mut speed, mut driven) = (self.speed_mps, 0.0);
            for _ in 0..substeps {
                let (next, distance) = advance(speed, acceleration, limits.speed_mps, SUBSTEP_S);
                (speed, driven) = (next, driven + distance);
            }
            driven
        };
        let even = (speed_mps - self.speed_mps) / (substeps.max(1) as f64 * SUBSTEP_S);
        if speed_mps > 0.0 && (driven_m(even) - way_m).abs() < 1e-8 {
            return even;
        }
        // It stopped, or reached its top speed, on the way.
        // The bounds lie beyond the limits, too: the search for a way must not end at the limits.
        let (mut low, mut high) = (-2.0 * limits.brake_mps2, 2.0 * limits.engine_mps2);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if driven_m(middle) < way_m { low = middle } else { high = middle }
        }
        if self.speed_mps == 0.0 && way_m == 0.0 { 0.0 } else { 0.5 * (low + high) }
    }

    /// Drives one decision step under constant controls, and returns the car after each physics step.
    pub fn drive(&self, acceleration_mps2: f64, steering_rad: f64, limits: &Limits) -> [Car; SUBSTEPS] {
        let acceleration = acceleration_mps2.clamp(-limits.brake_mps2, limits.engine_mps2);
        let sine = self.slip_sine(steering_rad, limits);
        let loss = self.cornering_loss_mps2(acceleration, steering_rad, sine, limits);
        let acceleration = (acceleration - loss).max(-limits.brake_mps2);
        let cosine = (1.0 - sine * sine).max(0.0).sqrt();
        let mut car = *self;
        core::array::from_fn(|j| {
            car.substep(acceleration, sine, cosine, limits);
            if j + 1 == SUBSTEPS {
                // Turning the axis five times loses a few bits of its length; the heading is what counts.
                car.heading_rad = num::wrap_angle(car.heading_rad);
                car.axis = Vec2::from_heading(car.heading_rad);
                car.course = turned(car.axis, sine, cosine);
            }
            car
        })
    }

    /// Does a midpoint step: the centre runs along the chord of its arc.
    fn substep(&mut self, acceleration: f64, sine: f64, cosine: f64, limits: &Limits) {
        let (speed, distance) = advance(self.speed_mps, acceleration, limits.speed_mps, SUBSTEP_S);
        let turn = distance * sine / self.rear_m;
        let (half_sine, half_cosine) = num::sin_cos(0.5 * turn);
        let middle = turned(self.axis, half_sine, half_cosine);
        self.position = self.position + turned(middle, sine, cosine) * distance;
        self.heading_rad += turn;
        self.axis = turned(middle, half_sine, half_cosine);
        self.course = turned(self.axis, sine, cosine);
        self.speed_mps = speed;
    }
}

/// Returns speed and distance after `seconds` of constant acceleration: stops at 0, gains nothing beyond `most_mps`.
pub fn advance(speed_mps: f64, acceleration_mps2: f64, most_mps: f64, seconds: f64) -> (f64, f64) {
    let wanted = speed_mps + acceleration_mps2 * seconds;
    if wanted <= 0.0 {
        let distance = if acceleration_mps2 < 0.0 { -0.5 * speed_mps * speed_mps / acceleration_mps2 } else { 0.0 };
        return (0.0, distance);
    }
    let speed = wanted.min(most_mps.max(speed_mps));
    (speed, 0.5 * (speed_mps + speed) * seconds)
}

fn turned(axis: Vec2, sine: f64, cosine: f64) -> Vec2 {
    Vec2::new(axis.x * cosine - axis.y * sine, axis.x * sine + axis.y * cosine)
}
