//! SEAL's reactive second: eight motion primitives of ten decision steps. Each second one is chosen by its predicted distance to
//! the ego, its way off the road and its effort.
//!
//! The stand-in for the learned skill space of Stoler et al. (2025): its prior over skills is taken as uniform, so
//! it drops out of the choice.

use crate::kernel::{Vec2, num};
use crate::scene::DT_S;
use crate::sim::prepared::body::{Place, SUBSTEPS, Size};
use crate::sim::prepared::drivable::Drivable;

use super::bicycle::{Car, DEFAULT_LIMITS};

/// Number of decision steps a skill lasts (1 s).
pub const SKILL_STEPS: usize = 10;
/// Weight of the effort against a metre of distance.
pub const EFFORT_WEIGHT: f64 = 0.3;
/// Weight of a metre that a corner ends farther off the road than it is now, against a metre of distance.
pub const ROAD_WEIGHT: f64 = 2.0;
/// Steps of a skill between two looks at the road.
const ROAD_STRIDE: usize = 5;
/// Largest steering of a swerve or a cut-in, radians.
const STEERING_RAD: f64 = 0.15;

/// A motion primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Skill {
    /// Wheels straight, speed kept.
    Hold,
    /// 2 m/s² of braking.
    BrakeMildly,
    /// 6 m/s² of braking.
    BrakeHard,
    /// 2 m/s² of acceleration.
    Accelerate,
    /// Half a sine of steering: leaves with another heading.
    SwerveLeft,
    /// The same to the right.
    SwerveRight,
    /// A whole sine of steering: leaves beside its old line with the old heading.
    CutInLeft,
    /// The same to the right.
    CutInRight,
}

/// All skills in the order in which they are tried; the first of equals wins.
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
    /// Returns acceleration (m/s²) and steering (radians) in the given step of the skill.
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
    /// Place now.
    pub place: Place,
    /// Velocity in the scene's frame, m/s.
    pub velocity: Vec2,
    /// Acceleration along the velocity, m/s².
    pub acceleration_mps2: f64,
    /// Its box.
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

/// Returns the skill with the smallest predicted box distance to the ego plus weighted way off the road plus weighted mean effort
/// `a² + δ²v²`. Metres off the road count beyond those at which the car already is.
pub fn choose(car: &Car, size: &Size, ego: &EgoForecast, road: &Drivable) -> Skill {
    let ahead: [Place; SKILL_STEPS] = core::array::from_fn(|k| ego.after((k + 1) as f64 * DT_S));
    let mut hint = u32::MAX;
    let off_road_m = departure_m(road, size, car.place(), 0.0, &mut hint);
    let (mut best, mut best_cost) = (Skill::Hold, f64::INFINITY);
    for skill in SKILLS {
        let mut around = Surroundings { road, off_road_m, hint: &mut hint };
        let cost = cost(skill, car, size, ego, &ahead, &mut around);
        if cost < best_cost {
            (best, best_cost) = (skill, cost);
        }
    }
    best
}

/// The road, the car's present distance off it, and a piece of it near the car.
struct Surroundings<'a> {
    road: &'a Drivable,
    off_road_m: f64,
    hint: &'a mut u32,
}

fn cost(
    skill: Skill,
    car: &Car,
    size: &Size,
    ego: &EgoForecast,
    ahead: &[Place; SKILL_STEPS],
    around: &mut Surroundings<'_>,
) -> f64 {
    let (mut car, mut nearest, mut effort, mut off_road_m) = (*car, f64::INFINITY, 0.0, around.off_road_m);
    for (step, place) in ahead.iter().enumerate() {
        let (acceleration, steering) = skill.control(step);
        effort += acceleration * acceleration + steering * steering * car.speed_mps * car.speed_mps;
        car = car.drive(acceleration, steering, &DEFAULT_LIMITS)[SUBSTEPS - 1];
        nearest = nearest.min(size.at(car.place()).distance(&ego.size.at(*place)));
        if (step + 1) % ROAD_STRIDE == 0 {
            off_road_m = off_road_m.max(departure_m(around.road, size, car.place(), off_road_m, around.hint));
        }
    }
    nearest + EFFORT_WEIGHT * effort / SKILL_STEPS as f64 + ROAD_WEIGHT * (off_road_m - around.off_road_m)
}

/// Returns how far the outermost corner is off the road, metres; exact above `floor_m`.
fn departure_m(road: &Drivable, size: &Size, place: Place, floor_m: f64, hint: &mut u32) -> f64 {
    size.at(place).corners().iter().fold(floor_m, |most, corner| most.max(road.distance_m(*corner, most, hint)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Sample;
    use crate::scene::fixture::two_lane_scene;
    use crate::sim::prepared::plant::Plant;

    /// Returns the choice of a car near the right edge (y = -1.75) while the ego stands beyond it.
    fn choice(with_lanes: bool) -> Skill {
        let mut scene = two_lane_scene();
        if !with_lanes {
            scene.road.lanes.clear();
        }
        let plant = Plant::new(&scene).unwrap();
        let velocity = Vec2::new(10.0, 0.0);
        let car = Car::new(&Sample { position: Vec2::new(50.0, -0.5), heading_rad: 0.0, velocity }, 4.5);
        let place = Place { position: Vec2::new(58.0, -6.0), axis: Vec2::new(1.0, 0.0) };
        let ego = EgoForecast { place, velocity: Vec2::ZERO, acceleration_mps2: 0.0, size: plant.ego_size };
        choose(&car, &plant.ego_size, &ego, &plant.drivable)
    }

    #[test]
    fn a_car_that_swerves_toward_an_ego_beside_it_goes_on_when_that_ego_brakes() {
        let plant = Plant::new(&two_lane_scene()).unwrap();
        let velocity = Vec2::new(10.0, 0.0);
        let car = Car::new(&Sample { position: Vec2::new(50.0, 0.0), heading_rad: 0.0, velocity }, 4.5);
        let place = Place { position: Vec2::new(45.0, 3.5), axis: Vec2::new(1.0, 0.0) };
        let chosen = |acceleration_mps2: f64| {
            let ego = EgoForecast { place, velocity, acceleration_mps2, size: plant.ego_size };
            choose(&car, &plant.ego_size, &ego, &plant.drivable)
        };
        assert_eq!((chosen(0.0), chosen(-8.0)), (Skill::SwerveLeft, Skill::Hold));
    }

    #[test]
    fn a_skill_leads_to_the_ego_but_not_off_the_road() {
        assert_eq!(choice(false), Skill::SwerveRight);
        assert!(!matches!(choice(true), Skill::SwerveRight | Skill::CutInRight), "{:?}", choice(true));
    }
}
