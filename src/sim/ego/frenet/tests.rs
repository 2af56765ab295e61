//! The Frenet driver where an answer is known.

use proptest::prelude::*;

use super::manoeuvre::Polynomial;
use super::*;
use crate::ego::Policy;
use crate::kernel::Vec2;
use crate::scene::{AgentKind, Light, LightState, Road, Scene};
use crate::sim::scenes::{car, crossing, sample, straight, straight_road};
use crate::sim::{End, Intervention, Outcome, Trace, rollout_traced};

const LONG: usize = 121;

fn driven(scene: &Scene, policy: &Policy) -> (Outcome, Trace) {
    let plant = Plant::new(scene).unwrap();
    rollout_traced(&plant, &Intervention::default(), &mut *policy.driver()).unwrap()
}

#[test]
fn polynomials_begin_and_end_as_they_are_asked_to() {
    let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
    let from = [2.0, 3.0, -0.5];
    let quartic = Polynomial::to_speed(from, 5.0, 2.5);
    let [_, v, a] = quartic.at(2.5);
    assert!(close(quartic.at(0.0), from) && close([0.0, v, a], [0.0, 5.0, 0.0]));
    let quintic = Polynomial::to_rest(from, -1.0, 2.5);
    assert!(close(quintic.at(0.0), from) && close(quintic.at(2.5), [-1.0, 0.0, 0.0]));
    // From rest to 1 m/s in 1 s the speed is 3t² - 2t³: .5 at half time, where the acceleration is 1.5.
    let [_, v, a] = Polynomial::to_speed([0.0; 3], 1.0, 1.0).at(0.5);
    assert!((v - 0.5).abs() < 1e-12 && (a - 1.5).abs() < 1e-12);
}

#[test]
fn a_manoeuvre_leads_from_where_the_ego_is_to_the_offset_and_the_speed_asked_for() {
    let plant = Plant::new(&straight_road(LONG, 8.0, vec![])).unwrap();
    let reference = Reference::of(Centreline::of(&plant).unwrap());
    for (speed_mps, is_slow) in [(8.0, false), (3.0, true)] {
        let pose = Pose { position: Vec2::new(5.0, 0.7), heading_rad: 0.1 };
        let start = Start::of(&reference, pose, [speed_mps, 0.0, 0.0]).unwrap();
        let states = Manoeuvre::to(&start, speed_mps + 1.0, -1.0, 30, is_slow).states(&reference);
        let (first, last) = (states[0], states[STATES - 1]);
        assert!(first.pose.position.distance(pose.position) < 1e-6 && (first.pose.heading_rad - 0.1).abs() < 1e-6);
        assert!((first.speed_mps - speed_mps).abs() < 1e-6 && (last.speed_mps - speed_mps - 1.0).abs() < 1e-6);
        assert!((last.pose.position.y + 1.0).abs() < 1e-6 && last.pose.heading_rad.abs() < 1e-6, "{last:?}");
    }
}

#[test]
fn behind_a_standing_car_it_stops_and_beside_one_it_makes_room() {
    let ends = |y: f64| {
        let standing = straight(sample(60.0, y, 0.0, 0.0), LONG);
        driven(&straight_road(LONG, 10.0, vec![car("standing", standing)]), &Policy::Frenet)
    };
    let (outcome, trace) = ends(0.0);
    let gap_m = 60.0 - trace.ego.last().unwrap().position.x - 4.5;
    assert!(outcome.end == End::Horizon && (0.3..9.0).contains(&gap_m), "{gap_m} {outcome:?}");
    let (outcome, trace) = ends(1.8);
    assert!(outcome.end != End::Contact && trace.ego.last().unwrap().position.x > 70.0, "{outcome:?}");
}

#[test]
fn who_comes_from_the_side_is_given_way_whether_he_is_met_or_would_meet() {
    for (from_m, speed_mps) in [(33.0, 10.0), (48.0, 12.0), (36.0, 9.0)] {
        let from_the_side = straight(sample(40.0, -from_m, num::FRAC_PI_2, speed_mps), LONG);
        let scene = straight_road(LONG, 10.0, vec![car("crossing", from_the_side)]);
        assert_ne!(driven(&scene, &Policy::Frenet).0.end, End::Contact, "{from_m} m, {speed_mps} m/s");
    }
}

#[test]
fn a_red_light_is_stopped_at_and_a_green_one_is_passed() {
    let end_x = |state| {
        let mut scene = straight_road(LONG, 8.0, vec![]);
        scene.lights = vec![Light { lane: 0, stop_point: Vec2::new(60.0, 0.5), states: vec![state; LONG] }];
        driven(&scene, &Policy::Frenet).1.ego.last().unwrap().position.x
    };
    assert!((50.0..60.0).contains(&end_x(LightState::Stop)), "{}", end_x(LightState::Stop));
    assert!(end_x(LightState::Go) > 65.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn whatever_the_scene_lacks_it_is_driven_to_a_finite_end_and_alike_twice(
        seed in 0u64..1000, count in 0usize..14, lacks in 0usize..7
    ) {
        let mut scene = crossing(seed, count, 61);
        match lacks {
            0 => scene.road = Road::default(),
            1 => scene.road.lanes.iter_mut().for_each(|lane| lane.speed_limit_mps = None),
            // The route turns off the map.
            2 => scene.ego.route = (0..60).map(|k| Vec2::new(-45.0 + 1.5 * f64::from(k.min(20)), -1.75 - 2.0 * f64::from((k - 20).max(0)))).collect(),
            // It begins inside another car, and across its route.
            3 => scene.tracks.push(car("inside", straight(sample(-44.0, -1.5, 0.0, 3.0), 61))),
            // A limit at which nobody may drive, and one at which nobody can; a route of less than a step.
            4 => scene.road.lanes.iter_mut().for_each(|lane| lane.speed_limit_mps = Some([0.0, 1e6][seed as usize % 2])),
            5 => scene.ego.route = vec![Vec2::new(-45.0, -1.75), Vec2::new(-44.9, -1.75)],
            _ => {
                for sample in scene.ego.track.samples.iter_mut().flatten() {
                    sample.heading_rad = 2.0;
                    sample.velocity = Vec2::from_heading(2.0) * 6.0;
                }
            }
        }
        if seed % 3 == 0 {
            scene.tracks.iter_mut().for_each(|track| track.kind = AgentKind::Pedestrian);
        }
        for policy in [Policy::Frenet, Policy::Pdm] {
            let (outcome, trace) = driven(&scene, &policy);
            prop_assert!(trace.ego.iter().all(|at| at.position.is_finite() && at.speed_mps().is_finite()));
            prop_assert_eq!(&outcome, &driven(&scene, &policy).0);
        }
    }
}
