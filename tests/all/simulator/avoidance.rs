//! Avoidability of contacts: scenes made by hand, a braking distance worked out, and what the ego sees.

use std::sync::Arc;

use super::contacts::*;
use crate::kernel::{Polyline, Vec2};
use crate::scene::{AgentKind, Lane, PreparedScene, Sample, Scene};
use crate::sim::scenes::*;
use crate::sim::*;

const BLIND: Blind = Blind { steering_rad: 0.0 };

fn met(samples: Vec<Sample>) -> Contact {
    let (scene, act) = against(samples);
    contact_of(&scene, &act, &mut { BLIND })
}

fn met_with(scene: &Scene, act: &Intervention, options: &SimulatorOptions) -> Contact {
    let plant = Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), options).unwrap();
    rollout_assessed(&plant, act, &mut { BLIND }).unwrap().contact.expect("a contact")
}

/// The same road with room for three lanes.
fn widened(scene: &Scene) -> Scene {
    let mut wide = scene.clone();
    for lane in &mut wide.road.lanes {
        lane.left.iter_mut().for_each(|p| p.y += 4.0);
        lane.right.iter_mut().for_each(|p| p.y -= 4.0);
    }
    wide
}

#[test]
fn a_cut_in_with_room_to_brake_is_avoidable_and_one_without_is_not() {
    // 8 m/s faster: cancelling that takes 2.4 m while the brakes build up and 64 / 15.2 = 4.2 m after. It is seen when it
    // begins to come over, at 2.9 s and 1.5 s; 1.2 s later 7.7 m and 3.9 m are left.
    let with_room = met(motion(91, |t| Vec2::new(45.0 + 4.0 * t, lateral(t, 3.5, 0.0, 2.9..4.4))));
    assert_eq!((with_room.class, with_room.avoidable), (ContactClass::CutIn, Some(true)), "{with_room:?}");
    let without = met(motion(91, |t| Vec2::new(30.0 + 4.0 * t, lateral(t, 3.5, 0.0, 1.5..3.0))));
    assert_eq!((without.class, without.avoidable), (ContactClass::CutIn, Some(false)), "{without:?}");
    assert!(without.visible_s.is_some_and(|s| s > 1.0), "it was seen, but too late: {without:?}");
}

#[test]
fn a_ram_from_behind_is_out_of_view_and_cannot_be_avoided() {
    let (scene, act) = against(motion(91, |t| Vec2::new(-30.0 + 20.0 * t, 0.0)));
    let ram = contact_of(&scene, &act, &mut { BLIND });
    assert_eq!((ram.visible_s, ram.avoidable), (None, Some(false)));
    // An ego that looks all around could swerve, if there is room for it.
    let mut options = SimulatorOptions::SHIPPED;
    options.avoidance.field_of_view_deg = 360.0;
    let seen = met_with(&scene, &act, &options);
    assert!(seen.visible_s.is_some_and(|s| s > 2.0) && seen.avoidable == Some(false), "{seen:?}");
    assert_eq!(met_with(&widened(&scene), &act, &options).avoidable, Some(true));
}

#[test]
fn what_stands_in_the_lane_is_avoidable_by_braking() {
    let hit = met(motion(91, |_| Vec2::new(60.0, 0.0)));
    assert_eq!((hit.class, hit.avoidable), (ContactClass::StationaryHit, Some(true)));
}

#[test]
fn a_car_that_crosses_in_sight_is_avoidable_and_one_behind_a_parked_van_is_not() {
    let samples = motion(91, |t| Vec2::new(37.0, -30.0 + 10.0 * t));
    let (mut scene, act) = against(samples);
    let open = contact_of(&scene, &act, &mut { BLIND });
    assert_eq!((open.class, open.avoidable), (ContactClass::Crossing, Some(true)), "{open:?}");
    // Vans on the right of the road up to the corner hide it until it is there.
    let van = |x: f64| {
        let mut van = car("van", straight(sample(x, -3.2, 0.0, 0.0), 91));
        (van.length_m, van.width_m) = (9.0, 2.2);
        van
    };
    scene.tracks.extend([10.0, 19.2, 28.4].map(van));
    let hidden = contact_of(&scene, &act, &mut { BLIND });
    assert_eq!((hidden.class, hidden.avoidable), (ContactClass::Crossing, Some(false)), "{hidden:?}");
    assert!(hidden.visible_s < open.visible_s, "{hidden:?} {open:?}");
}

