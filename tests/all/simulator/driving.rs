//! SafeBench's criteria on drives whose every number can be worked out by hand: the ego repeats a drawn log.

use crate::ego::Policy;
use crate::kernel::{Pose, Vec2, num};
use crate::scene::safebench::{Staging, TrafficFamily};
use crate::scene::{Light, LightState, Sample, Scene, StopSign};
use crate::sim::scenes::*;
use crate::sim::*;

/// A road along x whose lane is 4 m wide; the ego's log lies at `y(k)` and goes 1 m a step.
fn staged(steps: usize, y: impl Fn(usize) -> f64) -> Scene {
    let mut scene = straight_road(steps, 10.0, vec![]);
    let trigger = Pose { position: Vec2::new(10.0, 0.0), heading_rad: 0.0 };
    scene.staging = Some(Staging { family: TrafficFamily::StraightObstacle, route: 4, trigger, spawns: vec![] });
    scene.ego.route = vec![Vec2::ZERO, Vec2::new(200.0, 0.0)];
    for (k, slot) in scene.ego.track.samples.iter_mut().enumerate() {
        let position = Vec2::new(k as f64, y(k));
        *slot = Some(Sample { position, heading_rad: 0.0, velocity: Vec2::new(10.0, 0.0) });
    }
    scene
}

fn outcome(scene: &Scene) -> Outcome {
    let plant = Plant::new(scene).unwrap();
    rollout(&plant, &Intervention::default(), &mut *Policy::Replay.driver()).unwrap()
}

fn driving(scene: &Scene) -> Driving {
    outcome(scene).driving.unwrap()
}

#[test]
fn only_staged_scenes_have_criteria_and_safebench_s_rules() {
    let mut scene = staged(41, |k| 0.2 * k as f64);
    assert_eq!(outcome(&scene).end, End::Horizon, "8 m beside the route is no end");
    scene.staging = None;
    let plain = outcome(&scene);
    assert_eq!((plain.end, plain.driving.is_none()), (End::OffRoad, true));
    assert!(!serde_json::to_string(&plain).unwrap().contains("driving"), "records of other scenes stay as they were");
}

#[test]
fn far_beside_the_route_or_long_astray_ends_the_run() {
    let far = outcome(&staged(41, |k| 1.0 * k as f64));
    assert_eq!((far.end, far.steps), (End::OffRoad, 31), "beyond 30 m");
    // More than 30 % of 200 m at more than 15 m beside it.
    let astray = outcome(&staged(101, |_| 16.0));
    assert_eq!((astray.end, astray.steps), (End::OffRoad, 61));
}

#[test]
fn a_completed_route_ends_the_run_by_safebench_s_rule() {
    let mut scene = staged(121, |_| 0.0);
    scene.ego.route = vec![Vec2::ZERO, Vec2::new(100.0, 0.0)];
    let found = outcome(&scene);
    assert_eq!((found.end, found.steps), (End::Arrived, 100), "more than 99 %, not 95 %");
    assert!(found.driving.unwrap().completed);
    assert!(!driving(&staged(41, |_| 0.0)).completed);
}

#[test]
fn a_light_is_run_when_the_bumper_passes_on_red() {
    let with = |states: Vec<LightState>| {
        let mut scene = staged(61, |_| 0.0);
        scene.lights = vec![Light { lane: 0, stop_point: Vec2::new(30.0, 0.0), states }];
        driving(&scene).red_lights
    };
    assert_eq!(with(vec![LightState::Stop; 61]), 1);
    assert_eq!(with(vec![LightState::Go; 61]), 0);
    // The bumper, 2.25 m ahead of the centre, passes in the step from 27 to 28.
    let mut states = vec![LightState::Stop; 61];
    states[27..].fill(LightState::Go);
    assert_eq!(with(states.clone()), 0);
    states[27] = LightState::Stop;
    assert_eq!(with(states), 1);
}

#[test]
fn a_stop_sign_asks_for_standing_before_its_line() {
    let mut scene = staged(61, |_| 0.0);
    scene.stop_signs = vec![StopSign { position: Vec2::new(30.0, 0.5), lanes: vec![0] }];
    assert_eq!(driving(&scene).stop_signs, 1);
    // It stands for a second with the bumper 2.75 m before the line.
    for k in 25..61 {
        let x = if k < 35 { 25.0 } else { 25.0 + (k - 35) as f64 };
        let speed = if k < 35 { 0.0 } else { 10.0 };
        let sample = Sample { position: Vec2::new(x, 0.0), heading_rad: 0.0, velocity: Vec2::new(speed, 0.0) };
        scene.ego.track.samples[k] = Some(sample);
    }
    assert_eq!(driving(&scene).stop_signs, 0);
    scene.stop_signs[0].position.x = 40.0;
    assert_eq!(driving(&scene).stop_signs, 1, "too early is no stop");
}

