//! Tests that compare the account of a reported motion with the account of the rollout that was reported.

use std::sync::Arc;

use super::reported_check::OFF_COMMAND_M;
use crate::ego::Policy;
use crate::kernel::{Seed, Vec2};
use crate::scene::{AgentKind, PreparedScene, Sample, Scene};
use crate::sim::scenes::{car, crossing, intercept, sample, straight, straight_road};
use crate::sim::*;

/// Makes an interception by a recorded vehicle, sometimes with someone inserted on a straight way.
fn drawn(scene: &Scene, seed: u64) -> Intervention {
    let mut stream = Seed(seed).stream(&["told"]);
    let mut act = if stream.chance(0.2) { Intervention::default() } else { intercept(scene, stream.below(30)) };
    if stream.chance(0.4) {
        let start = sample(stream.uniform(-20.0, 20.0), stream.uniform(-8.0, 8.0), stream.uniform(-3.0, 3.0), 6.0);
        let along = |k: usize| Sample { position: start.position + start.velocity * (0.1 * k as f64), ..start };
        let samples = (0..1 + stream.below(50)).map(along).collect();
        let (kind, length_m, from_step) = (AgentKind::Cyclist, stream.uniform(0.5, 5.0), stream.below(40));
        act.actions.push(Action::Insert { kind, length_m, width_m: 0.8, from_step, samples });
    }
    act
}

fn plant(scene: &Scene, seed: u64) -> Plant {
    let law = if seed.is_multiple_of(2) { PlantOptions::PHYSICAL } else { PlantOptions::METADRIVE_0_4_3 };
    let options = SimulatorOptions { plant: law, ..SimulatorOptions::SHIPPED };
    Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), &options).unwrap()
}

fn policy(seed: u64) -> Policy {
    if seed.is_multiple_of(4) { Policy::Replay } else { Policy::Idm }
}

fn scene(seed: u64) -> Scene {
    let mut scene = crossing(seed, 3 + (seed % 40) as usize, 91);
    scene.ego.start_step = (seed % 3) as usize * 5;
    match seed % 7 {
        2 => scene.ego.route.truncate(20),
        5 => scene.ego.route.iter_mut().enumerate().for_each(|(i, p)| p.y += 0.3 * i as f64),
        _ => {}
    }
    scene
}

#[test]
fn our_own_motion_told_back_gives_our_own_outcome_bit_for_bit() {
    let (mut contacts, mut ends) = (0, std::collections::BTreeSet::new());
    let (mut avoidable, mut followers) = ([0, 0], 0);
    for seed in 0..250 {
        let scene = scene(seed);
        let (plant, act, policy) = (plant(&scene, seed), drawn(&scene, seed), policy(seed));
        let (mut own, motion) = rollout_traced(&plant, &act, policy.driver().as_mut()).unwrap();
        assess(&plant, &act, policy.driver().as_mut(), &mut own).unwrap();
        let reported = tell(&plant, &act, policy.driver().as_mut()).unwrap();
        let (judged, shown) = judge(&plant, &act, &reported, policy.driver().follows_log())
            .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        assert_eq!(judged, own, "seed {seed}");
        assert_eq!(shown, motion, "seed {seed}");
        contacts += usize::from(own.contact.is_some());
        ends.insert(format!("{:?}", own.end));
        if let Some(could) = own.contact.and_then(|contact| contact.avoidable) {
            avoidable[usize::from(could)] += 1;
        }
        followers += reported.actors.len() - act.actions.len();
    }
    assert!(contacts > 50 && followers > 20, "{contacts} contacts, {followers} followers");
    assert!(avoidable.iter().all(|count| *count > 3), "{avoidable:?}");
    assert_eq!(ends.len(), 4, "{ends:?}");
}

/// A driver that sees nothing and keeps its speed.
struct Blind;

impl Driver for Blind {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, _: &View<'_>) -> Control {
        Control::Drive { acceleration_mps2: 0.0, steering_rad: 0.0 }
    }
}

