//! MetaDrive's default car: a rigid body on four sprung wheels that look for the road by rays, as Bullet's raycast vehicle has it
//! (`btRaycastVehicle`, Bullet 2.8), on level ground. Springs, tyres, brakes and the order in which they act are Bullet's, the numbers are
//! those of MetaDrive 0.4.3; nothing is fitted but the loss in the first physics step.
//!
//! A wheel's tyre takes a fifth of its sideways speed away in each physics step, as far as friction times load lasts. A wheel that wants
//! more slides, and all its forces shrink. So a wheel turned sharply holds little, pushes outward and costs speed, brakes take less from
//! the unloaded rear wheels, and a car that is put on the road with its springs pressed together brakes better while it rises.

use nalgebra::{Matrix3, Quaternion, Vector3};

use crate::kernel::{Pose, Vec2, num};
use crate::scene::Sample;
use crate::sim::prepared::body::{Place, SUBSTEP_S, SUBSTEPS};

use super::bicycle::Limits;
use super::idm;

type Vector = Vector3<f64>;

const MASS_KG: f64 = 1100.0;
/// Moments of inertia of a box of 1.852 x 4.515 x 1.19 m about its right, forward and upward axis, kg m².
const INERTIA_KGM2: [f64; 3] = [1998.45, 444.217, 2183.05];
const GRAVITY_MPS2: f64 = 9.81;
/// Drive of a wheel at full throttle, N.
const ENGINE_N: f64 = 759.4636;
/// Largest impulse of a wheel's brake in a physics step at full pedal, N s.
const BRAKE_NS: f64 = 89.4636;
/// The same while the throttle is shut and no brake is pressed, N s.
const IDLE_BRAKE_NS: f64 = 2.0;
/// Places of the wheels: half the track, and distances before and behind the centre, metres. The height is that above the car's origin.
const TRACK_M: f64 = 0.815;
const FRONT_M: f64 = 1.05234;
const REAR_M: f64 = 1.4166;
const HUNG_M: f64 = 0.113;
const WHEEL_RADIUS_M: f64 = 0.313;
/// Length of a spring without load, and its travel, metres.
const SPRING_M: f64 = 0.4;
const SPRING_TRAVEL_M: f64 = 0.15;
/// A spring's force over its compression and the car's mass, 1/s².
const STIFFNESS: f64 = 40.0;
/// Effect of a damper on the speed of compression and of relaxation, times the mass, 1/s.
const COMPRESSION: f64 = 1.2;
const RELAXATION: f64 = 4.8;
/// Largest force of a spring on the car, N. It does not bound the tyre's load.
const SPRING_N_MAX: f64 = 6000.0;
/// Friction of a tyre, and the part of the lever by which its side force rolls the car.
const FRICTION: f64 = 0.9;
const ROLL_SHARE: f64 = 0.5;
/// Part of a wheel's sideways speed that its tyre takes away in a physics step, and the share of a forward impulse that counts against friction.
const SIDE_SHARE: f64 = 0.2;
const FORWARD_SHARE: f64 = 0.5;
/// MetaDrive puts the car on the road with its floor on the ground. One corner scrapes in the first physics step: the speed that this costs,
/// and the upward speed that it gives, m/s. Measured, unlike the rest of this file.
const SCRAPE_MPS: f64 = 0.0205;
const BUMP_MPS: f64 = 0.033;

/// Places of front right, front left, rear right, rear left wheel, by right, forward and upward axis.
const WHEELS: [[f64; 3]; 4] =
    [[TRACK_M, FRONT_M, HUNG_M], [-TRACK_M, FRONT_M, HUNG_M], [TRACK_M, -REAR_M, HUNG_M], [-TRACK_M, -REAR_M, HUNG_M]];
const FRONT_WHEELS: usize = 2;

/// A car in motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SprungCar {
    /// Its origin, metres; the ground is at height 0.
    position: Vector,
    /// Turns the axes right, forward, upward into the scene's.
    orientation: Quaternion<f64>,
    velocity: Vector,
    /// Angular velocity, rad/s.
    spin: Vector,
    /// Its centre and heading: position and orientation as seen on the ground.
    pose: Pose,
    /// Centre and heading a physics step ago. MetaDrive shows every body there, to its driver, too.
    shown: Pose,
    /// True until it moves for the first time after it was put on the road.
    scrapes: bool,
}