#[test]
fn off_road_metres_and_the_distance_to_the_route_are_sums_over_steps() {
    let found = driving(&staged(41, |k| 0.1 * k as f64 + 0.05));
    // The centre leaves the lane (2 m) at step 20 (2.05 m): steps 20 to 40 of sqrt(1.01) m.
    assert!((found.off_road_m - 21.0 * 1.01_f64.sqrt()).abs() < 1e-9, "{}", found.off_road_m);
    // Mean of 0.1 k + 0.05 over steps 1 to 40.
    assert!((found.route_distance_m_mean - 2.1).abs() < 1e-9 && (found.duration_s - 4.0).abs() < 1e-9);
    // A step back onto the road still counts: steps 10 (off) and 11 (after it).
    let hop = driving(&staged(41, |k| if k == 10 { 3.0 } else { 0.0 }));
    assert!((hop.off_road_m - 2.0 * 10.0_f64.sqrt()).abs() < 1e-9, "{}", hop.off_road_m);
}

#[test]
fn lane_invasions_count_steps_in_which_a_corner_crosses_a_painted_line() {
    let mut scene = staged(61, |k| 0.1 * k as f64 + 0.03);
    scene
        .road
        .lanes
        .push(crate::scene::Lane { id: "left".into(), ..lane(Vec2::new(-50.0, 4.0), Vec2::new(250.0, 4.0)) });
    // Both left corners cross y = 2 in one step, both right ones in a later one, and the left ones y = 6 once more.
    assert_eq!(driving(&scene).lane_invasions, 3);
    // A lane that is one of several ways on from another lies in a junction, where nothing is painted.
    scene.road.lanes.push(crate::scene::Lane {
        id: "before".into(),
        exits: vec![0, 1],
        ..lane(Vec2::new(-90.0, 2.0), Vec2::new(-50.0, 2.0))
    });
    scene.road.lanes[0].entries = vec![2];
    scene.road.lanes[1].entries = vec![2];
    assert_eq!(driving(&scene).lane_invasions, 0);
}

#[test]
fn acceleration_and_yaw_are_summed_as_the_benchmark_does() {
    let mut scene = staged(41, |_| 0.0);
    for (k, sample) in scene.ego.track.samples.iter_mut().flatten().enumerate() {
        // Turns left by 0.02 rad a step through pi, and gains 0.3 m/s a step.
        sample.heading_rad = num::wrap_angle(num::PI - 0.41 + 0.02 * k as f64);
        sample.velocity = Vec2::new(5.0 + 0.3 * k as f64, 0.0);
    }
    let found = driving(&scene);
    assert!((found.acceleration_mps2_mean - 3.0).abs() < 1e-9);
    // 39 steps of 0.02 and one from just below pi to just above -pi, not unwrapped.
    let wrapped = 2.0 * num::PI - 0.02;
    assert!((found.yaw_change_rad - (39.0 * 0.02 + wrapped)).abs() < 1e-9, "{}", found.yaw_change_rad);
}

/// A walker that crosses from (20, -1) at 5 m/s for ever, or turns back to the ego's line after a time.
fn crossing_walker(until: Until) -> Intervention {
    let spawn = Pose { position: Vec2::new(20.0, -1.0), heading_rad: num::FRAC_PI_2 };
    let trigger = Trigger { reference: 0, distance_m: 1e3, ego_speed_mps_min: 0.0 };
    let back = Phase { way: Way::Turn { left_rad: -2.4, radius_m: 3.0 }, ..Phase::straight(25.0, Until::Forever) };
    let phases = vec![Phase::straight(5.0, until), back];
    let kind = crate::scene::AgentKind::Pedestrian;
    Intervention {
        actions: vec![Action::Triggered(Script { kind, length_m: 0.6, width_m: 0.6, spawn, trigger, phases })],
    }
}

#[test]
fn an_adversary_is_judged_until_a_second_after_its_nearest_moment() {
    let report = |steps: usize, until: Until| {
        let plant = Plant::new(&staged(steps, |_| 0.0)).unwrap();
        rollout(&plant, &crossing_walker(until), &mut *Policy::Replay.driver()).unwrap().adversaries[0].clone()
    };
    // Ego at 10 t, walker at -1 + 5 t: nearest at 1.64 s, so what counts ends at step 26 or 27, at y = 12 or 12.5.
    let (short, long) = (report(31, Until::Forever), report(101, Until::Forever));
    assert!(short.simulated.off_road_m > 9.0 && short.simulated.off_road_m < 11.0, "{short:?}");
    assert_eq!(short.simulated.off_road_m, long.simulated.off_road_m, "however long it goes on");
    // One that comes nearer than ever before is judged as a whole: it goes to y = 14 first.
    let back = report(101, Until::Lasted { s: 3.0 });
    assert!(back.simulated.off_road_m > 11.0, "{back:?}");
}
