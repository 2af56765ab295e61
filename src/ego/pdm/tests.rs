//! PDM where an answer is known.

use proptest::prelude::*;

use super::forecast::{ContactKind, Other, contact_kind};
use super::settings::PUBLISHED;
use super::*;
use crate::ego::Policy;
use crate::kernel::{OrientedBox, num};
use crate::scene::{AgentKind, Light, LightState, Road, Scene};
use crate::sim::scenes::{car, crossing, sample, straight, straight_road};
use crate::sim::{End, Intervention, Outcome, Side, Striker, Trace, rollout_traced};

const STEPS: usize = 121;

fn driven(scene: &Scene, policy: &Policy) -> (Outcome, Trace) {
    let plant = Plant::new(scene).unwrap();
    rollout_traced(&plant, &Intervention::default(), &mut *policy.driver()).unwrap()
}

fn other(at: Vec2, heading_rad: f64, speed_mps: f64) -> Other {
    let now = OrientedBox::new(at, heading_rad, 4.0, 2.0);
    Other { now, course: now.axis, speed_mps, is_agent: true, is_light: false }
}

#[test]
fn the_kind_of_a_contact_is_the_first_of_nuplans_that_holds() {
    let own = OrientedBox::new(Vec2::new(1.4, 0.0), 0.0, 4.5, 2.0);
    let kind = |speed_mps: f64, of: &Other| contact_kind(&own, Vec2::ZERO, speed_mps, of, &of.now);
    let ahead = other(Vec2::new(5.5, 0.0), 0.0, 3.0);
    let behind = other(Vec2::new(-2.8, 0.3), 0.0, 3.0);
    let beside = other(Vec2::new(0.5, 2.0), 0.0, 3.0);
    assert_eq!(kind(0.05, &ahead), ContactKind::EgoStands);
    assert_eq!(kind(3.0, &Other { speed_mps: 0.005, ..behind }), ContactKind::OtherStands);
    assert_eq!(kind(3.0, &Other { is_agent: false, ..behind }), ContactKind::OtherStands);
    assert_eq!(kind(3.0, &behind), ContactKind::Rear);
    assert_eq!(kind(3.0, &ahead), ContactKind::Front);
    assert_eq!(kind(3.0, &beside), ContactKind::Side);
    // Who is at most 150 degrees off is not behind, and no bumper touches him.
    let edge = |deg: f64| {
        let at = Vec2::from_heading(deg * num::PI / 180.0) * 2.2;
        kind(3.0, &other(at, 0.0, 3.0))
    };
    assert_eq!([149.0, 151.0].map(edge), [ContactKind::Side, ContactKind::Rear]);
}

#[test]
fn behind_a_standing_car_it_stops_with_room() {
    let standing = straight(sample(60.0, 0.0, 0.0, 0.0), STEPS);
    let (outcome, trace) = driven(&straight_road(STEPS, 10.0, vec![car("standing", standing)]), &Policy::Pdm);
    let last = trace.ego.last().unwrap();
    let gap_m = 60.0 - last.position.x - 4.5;
    assert!(
        outcome.end == End::Horizon && last.speed_mps() < 0.5 && (0.3..6.0).contains(&gap_m),
        "{gap_m} {outcome:?}"
    );
}

/// A car that crosses the route 40 m ahead of the ego's start, from this far to the right, m, at a speed, m/s.
fn crosses(from_m: f64, speed_mps: f64) -> Scene {
    let from_the_side = straight(sample(40.0, -from_m, num::FRAC_PI_2, speed_mps), STEPS);
    straight_road(STEPS, 10.0, vec![car("crossing", from_the_side)])
}

#[test]
fn who_comes_from_the_side_is_waited_for_where_idm_drives_into_him() {
    let met = |policy| driven(&crosses(33.0, 10.0), &policy).0.end == End::Contact;
    assert_eq!([Policy::Idm, Policy::Pdm].map(met), [true, false]);
}

#[test]
fn who_would_drive_into_its_side_is_not_waited_for_as_published() {
    let contact = driven(&crosses(48.0, 12.0), &Policy::Pdm).0.contact.unwrap();
    assert_eq!((contact.striker, contact.ego_side), (Striker::Other, Side::Right));
}