/// State of a wheel in a physics step.
#[derive(Clone, Copy)]
struct Wheel {
    /// Vector from the car's origin to the point where it touches the road, metres.
    lever: Vector,
    /// Load, N; 0 in the air.
    load_n: f64,
    touches: bool,
    /// Unit vectors on the road.
    axle: Vector,
    ahead: Vector,
    /// Impulses, N s.
    forward_ns: f64,
    side_ns: f64,
}

impl SprungCar {
    /// Makes a car put on the road at a sample.
    pub fn new(sample: &Sample) -> SprungCar {
        let (sine, cosine) = num::sin_cos(0.5 * (sample.heading_rad - num::FRAC_PI_2));
        SprungCar {
            position: Vector::new(sample.position.x, sample.position.y, 0.0),
            orientation: Quaternion::new(cosine, 0.0, 0.0, sine),
            velocity: Vector::new(sample.velocity.x, sample.velocity.y, 0.0),
            spin: Vector::zeros(),
            pose: Pose { position: sample.position, heading_rad: sample.heading_rad },
            shown: Pose { position: sample.position, heading_rad: sample.heading_rad },
            scrapes: true,
        }
    }

    /// Returns its place.
    pub fn place(&self) -> Place {
        Place { position: self.pose.position, axis: Vec2::from_heading(self.pose.heading_rad) }
    }

    /// Returns its place and its motion.
    pub fn sample(&self) -> Sample {
        self.sample_at(self.pose)
    }

    /// Returns its place as MetaDrive shows it: a physics step late, with the velocity of now.
    pub fn shown(&self) -> Sample {
        self.sample_at(self.shown)
    }

    fn sample_at(&self, Pose { position, heading_rad }: Pose) -> Sample {
        Sample { position, heading_rad, velocity: Vec2::new(self.velocity.x, self.velocity.y) }
    }

    /// Drives one decision step under constant controls, and returns the car after each physics step. The acceleration is that of a pedal
    /// ([`idm::pedal`]): the effect of the pedal on this car depends on its loads.
    pub fn drive(&self, acceleration_mps2: f64, steering_rad: f64, limits: &Limits) -> [SprungCar; SUBSTEPS] {
        let pedal = idm::pedal(acceleration_mps2, limits);
        let steering_rad = steering_rad.clamp(-limits.steering_rad, limits.steering_rad);
        let mut car = *self;
        core::array::from_fn(|_| {
            car.substep(pedal, steering_rad, limits.speed_mps);
            car
        })
    }

