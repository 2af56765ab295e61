//! Tests of PDM where an answer is known.

use proptest::prelude::*;

use super::forecast::{Other, contact_kind};
use super::*;
use crate::ego::Policy;
use crate::kernel::{OrientedBox, num};
use crate::scene::{AgentKind, Lane, Light, LightState, Road, Scene};
use crate::sim::fault::ContactKind;
use crate::sim::scenes::{car, crossing, lane, sample, straight, straight_road};
use crate::sim::{End, Intervention, Outcome, Side, Size, Striker, Trace, rollout_traced};

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
    // A road user at most 150 degrees off is not behind, and no bumper touches it.
    let edge = |deg: f64| {
        let at = Vec2::from_heading(deg * num::PI / 180.0) * 2.2;
        kind(3.0, &other(at, 0.0, 3.0))
    };
    assert_eq!([149.0, 151.0].map(edge), [ContactKind::Side, ContactKind::Rear]);
}

/// A lane along +x about y = 0, along which the route leads, and one against it about y = 4.
fn two_ways() -> Scene {
    let mut scene = straight_road(STEPS, 8.0, vec![]);
    scene.road.lanes.push(Lane { id: "back".into(), ..lane(Vec2::new(250.0, 4.0), Vec2::new(-50.0, 4.0)) });
    scene
}

/// Returns states straight along +x at a speed, m/s, this far to the left of the route at each step, metres.
fn straight_on(speed_mps: f64, left_m: impl Fn(usize) -> f64) -> [State; STATES] {
    std::array::from_fn(|k| State {
        position: Vec2::new(STEP_S * k as f64 * speed_mps, left_m(k)),
        heading_rad: 0.0,
        speed_mps,
        acceleration_mps2: 0.0,
        steering_rad: 0.0,
        steering_rate_radps: 0.0,
    })
}

/// Returns the judgements of proposals on these two lanes among others.
fn worth(proposals: &[[State; STATES]], others: &[Other]) -> Vec<Judgement> {
    let plant = Plant::new(&two_ways()).unwrap();
    let centreline = Centreline::of(&plant).unwrap();
    let on_route = route_lanes(&plant, &centreline);
    let car = Car::of(Size::new(AgentKind::Vehicle, 4.5, 1.9));
    let settings = &PUBLISHED;
    let comfort = &Comfort::new();
    Judge { plant: &plant, on_route: &on_route, centreline: &centreline, car: &car, others, comfort, settings }
        .judged(proposals)
}

fn score(states: [State; STATES], others: &[Other]) -> f64 {
    worth(&[states], others)[0].score
}

#[test]
fn a_proposal_loses_what_the_published_score_takes_for_each_fault_and_nothing_else() {
    let alone = |left_m: &dyn Fn(usize) -> f64| score(straight_on(8.0, left_m), &[]);
    assert_eq!(alone(&|_| 0.0), 1.0);
    // With a corner beside the road.
    assert_eq!(alone(&|_| -1.5), 0.0);
    // Against traffic for 1.6 m, 4.8 m and the whole way: its middle is in the other lane from y = 2 on.
    let over = |steps: usize| move |k: usize| if (10..10 + steps).contains(&k) { 2.2 } else { 1.9 };
    assert_eq!([over(1), over(5), over(30)].map(|left_m| alone(&left_m)), [1.0, 0.5, 0.0]);
    // Half of the best one's way.
    let both = worth(&[straight_on(8.0, |_| 0.0), straight_on(4.0, |_| 0.0)], &[]);
    assert!((both[1].score - (2.5 + 5.0 + 2.0) / 12.0).abs() < 1e-9 && both[0].score == 1.0, "{both:?}");
    // Harder than 2.40 m/s².
    let hard = straight_on(8.0, |_| 0.0).map(|state| State { acceleration_mps2: 2.5, ..state });
    assert!((score(hard, &[]) - 10.0 / 12.0).abs() < 1e-9);
}

#[test]
fn others_cost_a_proposal_what_comes_of_meeting_them() {
    let meets = |others: &[Other]| worth(&[straight_on(8.0, |_| 0.0)], others)[0];
    let standing = |x_m: f64| Other {
        now: OrientedBox::new(Vec2::new(x_m, 0.0), 0.0, 4.0, 2.0),
        speed_mps: 0.0,
        ..other(Vec2::ZERO, 0.0, 0.0)
    };
    // The way ends with the bumper at 35.66 m: anyone behind that point is met within 0.9 s of going on, 7.2 m.
    let far = meets(&[standing(47.0)]);
    let near = meets(&[standing(41.0)]);
    assert_eq!((far.score, far.at_fault_s), (1.0, None));
    assert!((near.score - 7.0 / 12.0).abs() < 1e-9 && near.at_fault_s.is_none(), "{near:?}");
    // Driven into, a road user costs all, a thing half of it; both have their time.
    let met = meets(&[standing(21.0)]);
    assert_eq!(met.score, 0.0);
    assert!((met.at_fault_s.unwrap() - 2.0).abs() < 0.21, "{met:?}");
    let thing = meets(&[Other { is_agent: false, ..standing(21.0) }]);
    assert!(thing.score > 0.0 && thing.score <= 0.5, "{thing:?}");
    // The ego is not at fault for someone who comes from behind. As published it loses the time to collision: the point of contact is ahead
    // of the present place of its rear axle.
    let chased = meets(&[other(Vec2::new(-12.0, 0.0), 0.0, 14.0)]);
    assert!((chased.score - 7.0 / 12.0).abs() < 1e-9 && chased.at_fault_s.is_none(), "{chased:?}");
    // A red light is no road user that can be met.
    assert_eq!(meets(&[Other { is_agent: false, is_light: true, ..standing(21.0) }]).score, 1.0);
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
        assert!(trace.ego[30].position.x > 23.0, "whom it overlaps from the start it passes over");
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
