//! The time line of a contact: when it was seen, when the ego reacted, and until when which manoeuvre would have helped.

use super::contacts::*;
use crate::kernel::Vec2;
use crate::sim::scenes::*;
use crate::sim::*;

/// Drives straight on, and from a decision on with these controls.
struct From(usize, Control);

impl Driver for From {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        if view.decision() >= self.0 { self.1 } else { Control::Drive { acceleration_mps2: 0.0, steering_rad: 0.0 } }
    }
}

fn controls(acceleration_mps2: f64, steering_rad: f64) -> Control {
    Control::Drive { acceleration_mps2, steering_rad }
}

fn told(samples: Vec<crate::scene::Sample>, driver: &mut dyn Driver) -> (Contact, Timeline) {
    let (scene, act) = against(samples);
    let (outcome, _, timeline) = rollout_explained(&Plant::new(&scene).unwrap(), &act, driver).unwrap();
    (outcome.contact.expect("a contact"), timeline.expect("its time line"))
}

fn stands() -> Vec<crate::scene::Sample> {
    motion(91, |_| Vec2::new(60.0, 0.0))
}

fn last_s(timeline: &Timeline, by: Manoeuvre) -> Option<f64> {
    timeline.chances.iter().find(|chance| chance.by == by).unwrap().last_s
}

#[test]
fn braking_helps_up_to_the_decision_from_which_the_way_to_standstill_is_still_there() {
    let (contact, timeline) = told(stands(), &mut From(91, controls(0.0, 0.0)));
    assert_eq!((timeline.contact_s, timeline.reaction), (contact.time_s, None));
    assert!((timeline.visible_s.unwrap() - 1.7).abs() < 1e-9, "{timeline:?}");
    assert_eq!(timeline.from, Side::Front);
    // 55.5 m between the bumpers, 12 m/s, and brakes that build up to 7.59 m/s² within 0.6 s in steps of 0.1 s.
    let (mut speed, mut way, mut elapsed) = (12.0_f64, 0.0, 0.0_f64);
    while speed > 0.0 {
        elapsed += 0.1;
        let brake = 7.59 * (elapsed / 0.6).min(1.0);
        let after = (speed - 0.1 * brake).max(0.0);
        way += if after > 0.0 { 0.05 * (speed + after) } else { 0.5 * speed * speed / brake };
        speed = after;
    }
    let last = ((55.5 - way) / 1.2).floor() * 0.1;
    assert!((last_s(&timeline, Manoeuvre::Brake).unwrap() - last).abs() < 1e-9, "{last} {timeline:?}");
    assert_eq!(timeline.last_chance().unwrap().by, Manoeuvre::Brake, "the road is too narrow for a swerve");
}

#[test]
fn a_reaction_begins_with_the_decision_that_brakes_or_leads_aside() {
    let (contact, timeline) = told(stands(), &mut From(42, controls(-3.0, 0.0)));
    assert!(contact.time_s > 4.65, "it brakes, too late: {contact:?}");
    let reaction = timeline.reaction.unwrap();
    assert!((reaction.at_s - 4.2).abs() < 1e-9 && reaction.by == Reacted::Braked, "{timeline:?}");
    assert!((timeline.braked_mps2_max - 3.0).abs() < 0.01, "{timeline:?}");
    assert!(reaction.at_s > timeline.last_chance().unwrap().last_s.unwrap(), "{timeline:?}");
    // Who brakes before anything is to be seen reacts when it is: it brakes already.
    let (_, early) = told(stands(), &mut From(12, controls(-1.6, 0.0)));
    assert_eq!(early.reaction.unwrap().at_s, early.visible_s.unwrap(), "{early:?}");
    // Who brakes gently rolls.
    assert_eq!(told(stands(), &mut From(30, controls(-1.0, 0.0))).1.reaction, None);
    let (_, aside) = told(stands(), &mut From(35, controls(0.0, 0.012)));
    let reaction = aside.reaction.unwrap();
    assert_eq!(reaction.by, Reacted::SteeredLeft, "{aside:?}");
    assert!((3.5..=4.1).contains(&reaction.at_s), "{aside:?}");
    let (_, right) = told(stands(), &mut From(35, controls(0.0, -0.012)));
    assert_eq!(right.reaction.unwrap().by, Reacted::SteeredRight);
}

#[test]
fn who_crosses_comes_from_the_side_that_it_leaves_behind() {
    let crossing = |towards: f64| {
        let samples = motion(91, |t| Vec2::new(37.0, -towards * (30.0 - 10.0 * t)));
        let (contact, timeline) = told(samples, &mut From(91, controls(0.0, 0.0)));
        assert_eq!(contact.class, ContactClass::Crossing);
        timeline.from
    };
    assert_eq!([crossing(1.0), crossing(-1.0)], [Side::Right, Side::Left]);
    let cut_in = |side: f64| {
        let samples = motion(91, |t| Vec2::new(45.0 + 4.0 * t, side * lateral(t, 3.5, 0.0, 2.9..4.4)));
        let (contact, timeline) = told(samples, &mut From(91, controls(0.0, 0.0)));
        assert_eq!(contact.class, ContactClass::CutIn);
        timeline.from
    };
    assert_eq!([cut_in(1.0), cut_in(-1.0)], [Side::Left, Side::Right]);
    let ram = motion(91, |t| Vec2::new(-30.0 + 20.0 * t, 0.0));
    let (_, timeline) = told(ram, &mut From(91, controls(0.0, 0.0)));
    assert_eq!((timeline.from, timeline.visible_s), (Side::Rear, None));
}

#[test]
fn a_contact_is_avoidable_exactly_where_some_manoeuvre_helps_from_the_careful_drivers_reaction_on() {
    let mut counted = [0, 0];
    for seed in 0..80 {
        let scene = crossing(seed, 12, 91);
        let (plant, act) = (Plant::new(&scene).unwrap(), intercept(&scene, 10));
        let driver = &mut *crate::ego::Policy::Idm.driver();
        let (outcome, _, timeline) = rollout_explained(&plant, &act, driver).unwrap();
        assert_eq!(timeline.is_some(), outcome.contact.is_some());
        let (Some(contact), Some(timeline)) = (outcome.contact.filter(|of| of.adversary), timeline) else { continue };
        let before = timeline.visible_s.map(|at_s| contact.time_s - at_s);
        assert!(before.zip(contact.visible_s).is_none_or(|(a, b)| (a - b).abs() < 1e-9), "seed {seed}");
        assert_eq!(before.is_some(), contact.visible_s.is_some(), "seed {seed}");
        let late_s = lateness_s(&plant, &act, driver, &outcome).unwrap();
        let last_s = timeline.last_chance().and_then(|chance| chance.last_s);
        let could_s = timeline.visible_s.map_or(contact.time_s, |at_s| (at_s + 1.15).min(contact.time_s));
        let expected = last_s.map(|last_s| could_s - last_s);
        assert_eq!(late_s.is_some(), expected.is_some(), "seed {seed}: {timeline:?}");
        assert!(late_s.zip(expected).is_none_or(|(a, b)| (a - b).abs() < 1e-9), "seed {seed}: {late_s:?} {expected:?}");
        counted[usize::from(contact.avoidable == Some(true))] += 1;
    }
    assert!(counted.iter().all(|count| *count > 2), "{counted:?}");
}