    /// Does a physics step: bodies move first, by the speed they have, and springs and tyres act after that.
    fn substep(&mut self, pedal: f64, steering_rad: f64, speed_mps_max: f64) {
        self.shown = self.pose;
        let speed_mps = num::hypot(self.velocity.x, self.velocity.y);
        let engine_n = if pedal >= 0.0 && speed_mps <= speed_mps_max { ENGINE_N * pedal } else { 0.0 };
        let brake_ns = if pedal >= 0.0 { IDLE_BRAKE_NS } else { -BRAKE_NS * pedal };
        self.velocity.z -= GRAVITY_MPS2 * SUBSTEP_S;
        self.position += self.velocity * SUBSTEP_S;
        self.turn();
        let axes = rotation(&self.orientation);
        self.pose = Pose {
            position: Vec2::new(self.position.x, self.position.y),
            heading_rad: num::atan2(axes[(1, 1)], axes[(0, 1)]),
        };
        let inverse = axes * Matrix3::from_diagonal(&Vector::from(INERTIA_KGM2.map(|i| 1.0 / i))) * axes.transpose();
        let turned = num::sin_cos(steering_rad);
        let mut wheels: [Wheel; 4] = core::array::from_fn(|i| self.wheel(i, &axes, turned));
        for wheel in &wheels {
            let push = Vector::z() * (wheel.load_n.min(SPRING_N_MAX) * SUBSTEP_S);
            self.push(push, wheel.lever, &inverse);
        }
        let on_road = wheels.iter().filter(|wheel| wheel.touches).count().max(1) as f64;
        let mut slides = [1.0; 4];
        for (wheel, slides) in wheels.iter_mut().zip(&mut slides).filter(|(wheel, _)| wheel.touches) {
            let moves = self.velocity + self.spin.cross(&wheel.lever);
            wheel.side_ns = -SIDE_SHARE * wheel.axle.dot(&moves) / yields(wheel.lever, wheel.axle, &inverse);
            wheel.forward_ns = if engine_n != 0.0 {
                engine_n * SUBSTEP_S
            } else {
                let stops = -wheel.ahead.dot(&moves) / yields(wheel.lever, wheel.ahead, &inverse) / on_road;
                stops.clamp(-brake_ns, brake_ns)
            };
            let (most, forward) = (wheel.load_n * SUBSTEP_S * FRICTION, FORWARD_SHARE * wheel.forward_ns);
            let wanted = (forward * forward + wheel.side_ns * wheel.side_ns).sqrt();
            *slides = if wanted > most { most / wanted } else { 1.0 };
        }
        for (wheel, slides) in wheels.iter().zip(slides).filter(|(wheel, _)| wheel.touches) {
            // A wheel without any side force slides as little as possible: Bullet's rule.
            let slides = if wheel.side_ns != 0.0 { slides } else { 1.0 };
            self.push(wheel.ahead * (wheel.forward_ns * slides), wheel.lever, &inverse);
            let up = axes.column(2).into_owned();
            let lever = wheel.lever - up * (up.dot(&wheel.lever) * (1.0 - ROLL_SHARE));
            self.push(wheel.axle * (wheel.side_ns * slides), lever, &inverse);
        }
        self.scrape();
    }

    fn turn(&mut self) {
        let rate = self.spin.norm();
        if rate > 1e-12 {
            let (sine, cosine) = num::sin_cos(0.5 * rate * SUBSTEP_S);
            let axis = self.spin * (sine / rate);
            let turned = Quaternion::new(cosine, axis.x, axis.y, axis.z) * self.orientation;
            self.orientation = turned / turned.norm();
        }
    }

    /// Returns a wheel's place on the road and its load, by sine and cosine of the front wheels' angle. Impulses are computed later.
    fn wheel(&self, i: usize, axes: &Matrix3<f64>, turned: (f64, f64)) -> Wheel {
        let (right, up) = (axes.column(0).into_owned(), axes.column(2).into_owned());
        let hung = axes * Vector::from(WHEELS[i]);
        // Down the car's own axis to height 0.
        let reach_m = if up.z > 0.0 { (self.position.z + hung.z) / up.z } else { f64::INFINITY };
        let touches = (0.0..=SPRING_M + WHEEL_RADIUS_M).contains(&reach_m);
        let lever = hung - up * reach_m.clamp(0.0, SPRING_M + WHEEL_RADIUS_M);
        let load_n = if touches {
            let spring_m = (reach_m - WHEEL_RADIUS_M).clamp(SPRING_M - SPRING_TRAVEL_M, SPRING_M + SPRING_TRAVEL_M);
            let rises = (self.velocity + self.spin.cross(&lever)).z;
            // A car that lies on its side does not stand on its wheels.
            let (inverse, rises) = if up.z <= 0.1 { (10.0, 0.0) } else { (1.0 / up.z, rises / up.z) };
            let damper = if rises < 0.0 { COMPRESSION } else { RELAXATION };
            (MASS_KG * (STIFFNESS * (SPRING_M - spring_m) * inverse - damper * rises)).max(0.0)
        } else {
            0.0
        };
        let (sine, cosine) = if i < FRONT_WHEELS { turned } else { (0.0, 1.0) };
        let axle = right * cosine + up.cross(&right) * sine;
        let axle = Vector::new(axle.x, axle.y, 0.0).normalize();
        Wheel { lever, load_n, touches, axle, ahead: Vector::z().cross(&axle), forward_ns: 0.0, side_ns: 0.0 }
    }