/// Something stands in the ego's lane, and a car follows the ego. Braking is a way out only if that car brakes too.
#[test]
fn traffic_that_our_plant_takes_over_reacts_to_the_evading_ego() {
    let follower = car("follower", straight(sample(-30.0, 0.0, 0.0, 12.0), 91));
    let standing = car("standing", straight(sample(60.0, 0.0, 0.0, 0.0), 91));
    let scene = straight_road(91, 12.0, vec![standing, follower]);
    let samples = vec![sample(60.0, 0.0, 0.0, 0.0); 90];
    let act = Intervention { actions: vec![Action::Follow { track: 0, from_step: 1, samples }] };
    let plant = Plant::new(&scene).unwrap();
    let own = rollout_assessed(&plant, &act, &mut Blind).unwrap();
    assert_eq!(own.contact.and_then(|contact| contact.avoidable), Some(true), "{own:?}");
    let reported = tell(&plant, &act, &mut Blind).unwrap();
    assert!(reported.actors.iter().any(|actor| actor.who == ActorRef::Track(1)), "the follower reacts");
    assert_eq!(judge(&plant, &act, &reported, false).unwrap().0, own);
}

#[test]
fn another_motion_gives_another_outcome() {
    let scene = scene(1);
    let (plant, act) = (plant(&scene, 1), drawn(&scene, 1));
    let reported = tell(&plant, &act, Policy::Idm.driver().as_mut()).unwrap();
    let (own, _) = judge(&plant, &act, &reported, false).unwrap();
    let mut slower = reported.clone();
    slower.ego.iter_mut().skip(1).for_each(|pose| pose.sample.velocity = pose.sample.velocity * 0.9);
    let (other, _) = judge(&plant, &act, &slower, false).unwrap();
    assert!(other.ego.speed_mps_mean < own.ego.speed_mps_mean);
    assert_ne!(other.trace, own.trace);
    let mut aside = reported.clone();
    aside.ego.iter_mut().enumerate().for_each(|(row, pose)| pose.sample.position.y += 0.05 * row as f64);
    let (other, _) = judge(&plant, &act, &aside, false).unwrap();
    assert!((other.ego_lateral_m_max - own.ego_lateral_m_max).abs() > 0.5);
}

#[test]
fn a_contact_is_judged_with_the_boxes_that_were_simulated() {
    let (mut sides, mut contacts) = (0, 0);
    for seed in 0..60 {
        let scene = scene(seed);
        let (plant, act, policy) = (plant(&scene, seed), drawn(&scene, seed), policy(seed));
        let mut reported = tell(&plant, &act, policy.driver().as_mut()).unwrap();
        let Some(contact) = &mut reported.contact else { continue };
        let judged = |reported: &ReportedRollout| {
            let (outcome, _) = judge(&plant, &act, reported, policy.driver().follows_log()).unwrap();
            outcome.contact.unwrap()
        };
        let size = |who: ActorRef| match who {
            ActorRef::Track(track) => plant.sizes[track],
            ActorRef::Inserted(_) => plant.ego_size,
        };
        let (ego, other) = (plant.ego_size, size(contact.with));
        let whole = |size: Size| [2.0 * size.half_length_m, 2.0 * size.half_width_m];
        if matches!(contact.with, ActorRef::Inserted(_)) {
            continue;
        }
        contact.boxes = Some(ContactBoxes { ego: whole(ego), other: whole(other) });
        let same = judged(&reported);
        reported.contact.as_mut().unwrap().boxes = None;
        assert_eq!(same, judged(&reported), "seed {seed}: boxes of the plant, told");
        // A thin and a long box of the other: the sides that face each other are others.
        let boxes = ContactBoxes { ego: whole(ego), other: [0.2, 6.0] };
        reported.contact.as_mut().unwrap().boxes = Some(boxes);
        let thin = judged(&reported);
        assert_eq!((thin.time_s, thin.relative_speed_mps), (same.time_s, same.relative_speed_mps));
        sides += usize::from((thin.ego_side, thin.other_side) != (same.ego_side, same.other_side));
        contacts += 1;
    }
    assert!(contacts > 10 && sides > 2, "{sides} of {contacts}");
}

/// Returns the answer of `judge` after a change to a motion.
fn refused(spoil: impl FnOnce(&mut ReportedRollout)) -> String {
    let scene = scene(3);
    let (plant, act) = (plant(&scene, 3), intercept(&scene, 5));
    let mut reported = tell(&plant, &act, Policy::Idm.driver().as_mut()).unwrap();
    judge(&plant, &act, &reported, false).unwrap();
    spoil(&mut reported);
    match judge(&plant, &act, &reported, false) {
        Ok(_) => "judged".into(),
        Err(error) => error.to_string(),
    }
}

