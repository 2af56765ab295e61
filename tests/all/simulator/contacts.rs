//! Every class of contact in a scene made by hand: who struck whom, on which sides, and the class.

use std::ops::Range;

use crate::kernel::{Vec2, num};
use crate::scene::{Sample, Scene};
use crate::sim::scenes::*;
use crate::sim::*;

/// Holds its speed and steering, whatever comes.
pub struct Blind {
    pub steering_rad: f64,
}

impl Driver for Blind {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, _: &View<'_>) -> Control {
        Control::Drive { acceleration_mps2: 0.0, steering_rad: self.steering_rad }
    }
}

/// One sample a decision step of a motion given as the place over time (s); velocity and heading follow from it.
pub fn motion(steps: usize, at: impl Fn(f64) -> Vec2) -> Vec<Sample> {
    let sample = |k: usize| {
        let seconds = 0.1 * k as f64;
        let velocity = (at(seconds + 0.05) - at(seconds - 0.05)) * 10.0;
        let heading_rad = if velocity.norm() > 0.1 { velocity.heading() } else { 0.0 };
        Sample { position: at(seconds), heading_rad, velocity }
    };
    (0..steps).map(sample).collect()
}

/// A blind ego at 12 m/s on a straight road from the origin, and an adversary with a motion from the first step on.
pub fn against(samples: Vec<Sample>) -> (Scene, Intervention) {
    let other = car("other", samples.iter().copied().map(Some).collect());
    let act = Intervention { actions: vec![Action::Follow { track: 0, from_step: 1, samples: samples[1..].to_vec() }] };
    (straight_road(91, 12.0, vec![other]), act)
}

pub fn contact_of(scene: &Scene, act: &Intervention, driver: &mut dyn Driver) -> Contact {
    let plant = Plant::new(scene).unwrap();
    rollout_assessed(&plant, act, driver).unwrap().contact.expect("a contact")
}

fn met(samples: Vec<Sample>) -> Contact {
    let (scene, act) = against(samples);
    contact_of(&scene, &act, &mut Blind { steering_rad: 0.0 })
}

/// Moves from one lateral place to another between two times, at constant lateral speed.
pub fn lateral(seconds: f64, from_m: f64, to_m: f64, during_s: Range<f64>) -> f64 {
    from_m + (to_m - from_m) * ((seconds - during_s.start) / (during_s.end - during_s.start)).clamp(0.0, 1.0)
}

fn labelled(contact: Contact) -> (ContactClass, Striker, Side, Side) {
    assert!(contact.adversary);
    (contact.class, contact.striker, contact.ego_side, contact.other_side)
}

#[test]
fn a_car_that_rams_the_ego_from_behind_is_a_rear_end_in_which_the_ego_is_struck() {
    let contact = met(motion(91, |t| Vec2::new(-30.0 + 20.0 * t, 0.0)));
    assert_eq!(labelled(contact), (ContactClass::RearEndEgoStruck, Striker::Other, Side::Rear, Side::Front));
    assert!((contact.relative_speed_mps - 8.0).abs() < 1e-9);
}

#[test]
fn a_car_that_comes_over_ahead_of_the_ego_cuts_in() {
    let contact = met(motion(91, |t| Vec2::new(30.0 + 4.0 * t, lateral(t, 3.5, 0.0, 1.5..3.0))));
    assert_eq!(labelled(contact), (ContactClass::CutIn, Striker::Ego, Side::Front, Side::Rear));
}

#[test]
fn a_slower_car_that_was_always_ahead_is_struck_by_the_ego() {
    let contact = met(motion(91, |t| Vec2::new(30.0 + 4.0 * t, 0.0)));
    assert_eq!(labelled(contact), (ContactClass::EgoStrikes, Striker::Ego, Side::Front, Side::Rear));
}

#[test]
fn a_car_that_stands_in_the_lane_is_a_stationary_hit() {
    let contact = met(motion(91, |_| Vec2::new(40.0, 0.0)));
    assert_eq!(labelled(contact), (ContactClass::StationaryHit, Striker::Ego, Side::Front, Side::Rear));
}