#[test]
fn a_head_on_is_avoidable_where_there_is_room_to_swerve_only() {
    let (scene, act) = against(motion(91, |t| Vec2::new(80.0 - 10.0 * t, 0.3)));
    let narrow = contact_of(&scene, &act, &mut { BLIND });
    assert_eq!((narrow.class, narrow.avoidable), (ContactClass::HeadOn, Some(false)), "braking does not help");
    assert_eq!(contact_of(&widened(&scene), &act, &mut { BLIND }).avoidable, Some(true));
}

#[test]
fn what_stands_ahead_is_visible_from_the_step_on_in_which_the_predicted_boxes_meet() {
    // Bumper to bumper 60 - 4.5 = 55.5 m, 12 m/s: the contact is at 4.625 s, which the physics step of 4.64 s finds. Within
    // 3 s the ego covers 36 m, so the boxes are predicted to meet once it is 19.5 m on: from 1.7 s on.
    let hit = met(motion(91, |_| Vec2::new(60.0, 0.0)));
    assert!((hit.time_s - 4.64).abs() < 1e-9, "{hit:?}");
    assert!((hit.visible_s.unwrap() - 2.94).abs() < 1e-9, "{hit:?}");
}

#[test]
fn a_leader_as_fast_as_the_ego_is_a_threat_within_the_safe_distance_of_its_reaction_time() {
    // v = u = 12 m/s: the envelope is 12 * 1.15 = 13.8 m long. The leader stands still from 2 s on.
    let leader = |gap_m: f64| met(motion(91, |t| Vec2::new(4.5 + gap_m + 12.0 * t.min(2.0), 0.0)));
    let (near, far) = (leader(13.7), leader(13.9));
    assert_eq!(near.visible_s, Some(near.time_s), "visible from the first step on: {near:?}");
    assert!(far.visible_s.is_some_and(|s| s < far.time_s - 1.85), "visible once it brakes: {far:?}");
}

/// Way from the moment at which something is seen to standstill, metres: the steps of the reaction at full speed, then a
/// deceleration that builds up in steps of 0.1 s.
fn stopping_m(speed_mps: f64, options: &AvoidanceOptions) -> f64 {
    let mut way = speed_mps * 0.1 * (options.reaction_s * 10.0).ceil();
    let (mut speed, mut elapsed) = (speed_mps, 0.0);
    while speed > 0.0 {
        elapsed += 0.1;
        let brake = options.brake_mps2 * (elapsed / options.brake_rise_s).min(1.0);
        let after = (speed - 0.1 * brake).max(0.0);
        way += if after > 0.0 { 0.05 * (speed + after) } else { 0.5 * speed * speed / brake };
        speed = after;
    }
    way
}

#[test]
fn something_that_appears_ahead_is_avoidable_from_the_stopping_distance_on() {
    let scene = straight_road(91, 12.0, vec![]);
    let appears = |gap_m: f64| {
        // The ego's front is at 12 * 1 + 2.25 when it appears, its own rear bumper 2.25 m before its centre.
        let samples = vec![sample(12.0 + 4.5 + gap_m, 0.0, 0.0, 0.0); 80];
        let kind = AgentKind::Vehicle;
        let action = Action::Insert { kind, length_m: 4.5, width_m: 1.9, from_step: 10, samples };
        contact_of(&scene, &Intervention { actions: vec![action] }, &mut { BLIND }).avoidable
    };
    let gaps = (0..400).map(|i| 10.0 + 0.05 * f64::from(i));
    let least = gaps.clone().find(|&gap_m| appears(gap_m) == Some(true)).unwrap();
    assert!(gaps.filter(|gap_m| *gap_m > least).take(40).all(|gap_m| appears(gap_m) == Some(true)));
    let expected = stopping_m(12.0, &AvoidanceOptions::SHIPPED);
    assert!((least - expected).abs() < 0.06, "{least} {expected}");
}

#[test]
fn an_assessed_rollout_differs_from_a_plain_one_in_what_was_asked_for_alone() {
    let mut assessed = 0;
    for seed in 0..60 {
        let scene = crossing(seed, 12, 91);
        let (plant, act) = (Plant::new(&scene).unwrap(), intercept(&scene, 10));
        let driver = &mut *crate::ego::Policy::Idm.driver();
        let plain = rollout(&plant, &act, driver).unwrap();
        let mut full = rollout_assessed(&plant, &act, driver).unwrap();
        let contact = full.contact.as_mut().filter(|c| c.adversary);
        if let Some(contact) = contact {
            assert!(contact.avoidable.is_some());
            assessed += 1;
            (contact.avoidable, contact.visible_s) = (None, None);
        }
        assert_eq!(plain, full, "seed {seed}");
    }
    assert!(assessed > 3, "{assessed}");
}

