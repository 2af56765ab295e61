//! The generated routes against the measures of the benchmark's own.

use super::*;
use crate::kernel::Polyline;
use crate::scene::safebench::Stage;
use crate::scene::{LaneGraph, usable};

const SEEDS: [Seed; 3] = [Seed(1), Seed(7), Seed(20_261_121)];

fn scenes(family: TrafficFamily) -> Vec<Scene> {
    SEEDS.into_iter().flat_map(|seed| (4..=13).map(move |route| family_scene(family, route, seed))).collect()
}

/// Route length, arc length of the trigger, and the first spawn frame.
fn measures(scene: &Scene) -> (f64, f64, Option<SpawnFrame>) {
    let route = Polyline::new(scene.ego.route.clone()).unwrap();
    let staging = scene.staging.as_ref().unwrap();
    let at = route.project(staging.trigger.position);
    assert!(at.offset_m.abs() < 0.05, "{}: the trigger lies on the route", scene.id);
    assert!(num::wrap_angle(at.heading_rad - staging.trigger.heading_rad).abs() < 0.1, "{}", scene.id);
    (route.length_m(), at.s_m, staging.spawns.first().copied())
}

#[test]
fn eighty_sound_usable_scenes_of_their_own_names_make_the_pool() {
    let options = FamilyOptions::all();
    let pool: Vec<Scene> = (0..options.count()).map(|i| family_member(&options, Seed(7), i).unwrap()).collect();
    let mut ids: Vec<&str> = pool.iter().map(|s| s.id.as_str()).collect();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!((pool.len(), ids.len()), (80, 80));
    for scene in &pool {
        assert_eq!(scene.validate(), vec![], "{}", scene.id);
        assert_eq!(usable(scene), Ok(()), "{}", scene.id);
        let tags = crate::scene::SceneFeatures::of(scene, &LaneGraph::of(&scene.road)).tags;
        assert!(tags.contains(&scene.staging.as_ref().unwrap().family.name()), "{}: {tags:?}", scene.id);
    }
    assert_eq!(family_member(&options, Seed(7), 33).unwrap(), pool[33], "equal seeds give equal scenes");
    assert_ne!(family_member(&options, Seed(8), 33).unwrap().digest(), pool[33].digest());
}

#[test]
fn draws_of_a_group_are_one_scene_under_several_names() {
    let options = FamilyOptions { families: vec![TrafficFamily::RightTurn], routes: vec![5, 9], draws: 3 };
    let pool: Vec<Scene> = (0..options.count()).map(|i| family_member(&options, Seed(7), i).unwrap()).collect();
    let ids: Vec<&str> = pool.iter().map(|scene| scene.id.as_str()).collect();
    let route = |n: &str| ["", "/draw01", "/draw02"].map(|draw| format!("safebench/right_turn/{n}{draw}"));
    assert_eq!(ids, [route("05"), route("09")].concat());
    assert_eq!(pool[0], family_scene(TrafficFamily::RightTurn, 5, Seed(7)), "the first is that of a pool of one draw");
    assert_eq!(Scene { id: pool[0].id.clone(), ..pool[2].clone() }, pool[0]);
    assert_ne!(pool[2].digest(), pool[0].digest(), "so that each has a rollout of its own");
    assert!(FamilyOptions { draws: 0, ..options.clone() }.check().is_err());
    assert!(FamilyOptions { draws: 101, ..options }.check().is_err());
}

#[test]
fn every_route_follows_lanes_in_their_direction() {
    for scene in TrafficFamily::ALL.into_iter().flat_map(scenes) {
        let graph = LaneGraph::of(&scene.road);
        for pair in scene.ego.route.windows(2) {
            let lane = graph.nearest_lane(pair[0].lerp(pair[1], 0.5), (pair[1] - pair[0]).heading(), 1.0);
            assert!(lane.is_some_and(|place| place.distance_m < 0.3), "{}", scene.id);
        }
    }
}

#[test]
fn lengths_and_triggers_lie_in_the_measured_ranges() {
    let ranges = [
        ((80.0, 109.0), (20.0, 40.0)),
        ((61.0, 89.0), (20.0, 40.0)),
        ((137.0, 167.0), (16.0, 46.0)),
        ((130.0, 134.0), (29.0, 31.0)),
    ];
    for (family, (lengths, triggers)) in TrafficFamily::ALL.into_iter().zip(ranges) {
        for scene in scenes(family) {
            let (length_m, trigger_m, frame) = measures(&scene);
            assert!(length_m > lengths.0 - 0.5 && length_m < lengths.1 + 0.5, "{}: {length_m}", scene.id);
            assert!(trigger_m > triggers.0 - 0.5 && trigger_m < triggers.1 + 0.5, "{}: {trigger_m}", scene.id);
            assert_eq!(frame, None);
        }
    }
}