    fn push(&mut self, impulse_ns: Vector, lever: Vector, inverse: &Matrix3<f64>) {
        self.velocity += impulse_ns / MASS_KG;
        self.spin += inverse * lever.cross(&impulse_ns);
    }

    fn scrape(&mut self) {
        if !core::mem::replace(&mut self.scrapes, false) {
            return;
        }
        let speed_mps = num::hypot(self.velocity.x, self.velocity.y);
        if speed_mps > 0.0 {
            let share = (1.0 - SCRAPE_MPS / speed_mps).max(0.0);
            (self.velocity.x, self.velocity.y) = (self.velocity.x * share, self.velocity.y * share);
        }
        self.velocity.z += BUMP_MPS;
    }
}

/// Returns the speed that an impulse of 1 N s at a lever gives the body there in its own direction, 1/kg.
fn yields(lever: Vector, direction: Vector, inverse: &Matrix3<f64>) -> f64 {
    let moment = lever.cross(&direction);
    1.0 / MASS_KG + moment.dot(&(inverse * moment))
}

/// Returns a matrix whose columns are the car's axes right, forward, upward.
fn rotation(q: &Quaternion<f64>) -> Matrix3<f64> {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::prepared::plant_options::PlantOptions;

    fn rolling() -> SprungCar {
        let velocity = Vec2::new(8.0, 0.0);
        SprungCar::new(&Sample { position: Vec2::ZERO, heading_rad: 0.0, velocity })
    }

    #[test]
    fn a_pedal_is_found_again_in_what_it_asks_for_also_where_half_brakes_take_all() {
        let all_at_half = PlantOptions { full_brake_mps2: 8.13, ..PlantOptions::METADRIVE_0_4_3 };
        for plant in [PlantOptions::PHYSICAL, PlantOptions::METADRIVE_0_4_3, all_at_half] {
            let limits = plant.limits();
            for pedal in (-10..=10).map(|tenths| 0.1 * f64::from(tenths)) {
                let asked = idm::acceleration_mps2(pedal, &limits);
                let again = idm::pedal(asked, &limits);
                assert!((idm::acceleration_mps2(again, &limits) - asked).abs() < 1e-12, "{pedal}: {again}");
                let one_pedal_each = limits.half_brake_mps2 < limits.brake_mps2 || pedal > -0.5;
                assert!(!one_pedal_each || (again - pedal).abs() < 1e-12, "{pedal}: {again}");
            }
            assert_eq!(idm::pedal(idm::acceleration_mps2(-1.0, &limits), &limits), -1.0);
        }
    }

    #[test]
    fn a_car_on_its_side_or_upside_down_has_finite_numbers() {
        let limits = PlantOptions::METADRIVE_0_4_3.limits();
        for (sine, cosine) in [(0.5f64.sqrt(), 0.5f64.sqrt()), (1.0, 0.0)] {
            let mut car = rolling();
            // Turned about its forward axis.
            car.orientation *= Quaternion::new(cosine, 0.0, sine, 0.0);
            for _ in 0..20 {
                car = car.drive(-5.0, 0.3, &limits)[SUBSTEPS - 1];
            }
            let sample = car.sample();
            let numbers =
                [sample.position.x, sample.position.y, sample.heading_rad, sample.velocity.x, sample.velocity.y];
            assert!(numbers.iter().all(|number| number.is_finite()), "{numbers:?}");
        }
    }

    #[test]
    fn a_braked_car_comes_to_rest_and_full_brakes_take_more_while_it_rises_on_its_springs() {
        let limits = PlantOptions::METADRIVE_0_4_3.limits();
        let mut car = rolling();
        let mut speeds = vec![car.sample().speed_mps()];
        for _ in 0..15 {
            car = car.drive(-limits.brake_mps2, 0.0, &limits)[SUBSTEPS - 1];
            speeds.push(car.sample().speed_mps());
        }
        assert!(speeds[0] - speeds[1] > 1.5 && speeds[15] < 0.1, "{speeds:?}");
    }
}