#[test]
fn a_recorded_car_that_cannot_brake_behind_the_ego_does_not_make_a_contact_unavoidable() {
    // Only vehicles turn reactive, so a cyclist keeps to its recording.
    let mut follower = car("follower", straight(sample(-12.0, 0.0, 0.0, 12.0), 91));
    follower.kind = AgentKind::Cyclist;
    let (mut scene, act) = against(motion(91, |_| Vec2::new(60.0, 0.0)));
    scene.tracks.push(follower);
    assert_eq!(contact_of(&scene, &act, &mut { BLIND }).avoidable, Some(true));
}

/// A scene with a lane that comes towards the ego and turns left across its way, and the car that drives it at 5 m/s.
fn turning_across(leads_across: bool) -> (Scene, Intervention) {
    let across = [(70.0, 4.0), (66.0, 3.0), (63.0, 0.0), (62.0, -4.0), (62.0, -30.0)].map(|(x, y)| Vec2::new(x, y));
    let way = Polyline::new([&[Vec2::new(86.0, 4.0)], &across[..]].concat()).unwrap();
    let samples = motion(91, |t| way.at(5.0 * t));
    let (mut scene, act) = against(samples);
    let beside = |points: &[Vec2], aside_m: f64| {
        let line = Polyline::new(points.to_vec()).unwrap();
        points
            .iter()
            .map(|point| *point + Vec2::from_heading(line.project(*point).heading_rad).left() * aside_m)
            .collect()
    };
    let mut oncoming = Lane { id: "oncoming".into(), ..lane(Vec2::new(250.0, 4.0), Vec2::new(70.0, 4.0)) };
    let turn = Lane {
        id: "turn".into(),
        centre: across.to_vec(),
        left: beside(&across, 1.75),
        right: beside(&across, -1.75),
        ..oncoming.clone()
    };
    oncoming.exits = if leads_across { vec![2] } else { vec![] };
    scene.road.lanes.extend([oncoming, turn]);
    (scene, act)
}

#[test]
fn who_turns_slowly_across_is_foreseen_along_its_lane_before_its_motion_points_at_the_ego() {
    let seen_s = |forecast: Forecast, leads_across: bool| {
        let mut options = SimulatorOptions::SHIPPED;
        options.avoidance.forecast = forecast;
        let (scene, act) = turning_across(leads_across);
        met_with(&scene, &act, &options).visible_s.unwrap()
    };
    let (motion, lanes) = (seen_s(Forecast::Motion, true), seen_s(Forecast::Lanes, true));
    assert!(lanes > motion + 0.5, "{motion} {lanes}");
    // Within the horizon alone, and the contact lies up to half a second before the centres meet.
    assert!(lanes < SimulatorOptions::SHIPPED.avoidance.horizon_s + 0.1, "{lanes}");
    // Where the lanes lead nowhere it is on the turn before it is foreseen.
    assert!(seen_s(Forecast::Lanes, false) < lanes);
}

#[test]
fn a_swerve_within_the_lane_avoids_what_a_lane_wide_one_leaves_the_road_for() {
    let avoidable = |gap_m: f64, lesser_swerves: bool| {
        let mut options = SimulatorOptions::SHIPPED;
        options.avoidance.lesser_swerves = lesser_swerves;
        let samples = vec![sample(12.0 + 4.5 + gap_m, -1.6, 0.0, 0.0); 80];
        let kind = AgentKind::Vehicle;
        let action = Action::Insert { kind, length_m: 4.5, width_m: 1.9, from_step: 10, samples };
        met_with(&straight_road(91, 12.0, vec![]), &Intervention { actions: vec![action] }, &options).avoidable
    };
    let gaps = || (0..60).map(|i| 14.0 + 0.25 * f64::from(i));
    let helped: Vec<f64> = gaps().filter(|gap_m| avoidable(*gap_m, true) != avoidable(*gap_m, false)).collect();
    assert!(helped.len() > 4, "{helped:?}");
    assert!(
        helped.iter().all(|gap_m| avoidable(*gap_m, true) == Some(true)),
        "more ways to evade never make a contact unavoidable"
    );
}
