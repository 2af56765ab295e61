//! SEAL's reactive second: eight motion primitives of ten decision steps, chosen every second by how near they are
//! predicted to come to the ego and how much effort they take.
//!
//! The stand-in for the learned skill space of Stoler et al. (2025): its prior over skills is taken as uniform, so
//! it drops out of the choice.

use crate::kernel::{Vec2, num};
use crate::scene::DT_S;

use super::bicycle::{Car, DEFAULT_LIMITS};
use super::body::{Place, SUBSTEPS, Size};

/// Decision steps a skill lasts (1 s).
pub const SKILL_STEPS: usize = 10;
/// Weight of the effort against a metre of distance.
pub const EFFORT_WEIGHT: f64 = 0.3;
/// Largest steering of a swerve or a cut-in, radians.
const STEERING_RAD: f64 = 0.15;

/// A motion primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Skill {
    Hold,
    BrakeMildly,
    BrakeHard,
    Accelerate,
    /// Half a sine of steering: leaves with another heading.
    SwerveLeft,
    SwerveRight,
    /// A whole sine of steering: leaves beside its old line with the old heading.
    CutInLeft,
    CutInRight,
}

/// In the order in which they are tried; the first of equals wins.
pub const SKILLS: [Skill; 8] = [
    Skill::Hold,
    Skill::BrakeMildly,
    Skill::BrakeHard,
    Skill::Accelerate,
    Skill::SwerveLeft,
    Skill::SwerveRight,
    Skill::CutInLeft,
    Skill::CutInRight,
];

impl Skill {
    /// Acceleration (m/s²) and steering (radians) in the given step of the skill.
    pub fn control(self, step: usize) -> (f64, f64) {
        let phase = (step as f64 + 0.5) / SKILL_STEPS as f64;
        let half = STEERING_RAD * num::sin(num::PI * phase);
        let whole = STEERING_RAD * num::sin(num::TAU * phase);
        match self {
            Skill::Hold => (0.0, 0.0),
            Skill::BrakeMildly => (-2.0, 0.0),
            Skill::BrakeHard => (-6.0, 0.0),
            Skill::Accelerate => (2.0, 0.0),
            Skill::SwerveLeft => (0.0, half),
            Skill::SwerveRight => (0.0, -half),
            Skill::CutInLeft => (0.0, whole),
            Skill::CutInRight => (0.0, -whole),
        }
    }
}

/// The ego as an adversary predicts it: straight on with its present acceleration, never backwards.
#[derive(Clone, Copy, Debug)]
pub struct EgoForecast {
    pub place: Place,
    pub velocity: Vec2,
    /// Along the velocity, m/s².
    pub acceleration_mps2: f64,
    pub size: Size,
}

impl EgoForecast {
    fn after(&self, seconds: f64) -> Place {
        let speed = self.velocity.norm();
        if speed < 1e-9 {
            return self.place;
        }
        let (_, distance) = super::bicycle::advance(speed, self.acceleration_mps2, f64::INFINITY, seconds);
        Place { position: self.place.position + self.velocity * (distance / speed), ..self.place }
    }
}

/// The skill with the smallest predicted box distance to the ego plus weighted mean effort `a² + δ²v²`.
pub fn choose(car: &Car, size: &Size, ego: &EgoForecast) -> Skill {
    let ahead: [Place; SKILL_STEPS] = core::array::from_fn(|k| ego.after((k + 1) as f64 * DT_S));
    let (mut best, mut best_cost) = (Skill::Hold, f64::INFINITY);
    for skill in SKILLS {
        let cost = cost(skill, car, size, ego, &ahead);
        if cost < best_cost {
            (best, best_cost) = (skill, cost);
        }
    }
    best
}

fn cost(skill: Skill, car: &Car, size: &Size, ego: &EgoForecast, ahead: &[Place; SKILL_STEPS]) -> f64 {
    let (mut car, mut nearest, mut effort) = (*car, f64::INFINITY, 0.0);
    for (step, place) in ahead.iter().enumerate() {
        let (acceleration, steering) = skill.control(step);
        effort += acceleration * acceleration + steering * steering * car.speed_mps * car.speed_mps;
        car = car.drive(acceleration, steering, &DEFAULT_LIMITS)[SUBSTEPS - 1];
        nearest = nearest.min(size.at(car.place()).distance(&ego.size.at(*place)));
    }
    nearest + EFFORT_WEIGHT * effort / SKILL_STEPS as f64
}