#[test]
fn a_car_that_comes_from_the_right_crosses() {
    let contact = met(motion(91, |t| Vec2::new(33.0, -30.0 + 10.0 * t)));
    assert_eq!(labelled(contact), (ContactClass::Crossing, Striker::Other, Side::Right, Side::Front));
    // Farther on it is there first, and the ego's front meets its flank.
    let contact = met(motion(91, |t| Vec2::new(37.0, -30.0 + 10.0 * t)));
    assert_eq!(labelled(contact), (ContactClass::Crossing, Striker::Ego, Side::Front, Side::Left));
}

#[test]
fn a_car_that_comes_towards_the_ego_meets_it_head_on() {
    let contact = met(motion(91, |t| Vec2::new(80.0 - 10.0 * t, 0.3)));
    assert_eq!(labelled(contact), (ContactClass::HeadOn, Striker::Both, Side::Front, Side::Front));
    assert!((contact.impact_angle_rad.abs() - num::PI).abs() < 1e-9);
}

#[test]
fn a_car_beside_the_ego_that_drifts_over_sideswipes_it() {
    let contact = met(motion(91, |t| Vec2::new(12.0 * t, lateral(t, 3.5, 0.0, 1.0..4.0))));
    assert_eq!(labelled(contact), (ContactClass::Sideswipe, Striker::Other, Side::Left, Side::Right));
    let contact = met(motion(91, |t| Vec2::new(12.0 * t, lateral(t, -3.5, 0.0, 1.0..4.0))));
    assert_eq!(labelled(contact), (ContactClass::Sideswipe, Striker::Other, Side::Right, Side::Left));
}

#[test]
fn an_ego_that_drifts_into_a_car_beside_it_sideswipes_that_car() {
    let (scene, act) = against(motion(91, |t| Vec2::new(12.0 * t, 2.6)));
    let contact = contact_of(&scene, &act, &mut Blind { steering_rad: 0.02 });
    assert_eq!(labelled(contact), (ContactClass::EgoSideswipes, Striker::Ego, Side::Left, Side::Right));
}

#[test]
fn a_car_that_comes_in_at_a_slant_sideswipes_though_its_own_flank_has_no_speed_across_itself() {
    // 10 degrees to the right, from the left: the front left corner of the ego meets its flank.
    let way = Vec2::from_heading(-10.0_f64.to_radians()) * 12.6;
    let contact = met(motion(91, |t| Vec2::new(1.0, 5.0) + way * t));
    assert_eq!((contact.class, contact.striker), (ContactClass::Sideswipe, Striker::Other));
}

#[test]
fn a_car_that_appears_before_the_ego_cuts_in_even_if_it_stands_there() {
    let scene = straight_road(91, 12.0, vec![]);
    let samples = vec![sample(40.0, 0.0, 0.0, 0.0); 60];
    let kind = crate::scene::AgentKind::Vehicle;
    let act =
        Intervention { actions: vec![Action::Insert { kind, length_m: 4.5, width_m: 1.9, from_step: 26, samples }] };
    assert_eq!(contact_of(&scene, &act, &mut Blind { steering_rad: 0.0 }).class, ContactClass::CutIn);
}

/// The class must come from both motions: three motions that lead to one place at one time give three classes.
#[test]
fn one_place_of_contact_has_the_class_that_its_motion_gives_it() {
    // At 2.5 s all stand at x = 34.5 m and look along the road; the ego's front arrives there at 32.25 m.
    let stood = met(motion(91, |_| Vec2::new(34.5, 0.0)));
    let slow = met(motion(91, |t| Vec2::new(34.5 + 2.0 * (t - 2.5), 0.0)));
    let reversing = {
        let back = motion(91, |t| Vec2::new(34.5 - 2.0 * (t - 2.5), 0.0));
        met(back.into_iter().map(|s| Sample { heading_rad: 0.0, ..s }).collect())
    };
    let places: Vec<f64> = [stood, slow, reversing].iter().map(|c| c.time_s).collect();
    assert!(places.iter().all(|t| (t - 2.5).abs() < 0.12), "{places:?}");
    let classes = [stood, slow, reversing].map(|c| c.class);
    assert_eq!(classes, [ContactClass::StationaryHit, ContactClass::EgoStrikes, ContactClass::HeadOn]);
    assert!([stood, slow, reversing].iter().all(|c| (c.ego_side, c.other_side) == (Side::Front, Side::Rear)));
}
