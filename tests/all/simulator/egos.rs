//! The ego policies.

use crate::ego::network::Mlp;
use crate::ego::observation::ACTION;
use crate::ego::{Policy, PolicyError, Setting, Weights};
use crate::kernel::{Seed, Vec2};
use crate::scene::{AgentKind, Light, LightState, Scene, Track};
use crate::sim::scenes::*;
use crate::sim::*;
use evodrive::synth::{FamilyOptions, family_member};

#[test]
fn policies_are_found_by_their_names_and_differ_in_their_digests() {
    let policies: Vec<Policy> = Policy::NAMES.iter().map(|n| n.parse().unwrap()).collect();
    for (i, policy) in policies.iter().enumerate() {
        assert_eq!(policy.name().parse(), Ok(policy.clone()));
        assert!(policies[i + 1..].iter().all(|other| other.digest() != policy.digest()));
    }
    assert_eq!("learned".parse::<Policy>(), Err(PolicyError::NoWeights));
    assert!("expert".parse::<Policy>().is_err());
}

#[test]
fn only_the_ego_that_minds_lights_stops_at_a_red_one() {
    let mut scene = straight_road(121, 8.0, vec![]);
    let states = vec![LightState::Stop; 121];
    scene.lights = vec![Light { lane: 0, stop_point: Vec2::new(60.0, 0.5), states }];
    let plant = Plant::new(&scene).unwrap();
    let end = |policy: Policy| rollout_traced(&plant, &Intervention::default(), &mut *policy.driver()).unwrap();
    assert_eq!(end(Policy::Idm).0.end, End::Arrived);
    let (outcome, trace) = end(Policy::IdmMindingLights);
    assert_eq!(outcome.end, End::Horizon);
    assert!(trace.ego.last().unwrap().position.x < 60.0);
}

/// Weights of one number a hidden layer that drive straight on at a pace that the speed in the observation sets.
fn cruise() -> Vec<u8> {
    let mut actor = Mlp::zeros(&[Setting::Metadrive1.length(), 1, 1, 2 * ACTION]);
    let [first, second, heads] = &mut actor.layers[..] else { panic!("three layers") };
    first.weights[0] = 4.0;
    second.weights[0] = 1.0;
    (heads.weights[1], heads.bias[1]) = (-1.0, 1.6);
    Weights::to_bytes(Setting::Metadrive1, &actor).unwrap()
}

#[test]
fn a_learned_ego_drives_by_its_weights() {
    let mut scene = straight_road(91, 4.0, vec![]);
    scene.ego.route = vec![Vec2::ZERO, Vec2::new(300.0, 0.0)];
    let plant = Plant::new(&scene).unwrap();
    let policy = Policy::learned(&cruise()).unwrap();
    let (outcome, trace) = rollout_traced(&plant, &Intervention::default(), &mut *policy.driver()).unwrap();
    assert_eq!(outcome.end, End::Horizon);
    // Throttle tanh(1.6 - 4 v / 20) is zero at 8 m/s.
    assert!((trace.ego.last().unwrap().speed_mps() - 8.0).abs() < 0.3, "{outcome:?}");
}

/// An actor with drawn weights.
fn drawn(setting: Setting) -> Policy {
    let mut stream = Seed(1).stream(&["weights"]);
    let mut actor = Mlp::zeros(&[setting.length(), 16, 16, 2 * ACTION]);
    actor.parameters_mut().flatten().for_each(|x| *x = stream.normal(0.0, 0.4) as f32);
    Policy::learned(&Weights::to_bytes(setting, &actor).unwrap()).unwrap()
}

#[test]
fn a_learned_ego_sees_its_surroundings_and_repeats_itself() {
    let policy = drawn(Setting::Metadrive1);
    let run = |count: usize| {
        let plant = Plant::new(&crossing(4, count, 91)).unwrap();
        rollout(&plant, &Intervention::default(), &mut *policy.driver()).unwrap()
    };
    assert_eq!(run(20), run(20));
    assert_ne!(run(20).ego, run(1).ego);
}

/// Keeps what it would have observed, and never moves.
struct Watcher(Setting, Vec<Vec<f32>>);

impl Driver for Watcher {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        let mut seen = Vec::new();
        self.0.observe(view, &mut seen);
        self.1.push(seen);
        Control::Drive { acceleration_mps2: -10.0, steering_rad: 0.0 }
    }
}

fn first_sight(setting: Setting, scene: &Scene) -> Vec<f32> {
    let plant = Plant::new(scene).unwrap();
    let mut watcher = Watcher(setting, vec![]);
    rollout(&plant, &Intervention::default(), &mut watcher).unwrap();
    watcher.1.swap_remove(0)
}