const NO_BOX: ContactBoxes = ContactBoxes { ego: [4.0, 2.0], other: [-1.0, 2.0] };

#[test]
fn a_motion_that_is_none_of_the_scene_is_refused_with_its_place() {
    let reported = [
        refused(|reported| reported.ego[2].sample.position.x = f64::NAN),
        refused(|reported| reported.ego[2].axis = Vec2::new(2.0, 0.0)),
        refused(|reported| reported.ego[0].sample.position.x += 2.0 * OFF_COMMAND_M),
        refused(|reported| reported.ego.truncate(reported.ego.len() - 1)),
        refused(|reported| reported.end = if reported.contact.is_some() { End::Arrived } else { End::Contact }),
        refused(|reported| reported.actors.truncate(0)),
        refused(|reported| reported.actors[0].poses[1].as_mut().unwrap().sample.position.y += 2.0 * OFF_COMMAND_M),
        refused(|reported| reported.actors.push(reported.actors[0].clone())),
        refused(|reported| reported.actors[0].who = ActorRef::Track(999)),
        refused(|reported| reported.actors[0].who = ActorRef::Inserted(0)),
        refused(|reported| {
            let contact = ReportedContact { with: ActorRef::Track(0), step: 0, substep: 0, boxes: Some(NO_BOX) };
            (reported.end, reported.contact) = (End::Contact, Some(contact));
            reported.ego.truncate(1);
            reported.actors.retain(|actor| actor.from_step < 1);
            reported.actors.iter_mut().for_each(|actor| actor.poses.truncate(1));
        }),
        refused(|reported| {
            (reported.end, reported.contact) =
                (End::Contact, Some(ReportedContact { with: ActorRef::Track(998), step: 3, substep: 5, boxes: None }));
            reported.ego.truncate(5);
            reported.actors.retain(|actor| actor.from_step < 5);
            reported.actors.iter_mut().for_each(|actor| actor.poses.truncate(5 - actor.from_step));
        }),
    ];
    let expected = [
        "ego, row 2: expected finite",
        "ego, row 2: expected a unit vector",
        "ego, row 0: expected the scene's start",
        "expected",
        "contact: expected",
        "expected every adversary's motion",
        "row 1: expected where it was commanded to be",
        "expected each road user once",
        "road_users[0]: expected a track below",
        "expected",
        "contact.boxes.other: expected length and width above 0 and at most 100 m, found -1 x 2",
        "contact: expected somebody who is there",
    ];
    for (said, expected) in reported.iter().zip(expected) {
        assert!(said.contains(expected), "{said:?} instead of {expected:?}");
    }
}

#[test]
fn who_could_have_avoided_a_contact_was_not_too_late_and_who_could_not_was() {
    let mut counted = [0, 0];
    for seed in 0..250 {
        let scene = scene(seed);
        let (plant, act, policy) = (plant(&scene, seed), drawn(&scene, seed), policy(seed));
        let (mut own, _) = rollout_traced(&plant, &act, policy.driver().as_mut()).unwrap();
        assess(&plant, &act, policy.driver().as_mut(), &mut own).unwrap();
        let late_s = lateness_s(&plant, &act, policy.driver().as_mut(), &own).unwrap();
        let Some(avoidable) = own.contact.filter(|contact| contact.adversary).and_then(|contact| contact.avoidable)
        else {
            assert_eq!(late_s, None, "seed {seed}");
            continue;
        };
        // Where the last four seconds hold no way out, there is no lateness.
        let Some(late_s) = late_s else { continue };
        assert_eq!(late_s < 0.05, avoidable, "seed {seed}: {late_s} s late, {:?}", own.contact);
        counted[usize::from(avoidable)] += 1;
    }
    assert!(counted.iter().all(|count| *count > 3), "{counted:?}");
}

