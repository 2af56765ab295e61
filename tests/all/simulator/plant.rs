//! The law of the car against MetaDrive 0.4.3 as measured, and each option of the plant where it decides an outcome.

use std::sync::Arc;

use crate::ego::Policy;
use crate::kernel::{Vec2, num};
use crate::scene::{PreparedScene, Scene};
use crate::scenes::*;
use crate::sim::bicycle::{Car, DEFAULT_LIMITS, Limits};
use crate::sim::body::SUBSTEPS;
use crate::sim::*;

fn physical() -> SimulatorOptions {
    SimulatorOptions::SHIPPED
}

fn metadrive() -> SimulatorOptions {
    SimulatorOptions { plant: PlantOptions::METADRIVE_0_4_3, ..SimulatorOptions::SHIPPED }
}

fn under(scene: &Scene, options: &SimulatorOptions) -> Outcome {
    let plant = Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), options).unwrap();
    rollout(&plant, &Intervention::default(), &mut *Policy::Idm.driver()).unwrap()
}

/// Change of speed in one decision step of a car of MetaDrive's default size, m/s².
fn measured(speed_mps: f64, acceleration_mps2: f64, steer: f64, limits: &Limits) -> f64 {
    let car = Car::new(&sample(0.0, 0.0, 0.0, speed_mps), 4.515);
    let next = car.drive(acceleration_mps2, steer * limits.steering_rad, limits)[SUBSTEPS - 1];
    (next.speed_mps - speed_mps) / 0.1
}

/// Pedal and mean deceleration (m/s²) over the first 0.8 s from 15 m/s of MetaDrive 0.4.3's default vehicle.
const BRAKES: [(f64, f64); 6] = [(0.1, 1.63), (0.2, 3.25), (0.3, 4.88), (0.5, 8.05), (0.7, 9.71), (1.0, 11.68)];

#[test]
fn the_metadrive_plant_brakes_and_accelerates_as_measured() {
    let limits = PlantOptions::METADRIVE_0_4_3.limits();
    for (pedal, deceleration) in BRAKES {
        let law = -idm::acceleration_mps2(-pedal, &limits);
        assert!((law - deceleration).abs() < 0.35, "pedal {pedal}: {law} {deceleration}");
        assert!((measured(15.0, -law, 0.0, &limits) + law).abs() < 1e-9);
    }
    assert!((measured(10.0, idm::acceleration_mps2(1.0, &limits), 0.0, &limits) - 2.76).abs() < 1e-9);
}

/// Speed (m/s), steering as a share of 40 degrees, and change of speed (m/s²) at full throttle 0.5 to 1.5 s after the wheel
/// was turned, of the same vehicle.
const BENDS_AT_FULL_THROTTLE: [(f64, f64, f64); 12] = [
    (13.6, 0.1, 2.67),
    (9.2, 0.2, 2.64),
    (13.0, 0.2, 1.55),
    (9.0, 0.3, 2.49),
    (11.6, 0.3, 1.11),
    (8.6, 0.4, 1.81),
    (11.5, 0.4, 0.44),
    (8.8, 0.5, 0.78),
    (11.1, 0.5, 0.07),
    (7.8, 0.7, 0.29),
    (7.4, 0.9, -0.45),
    (6.8, 1.0, -0.67),
];

/// The same at closed throttle, less the 0.364 m/s² that it loses straight on.
const BENDS_COASTING: [(f64, f64, f64); 10] = [
    (10.6, 0.1, -0.04),
    (10.4, 0.2, -0.16),
    (7.6, 0.3, -0.14),
    (10.1, 0.3, -0.41),
    (7.1, 0.4, -0.23),
    (9.8, 0.4, -0.66),
    (6.9, 0.5, -0.35),
    (9.5, 0.5, -0.96),
    (6.2, 0.7, -0.63),
    (8.8, 0.7, -1.57),
];

fn errors(rows: &[(f64, f64, f64)], pedal_mps2: f64, limits: &Limits) -> Vec<f64> {
    rows.iter().map(|&(speed, steer, change)| measured(speed, pedal_mps2, steer, limits) - change).collect()
}

#[test]
fn a_bend_costs_the_metadrive_plant_at_full_throttle_what_was_measured() {
    let limits = PlantOptions::METADRIVE_0_4_3.limits();
    let found = errors(&BENDS_AT_FULL_THROTTLE, limits.engine_mps2, &limits);
    assert!(num::mean(&found).unwrap().abs() < 0.4 && found.iter().all(|e| e.abs() < 1.0), "{found:?}");
    // Without the law it would be as fast in a bend as on a straight road.
    let mut without = limits;
    without.cornering_loss = bicycle::CorneringLoss::Steering { share: 0.0 };
    assert!(num::mean(&errors(&BENDS_AT_FULL_THROTTLE, limits.engine_mps2, &without)).unwrap() > 1.0);
}