#[test]
fn an_observation_tells_route_edge_and_who_is_ahead() {
    let ahead = car("lead", straight(sample(18.0, 0.0, 0.0, 0.0), 91));
    let seen = first_sight(Setting::Metadrive1, &straight_road(91, 8.0, vec![ahead]));
    assert_eq!(seen.len(), Setting::Metadrive1.length());
    assert_eq!(seen[0], 8.0 / 20.0, "speed");
    assert!(seen[10..30].chunks(2).zip(1..).all(|(p, i)| (p[0] - 2.0 * i as f32 / 30.0).abs() < 1e-6 && p[1] == 0.0));
    // The lidar's first ray meets the rear of the car ahead, the ray to the rear meets nobody.
    let lidar = &seen[42..66];
    let expected = 1.0 - (18.0 - 0.5 * 4.5) / 50.0;
    assert!((lidar[0] - expected).abs() < 0.01 && lidar[12] == 0.0, "{lidar:?}");
    // The first road user: there, 18 m ahead, coming nearer with 8 m/s, alike in heading.
    let other = &seen[66..76];
    assert!((other[1] - 18.0 / 50.0).abs() < 1e-6 && (other[3] + 8.0 / 20.0).abs() < 1e-6, "{other:?}");
    assert_eq!((other[0], other[5], seen[76]), (1.0, 1.0, 0.0));
    // Edges to the left and the right are near, those along the road far.
    let edges = &seen[30..42];
    assert!(edges[3] > 0.5 && edges[9] > 0.5 && edges[0] < edges[3], "{edges:?}");
    let alone = first_sight(Setting::Metadrive1, &straight_road(91, 8.0, vec![]));
    assert!(alone[42..].iter().all(|x| *x == 0.0), "nobody is zero");
}

#[test]
fn safebenchs_four_numbers_are_offset_turn_speed_and_a_flag() {
    let seen = |cars| first_sight(Setting::Safebench2, &straight_road(91, 8.0, cars));
    assert_eq!(seen(vec![]), [0.0, 0.0, 8.0, 0.0]);
    assert_eq!(seen(vec![car("lead", straight(sample(12.0, 0.0, 0.0, 0.0), 91))])[3], 1.0);
    assert_eq!(seen(vec![car("far", straight(sample(25.0, 0.0, 0.0, 0.0), 91))])[3], 0.0);
}

/// The four numbers of an ego at this height beside a straight route and lane, with this heading.
fn four(setting: Setting, y: f64, heading_rad: f64, cars: Vec<Track>) -> Vec<f32> {
    let mut scene = straight_road(91, 8.0, cars);
    scene.ego.track.samples = straight(sample(0.0, y, heading_rad, 8.0), 91);
    scene.road.lanes.push(lane(Vec2::new(-50.0, 4.0), Vec2::new(250.0, 4.0)));
    scene.road.lanes[1].id = "beside".into();
    first_sight(setting, &scene)
}

#[test]
fn safebenchs_turn_is_positive_to_the_left_as_its_offset_is() {
    let near = |seen: Vec<f32>, offset: f32, turn: f32| {
        assert!((seen[0] - offset).abs() < 1e-6 && (seen[1] - turn).abs() < 1e-6, "{seen:?}");
    };
    near(four(Setting::Safebench2, 1.5, 0.2, vec![]), 1.5, 0.2);
    near(four(Setting::Safebench2, -1.0, -0.3, vec![]), -1.0, -0.3);
    // What the recorded weights were trained with.
    near(four(Setting::Safebench1, 1.5, 0.2, vec![]), 1.5, -0.2);
}

#[test]
fn safebenchs_flag_is_a_vehicle_whose_centre_is_ahead_in_the_egos_lane() {
    let flag = |kind: AgentKind, x: f64, y: f64, heading_rad: f64| {
        let standing = Track { kind, ..car("other", straight(sample(x, y, heading_rad, 0.0), 91)) };
        four(Setting::Safebench2, 0.0, 0.0, vec![standing])[3]
    };
    assert_eq!(flag(AgentKind::Vehicle, 14.5, 0.0, 0.0), 1.0);
    assert_eq!(flag(AgentKind::Cyclist, 14.5, 0.0, 0.0), 1.0, "a bicycle is a vehicle to CARLA");
    assert_eq!(flag(AgentKind::Vehicle, 14.5, 1.5, 1.5), 1.0, "across the lane");
    assert_eq!([AgentKind::Pedestrian, AgentKind::Static].map(|kind| flag(kind, 12.0, 0.0, 0.0)), [0.0; 2]);
    assert_eq!(flag(AgentKind::Vehicle, 12.0, 2.5, 0.0), 0.0, "its side reaches in, its centre is in the other lane");
    assert_eq!(flag(AgentKind::Vehicle, 15.1, 0.0, 0.0), 0.0);
    assert_eq!(flag(AgentKind::Vehicle, -6.0, 0.0, 0.0), 0.0);
    // The old one saw all of those within reach that are on the route.
    let walker = Track { kind: AgentKind::Pedestrian, ..car("other", straight(sample(12.0, 0.0, 0.0, 0.0), 91)) };
    assert_eq!(four(Setting::Safebench1, 0.0, 0.0, vec![walker])[3], 1.0);
}