/// Returns plants whose car's poses hold all of its state: tyres, and MetaDrive's limits and skids without its springs.
fn tracked(scene: &Scene, seed: u64) -> Plant {
    let skids = PlantOptions { ego_car: EgoCar::SingleTrack, ..PlantOptions::METADRIVE_0_4_3 };
    let law = if seed.is_multiple_of(2) { PlantOptions::PHYSICAL } else { skids };
    let options = SimulatorOptions { plant: law, ..SimulatorOptions::SHIPPED };
    Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), &options).unwrap()
}

/// Drives at its limits: full throttle and brakes, and wheels jerked from side to side.
struct Wild(u64);

impl Driver for Wild {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        let mut stream = Seed(self.0).stream(&["wild", &view.decision().to_string()]);
        let held = Seed(self.0).stream(&["held", &(view.decision() / 7).to_string()]).uniform(-1.0, 1.0);
        let acceleration_mps2 = if held > 0.0 { stream.uniform(-2.0, 12.0) } else { stream.uniform(-20.0, 0.5) };
        Control::Drive { acceleration_mps2, steering_rad: held * stream.uniform(-0.2, 1.2) }
    }
}

#[test]
fn a_drive_of_our_own_is_traced_again_without_its_controls() {
    let (mut ends, mut stood, mut fast) = (std::collections::BTreeSet::new(), 0, 0);
    for seed in 0..400 {
        let scene = scene(seed);
        let (plant, act) = (tracked(&scene, seed), drawn(&scene, seed));
        let mut idm = Policy::Idm.driver();
        let mut wild = Wild(seed);
        let driver: &mut dyn Driver = if seed % 4 < 2 { &mut wild } else { idm.as_mut() };
        let reported = tell(&plant, &act, driver).unwrap();
        retraced(&plant, &act, &reported).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        judge(&plant, &act, &reported, false).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        ends.insert(format!("{:?}", reported.end));
        stood += usize::from(reported.ego.iter().any(|pose| pose.sample.speed_mps() == 0.0));
        fast += usize::from(reported.ego.iter().any(|pose| pose.sample.speed_mps() > 22.2));
    }
    assert!(ends.len() == 4 && stood > 20, "{ends:?}, {stood} stood, {fast} at top speed");
}

#[test]
fn a_drive_that_no_car_has_or_that_ends_otherwise_is_not_traced() {
    let (scene, mut forged) = (scene(4), 0);
    let (plant, act) = (tracked(&scene, 4), drawn(&scene, 4));
    let own = tell(&plant, &act, Policy::Idm.driver().as_mut()).unwrap();
    let mut refused = |what: &str, expected: &str, spoil: &dyn Fn(&mut ReportedRollout)| {
        let mut changed = own.clone();
        spoil(&mut changed);
        let said = retraced(&plant, &act, &changed).map_or_else(|error| error.to_string(), |()| "traced".into());
        assert!(said.contains(expected), "{what}: {said}");
        forged += 1;
    };
    let last = plant.route().points()[plant.route().points().len() - 1];
    refused("a jump to the route's end", "ego, row 1", &|of| {
        (of.end, of.contact) = (End::Arrived, None);
        of.ego.truncate(2);
        of.ego[1].sample.position = last;
        of.actors.retain(|actor| actor.from_step < 2);
        of.actors.iter_mut().for_each(|actor| actor.poses.truncate(2 - actor.from_step));
    });
    refused("a millimetre more a step", "ego, row 1", &|of| {
        of.ego.iter_mut().enumerate().for_each(|(row, pose)| pose.sample.position.x += 0.001 * row as f64);
    });
    refused("faster than it goes", "ego, row 3", &|of| of.ego[3].sample.velocity = of.ego[3].sample.velocity * 1.01);
    refused("another end", "its end", &|of| of.end = if of.end == End::Arrived { End::OffRoad } else { End::Arrived });
    refused("controls of another drive", "ego, row", &|of| of.controls = vec![[1.0, 0.1]; 90]);
    refused("an adversary that gives way", "road_users[0]", &|of| {
        of.actors[0].poses.iter_mut().flatten().for_each(|pose| pose.sample.position.y += 0.01);
    });
    refused("nobody reacts", "road_users", &|of| of.actors.clear());
    assert_eq!(forged, 7);
}