#[test]
fn a_parked_car_that_reaches_into_the_lane_is_passed_a_metre_beside_the_route() {
    let parked = straight(sample(40.0, 1.7, 0.0, 0.0), STEPS);
    let scene = straight_road(STEPS, 10.0, vec![car("parked", parked)]);
    let (outcome, trace) = driven(&scene, &Policy::Pdm);
    let beside_m = trace.ego.iter().map(|at| at.position.y).fold(0.0, f64::min);
    assert!(outcome.end != End::Contact && trace.ego.last().unwrap().position.x > 60.0, "{outcome:?}");
    assert!((-1.2..-0.5).contains(&beside_m), "{beside_m}");
}

#[test]
fn a_red_light_is_stopped_at_and_a_green_one_is_passed() {
    let end_x = |state| {
        let mut scene = straight_road(STEPS, 8.0, vec![]);
        scene.lights = vec![Light { lane: 0, stop_point: Vec2::new(60.0, 0.5), states: vec![state; STEPS] }];
        driven(&scene, &Policy::Pdm).1.ego.last().unwrap().position.x
    };
    assert!((50.0..60.0).contains(&end_x(LightState::Stop)), "{}", end_x(LightState::Stop));
    assert!(end_x(LightState::Go) > 65.0);
}

#[test]
fn only_a_slow_ego_that_would_soon_be_at_fault_brakes_at_once() {
    let soon = |at_fault_s, speed_mps| is_emergency(&Judgement { score: 0.5, at_fault_s }, speed_mps, &PUBLISHED);
    assert_eq!(
        [soon(Some(2.0), 5.0), soon(Some(2.1), 5.0), soon(Some(2.0), 5.1), soon(None, 1.0)],
        [true, false, false, false]
    );
    let state = |speed_mps| State {
        position: Vec2::ZERO,
        heading_rad: 0.0,
        speed_mps,
        acceleration_mps2: 0.0,
        steering_rad: 0.0,
        steering_rate_radps: 0.0,
    };
    let reference_mps = |speed| emergency(&state(speed), &PUBLISHED)[1].position.x / STEP_S;
    // c = 1.1 (v - 4.05), below 0 at 2 m/s; a standing ego stays.
    let found = [5.0, 2.0, 0.0].map(reference_mps);
    assert!(found.iter().zip([1.045, -2.255, 0.0]).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
}

#[test]
fn of_equal_proposals_the_first_is_taken() {
    let judged = [0.2, 0.7, 0.7].map(|score| Judgement { score, at_fault_s: None });
    assert_eq!(first_best(&judged).0, 1);
}

#[test]
fn a_scene_that_lacks_lanes_or_limits_or_begins_inside_somebody_is_driven_all_the_same() {
    let inside = straight(sample(1.0, 0.2, 0.0, 5.0), STEPS);
    let mut scene = straight_road(STEPS, 8.0, vec![car("inside", inside)]);
    for lane in &mut scene.road.lanes {
        lane.speed_limit_mps = None;
    }
    let whole = driven(&scene, &Policy::Pdm).1;
    scene.road = Road::default();
    for trace in [whole, driven(&scene, &Policy::Pdm).1] {
        assert!(trace.ego.iter().all(|at| at.position.is_finite() && at.heading_rad.is_finite()));
        assert!(trace.ego.last().unwrap().position.x > 8.0, "whom it overlaps from the start it passes over");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn drawn_crossings_are_driven_to_finite_ends_and_alike_twice(
        seed in 0u64..1000, count in 0usize..14, has_lanes: bool, kind in 0usize..4
    ) {
        let mut scene = crossing(seed, count, 61);
        if !has_lanes {
            scene.road = Road::default();
        }
        let kinds = [AgentKind::Vehicle, AgentKind::Pedestrian, AgentKind::Cyclist, AgentKind::Static];
        for track in &mut scene.tracks {
            track.kind = kinds[kind];
        }
        let (outcome, trace) = driven(&scene, &Policy::Pdm);
        prop_assert!(trace.ego.iter().all(|at| at.position.is_finite() && at.speed_mps().is_finite()));
        prop_assert_eq!(&outcome, &driven(&scene, &Policy::Pdm).0);
    }
}