#[test]
fn the_sections_of_an_opendrive_road_are_one_lane_and_two_roads_are_not() {
    let flag = |own: &str, ahead: &str| {
        let mut scene = straight_road(91, 8.0, vec![car("lead", straight(sample(10.0, 0.0, 0.0, 0.0), 91))]);
        scene.road.lanes =
            vec![lane(Vec2::new(-50.0, 0.0), Vec2::new(5.0, 0.0)), lane(Vec2::new(5.0, 0.0), Vec2::new(250.0, 0.0))];
        (scene.road.lanes[0].id, scene.road.lanes[1].id) = (own.into(), ahead.into());
        first_sight(Setting::Safebench2, &scene)[3]
    };
    assert_eq!(flag("7/0/-1", "7/1/-1"), 1.0);
    assert_eq!(flag("7/0/-1", "7/1/-2"), 0.0);
    assert_eq!(flag("7/0/-1", "8/0/-1"), 0.0);
    assert_eq!(flag("a", "b"), 0.0);
}

/// ChatScene's network.
fn published() -> Weights {
    Weights::from_bytes(include_bytes!("../../../policies/sac-chatscene.safetensors")).unwrap()
}

/// Steering and pedal that a network of four numbers gives.
fn acts(weights: &Weights, seen: [f32; 4]) -> [f32; 2] {
    weights.act(&mut seen.to_vec(), &mut Vec::new())
}

#[test]
fn an_ego_that_learned_among_traffic_brakes_behind_a_vehicle_and_one_that_met_none_does_not() {
    let pedals = |bytes: &[u8]| {
        let weights = Weights::from_bytes(bytes).unwrap();
        [5.0, 6.0].map(|speed| [0.0, 1.0].map(|behind| acts(&weights, [0.0, 0.0, speed, behind])[1]))
    };
    let taught = pedals(include_bytes!("../../../policies/sac-safebench-2.safetensors"));
    let alone = pedals(include_bytes!("../../../policies/sac-safebench.safetensors"));
    assert!(taught.iter().all(|[free, behind]| *behind < -0.9 && *free > 0.0), "{taught:?}");
    assert!(alone.iter().all(|[free, behind]| behind > &(free - 0.2)), "{alone:?}");
}

#[test]
fn chatscenes_network_steers_back_to_the_route_and_slows_behind_a_vehicle() {
    let weights = published();
    let acts = |seen| acts(&weights, seen);
    let steers = |offset, turn| acts([offset, turn, 6.0, 0.0])[0];
    assert!(steers(-1.0, 0.0) > steers(0.0, 0.0) && steers(0.0, 0.0) > steers(1.0, 0.0), "back from either side");
    assert!(steers(0.0, -0.1) > 0.3 && steers(0.0, 0.1) < -0.1, "a turn to the left is positive");
    // Pedals that torch gives: alone, then with a vehicle ahead.
    for (speed, alone, behind) in [(6.0, 0.99984, 0.85560), (7.0, 0.53615, 0.04552)] {
        let pedal = |flag| acts([0.0, 0.0, speed, flag])[1];
        assert!((pedal(0.0) - alone).abs() < 1e-4 && (pedal(1.0) - behind).abs() < 1e-4, "{speed}");
    }
}

/// With the other sign of the second number it turns away from the route, so the two settings differ sharply.
#[test]
fn chatscenes_network_keeps_to_its_routes_by_the_sign_that_it_was_trained_with_and_by_no_other() {
    let options = FamilyOptions::all();
    let every = options.count() / 8;
    let plants: Vec<Plant> =
        (0..8).map(|i| Plant::new(&family_member(&options, Seed(7), i * every).unwrap()).unwrap()).collect();
    let driven = |setting| {
        let policy = Policy::Learned(Weights { setting, ..published() });
        let rides = plants.iter().map(|plant| rollout(plant, &Intervention::default(), &mut *policy.driver()).unwrap());
        let rides: Vec<Outcome> = rides.collect();
        let off = rides.iter().filter(|ride| ride.end == End::OffRoad).count();
        (rides.iter().map(|ride| ride.route_completion).sum::<f64>() / 8.0, off)
    };
    let (right, wrong) = (driven(Setting::Safebench2), driven(Setting::Safebench1));
    assert!(right.0 > 0.98 && right.1 == 0, "{right:?}");
    assert!(wrong.0 < 0.5 && wrong.1 >= 7, "{wrong:?}");
}