/// The answer of `judge` for a car of another simulator: the limits of the plant, with an allowance.
#[test]
fn a_car_of_another_simulator_is_held_to_the_limits_that_planners_are_told() {
    let drives = |what: &str, expected: &str, spoil: &dyn Fn(&mut ReportedRollout)| {
        let said = refused(|reported| spoil(reported));
        assert!(said.contains(expected), "{what}: {said}");
    };
    let from_5 = |of: &mut ReportedRollout, change: &dyn Fn(&mut Pose)| of.ego[5..].iter_mut().for_each(change);
    drives("nothing", "judged", &|_| ());
    drives("a jump", "ego, row 5: expected a car within its limits", &|of| {
        from_5(of, &|pose| pose.sample.position.x += 500.0);
    });
    drives("a jump of 3 m", "ego, row 5", &|of| from_5(of, &|pose| pose.sample.position.x += 3.0));
    drives("a jump that its velocity explains", "m/s", &|of| {
        of.ego[5].sample.velocity = of.ego[5].sample.velocity * 10.0;
        from_5(of, &|pose| pose.sample.position.x += 10.0);
    });
    drives("a start at speed", "m/s and", &|of| of.ego[0].sample.velocity = of.ego[0].sample.velocity * 3.0);
    drives("a turn on the spot", "rad of turn", &|of| {
        from_5(of, &|pose| {
            let turned = pose.sample.heading_rad + 1.0;
            *pose = Pose::of(Sample { heading_rad: crate::kernel::num::wrap_angle(turned), ..pose.sample });
        });
    });
    drives("a step aside", "ego, row 5", &|of| {
        from_5(of, &|pose| {
            let aside = Vec2::new(-pose.axis.y, pose.axis.x) * 2.0;
            pose.sample.position = pose.sample.position + aside;
        });
    });
}

#[test]
fn an_ego_that_repeats_its_recording_is_where_that_was() {
    let scene = scene(0);
    let (plant, act) = (plant(&scene, 0), drawn(&scene, 0));
    let mut reported = tell(&plant, &act, Policy::Replay.driver().as_mut()).unwrap();
    judge(&plant, &act, &reported, true).unwrap();
    reported.ego[2].sample.position.y += 3.0;
    let error = judge(&plant, &act, &reported, true).unwrap_err().to_string();
    assert!(error.contains("ego, row 2: expected where the ego was recorded"), "{error}");
}

#[test]
fn traffic_that_nobody_commands_does_not_jump() {
    let mut spoiled = 0;
    for seed in 0..120 {
        let scene = scene(seed);
        let (plant, act, policy) = (plant(&scene, seed), drawn(&scene, seed), policy(seed));
        let mut reported = tell(&plant, &act, policy.driver().as_mut()).unwrap();
        let Some(follower) = reported.actors.get_mut(act.actions.len()).filter(|of| of.poses.len() > 4) else {
            continue;
        };
        follower.poses[3..].iter_mut().flatten().for_each(|pose| pose.sample.position.x += 30.0);
        let error = judge(&plant, &act, &reported, policy.driver().follows_log()).unwrap_err().to_string();
        assert!(error.contains("m of way since row"), "seed {seed}: {error}");
        spoiled += 1;
    }
    assert!(spoiled > 5, "{spoiled}");
}

#[test]
fn a_told_rollout_has_the_time_line_of_the_rollout_that_it_tells() {
    let mut counted = 0;
    for seed in 0..60 {
        let scene = scene(seed);
        let (plant, act, policy) = (plant(&scene, seed), drawn(&scene, seed), policy(seed));
        let (outcome, _, own) = rollout_explained(&plant, &act, policy.driver().as_mut()).unwrap();
        let Some((contact, own)) = outcome.contact.zip(own) else { continue };
        let reported = tell(&plant, &act, policy.driver().as_mut()).unwrap();
        let replays = policy.driver().follows_log();
        let mut told = reported_timeline(&plant, &act, &reported, replays, &contact).unwrap();
        // The speeds of reported poses are rounded.
        assert!((told.braked_mps2_max - own.braked_mps2_max).abs() < 1e-6, "seed {seed}");
        told.braked_mps2_max = own.braked_mps2_max;
        assert_eq!(told, own, "seed {seed}");
        counted += 1;
    }
    assert!(counted > 5, "{counted}");
}