#[test]
fn actors_of_crossings_stand_where_the_benchmark_s_stand() {
    // Family, length, ahead, to the right.
    let ranges = [
        (TrafficFamily::RedLightRunning, (70.0, 102.0), (20.0, 33.0), (-22.0, -19.0)),
        (TrafficFamily::UnprotectedLeftTurn, (53.0, 77.0), (41.0, 52.0), (-4.5, -2.6)),
        (TrafficFamily::RightTurn, (60.0, 106.0), (28.0, 31.0), (-21.0, -19.0)),
        (TrafficFamily::CrossingNegotiation, (76.0, 91.0), (21.0, 34.0), (-27.9, -19.3)),
    ];
    for (family, lengths, ahead, right) in ranges {
        for scene in scenes(family) {
            let (length_m, _, frame) = measures(&scene);
            let frame = frame.unwrap();
            let within = |x: f64, range: (f64, f64)| x > range.0 - 0.5 && x < range.1 + 0.5;
            assert!(within(length_m, lengths) && within(frame.right_m, right), "{}: {length_m} {frame:?}", scene.id);
            let skew = scene.staging.as_ref().unwrap().route == 4 && family == TrafficFamily::CrossingNegotiation;
            assert!(skew || within(frame.fwd_m, ahead), "{}: {frame:?}", scene.id);
            let yaw = match family {
                TrafficFamily::UnprotectedLeftTurn => num::PI,
                _ if skew => -72.0 * num::PI / 180.0,
                _ => -num::FRAC_PI_2,
            };
            assert!(num::wrap_angle(frame.yaw_rad - yaw).abs() < 0.02, "{}: {frame:?}", scene.id);
            let pose = scene.staging.as_ref().unwrap().pose(&frame);
            let lane = LaneGraph::of(&scene.road).nearest_lane(pose.position, pose.heading_rad, 0.1);
            assert!(lane.is_some(), "{}: the actor stands in a lane of its direction", scene.id);
        }
    }
}

#[test]
fn turns_go_the_way_of_their_routes() {
    let turned = |scene: &Scene| {
        let route = &scene.ego.route;
        let last = (route[route.len() - 1] - route[route.len() - 2]).heading();
        num::wrap_angle(last - (route[1] - route[0]).heading()).to_degrees()
    };
    let turn = |family, route| turned(&family_scene(family, route, Seed(7)));
    let near = |a: f64, b: f64| (a - b).abs() < 2.0;
    for (route, degrees) in [(4, 90.0), (5, -90.0), (6, -70.0), (11, -110.0), (10, 90.0)] {
        assert!(near(turn(TrafficFamily::TurningObstacle, route), degrees), "route {route}");
    }
    assert!(near(turn(TrafficFamily::UnprotectedLeftTurn, 8), 90.0));
    assert!(near(turn(TrafficFamily::RightTurn, 8), -90.0));
    assert!(near(turn(TrafficFamily::VehiclePassing, 4), -90.0) && near(turn(TrafficFamily::VehiclePassing, 5), 0.0));
    assert!(near(turn(TrafficFamily::RedLightRunning, 9), 0.0));
}

#[test]
fn a_stage_finds_the_roadside_the_left_lane_and_the_exit_of_the_turn() {
    let walker = family_scene(TrafficFamily::StraightObstacle, 5, Seed(7));
    let stage = Stage::of(&walker).unwrap();
    let (ahead, roadside) = (stage.ahead(45.0), stage.roadside(45.0));
    let local = ahead.to_local(roadside.pose.position);
    assert!(local.x.abs() < 0.05 && (local.y + roadside.lane_width_m).abs() < 0.05, "{local:?}: on the sidewalk");
    assert!((num::wrap_angle(roadside.pose.heading_rad - ahead.heading_rad) - num::FRAC_PI_2).abs() < 0.01);
    assert_eq!(roadside.lanes_between, 0, "the ego drives in the right-most lane");
    let change = family_scene(TrafficFamily::LaneChanging, 5, Seed(7));
    assert!(Stage::of(&change).unwrap().left_lane(35.0).unwrap().same_direction);
    let passing = family_scene(TrafficFamily::VehiclePassing, 5, Seed(7));
    let stage = Stage::of(&passing).unwrap();
    let oncoming = stage.left_lane(80.0).unwrap();
    assert!(!oncoming.same_direction);
    let back = num::wrap_angle(oncoming.pose.heading_rad - stage.ahead(80.0).heading_rad).abs();
    assert!((back - num::PI).abs() < 0.01);
    assert_eq!(stage.turn_exit_m(), None);
    let turning = family_scene(TrafficFamily::TurningObstacle, 5, Seed(7));
    let exit_m = Stage::of(&turning).unwrap().turn_exit_m().unwrap();
    assert!(exit_m > 10.0 && exit_m < 50.0, "{exit_m}");
}

#[test]
fn lights_say_what_each_family_needs() {
    let states = |family| {
        let scene = family_scene(family, 6, Seed(7));
        scene.lights.iter().map(|l| l.states[0]).fold(Vec::new(), |mut seen, s| {
            if !seen.contains(&s) {
                seen.push(s);
            }
            seen
        })
    };
    assert_eq!(states(TrafficFamily::CrossingNegotiation).len(), 0);
    assert_eq!(states(TrafficFamily::RedLightRunning).len(), 2);
    let own = |family| family_scene(family, 6, Seed(7)).lights[0].states[0];
    assert_eq!(own(TrafficFamily::RedLightRunning), LightState::Go);
    assert_eq!(own(TrafficFamily::RightTurn), LightState::Stop);
}

#[test]
fn options_that_name_no_scene_are_refused() {
    let mut options = FamilyOptions::all();
    options.routes.push(14);
    assert!(options.check().unwrap_err().to_string().contains("4 to 13"));
    options.routes = vec![4, 4];
    assert!(options.check().is_err());
    options = FamilyOptions { families: vec![], ..FamilyOptions::all() };
    assert!(options.check().is_err());
}