#[test]
fn a_bend_costs_the_physical_plant_what_a_coasting_car_was_measured_to_lose() {
    let found = errors(&BENDS_COASTING, 0.0, &DEFAULT_LIMITS);
    assert!(num::mean(&found).unwrap().abs() < 0.3 && found.iter().all(|e| e.abs() < 0.6), "{found:?}");
    assert_eq!(measured(10.0, 0.0, 0.0, &DEFAULT_LIMITS), 0.0, "a straight road costs nothing");
}

#[test]
fn a_follower_starts_as_recorded_or_from_standstill() {
    let follower = car("follower", straight(sample(-30.0, 0.0, 0.0, 10.0), 91));
    let scene = straight_road(91, 10.0, vec![follower]);
    let moved = |options: &SimulatorOptions| {
        let plant = Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), options).unwrap();
        let (_, trace) = rollout_traced(&plant, &Intervention::default(), &mut *Policy::Idm.driver()).unwrap();
        trace.actors[0].samples[1].unwrap().position.x + 30.0
    };
    assert!((moved(&physical()) - 1.0).abs() < 0.05);
    assert!(moved(&metadrive()) < 0.05);
}

#[test]
fn a_bus_across_the_path_is_overlooked_where_only_corners_count() {
    let mut bus = car("bus", straight(sample(40.0, 0.0, num::FRAC_PI_2, 0.0), 91));
    bus.length_m = 12.0;
    let scene = straight_road(91, 8.0, vec![bus]);
    assert_eq!(under(&scene, &physical()).end, End::Horizon);
    let mut corner = physical();
    corner.plant.obstacle = Obstacle::Corner;
    assert_eq!(under(&scene, &corner).end, End::Contact);
}

#[test]
fn what_stands_across_the_end_of_the_route_is_braked_for() {
    let mut scene = straight_road(91, 8.0, vec![car("wall", straight(sample(41.0, 0.0, 0.0, 0.0), 91))]);
    scene.ego.route = vec![Vec2::ZERO, Vec2::new(40.0, 0.0)];
    for options in [physical(), metadrive()] {
        let outcome = under(&scene, &options);
        assert!(outcome.contact.is_none(), "{outcome:?}");
    }
    // Farther on it does not concern a route that ends before it.
    scene.tracks[0] = car("wall", straight(sample(46.0, 0.0, 0.0, 0.0), 91));
    assert_eq!(under(&scene, &physical()).end, End::Arrived);
}

#[test]
fn the_ego_has_its_recorded_box_or_that_of_metadrives_default_car() {
    // The wall's face is at 30 m; the ego's front 2.5 m before its centre, or 2.2575 m.
    let wall = car("wall", straight(sample(32.25, 0.0, 0.0, 0.0), 91));
    let mut scene = straight_road(91, 10.0, vec![wall]);
    scene.ego.track.length_m = 5.0;
    let gap_m = |options: &SimulatorOptions| {
        let plant = Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), options).unwrap();
        let (outcome, trace) = rollout_traced(&plant, &Intervention::default(), &mut *Policy::Replay.driver()).unwrap();
        assert!(outcome.contact.is_some());
        30.0 - trace.ego[trace.ego.len() - 1].position.x
    };
    assert!((gap_m(&physical()) - 2.4).abs() < 0.11, "{}", gap_m(&physical()));
    assert!((gap_m(&metadrive()) - 2.2).abs() < 0.11, "{}", gap_m(&metadrive()));
    assert!(gap_m(&physical()) > gap_m(&metadrive()) + 0.15);
}

#[test]
fn a_plant_is_named_or_written_out_and_bounds_are_checked() {
    let read = |plant: &str| {
        let avoidance = toml::to_string(&AvoidanceOptions::SHIPPED).unwrap();
        toml::from_str::<SimulatorOptions>(&format!("plant = {plant}\n[avoidance]\n{avoidance}"))
    };
    assert_eq!(read("\"physical\"").unwrap(), physical());
    assert_eq!(read("\"metadrive-0.4.3\"").unwrap(), metadrive());
    assert_ne!(physical().digest().unwrap(), metadrive().digest().unwrap());
    let unknown = read("\"carla\"").unwrap_err().to_string();
    assert!(unknown.contains("metadrive-0.4.3"), "{unknown}");
    let written = toml::to_string(&metadrive()).unwrap();
    assert_eq!(toml::from_str::<SimulatorOptions>(&written).unwrap(), metadrive(), "{written}");
    let mut wrong = physical();
    wrong.plant.engine_mps2 = f64::NAN;
    assert_eq!(wrong.check().unwrap_err().place, "plant.engine_mps2");
    assert!(physical().check().is_ok() && metadrive().check().is_ok());
    wrong = physical();
    wrong.avoidance.reaction_s = -0.1;
    let said = wrong.check().unwrap_err().to_string();
    assert!(said.contains("avoidance.reaction_s is -0.1, expected 0 to 10"), "{said}");
}
