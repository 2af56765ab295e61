//! Adversaries under a law: what they observe, what they do with it, and what a car cannot.

use evodrive::adapters::vocabulary;
use evodrive::kernel::Formula;
use evodrive::kernel::formula::Op;
use evodrive::objects::expr::{Expr, Scope};

use crate::ego::Policy;
use crate::scene::{Sample, Scene};
use crate::sim::scenes::*;
use crate::sim::*;

fn formula(text: &str) -> Formula {
    let scope = Scope::new(vocabulary::LAW.iter().map(|feature| (feature.name, feature.value)));
    Expr::parse(text).unwrap().compile(&scope).unwrap().formula().clone()
}

fn law(onset: Option<&str>, acceleration: &str, offset: Option<&str>) -> Law {
    Law { onset: onset.map(formula), acceleration: formula(acceleration), offset: offset.map(formula) }
}

/// The ego at 10 m/s, and beside it ahead a car at 10 m/s that goes straight on.
fn beside() -> Scene {
    let track = car("beside", straight(sample(30.0, 3.5, 0.0, 10.0), 91));
    straight_road(91, 10.0, vec![track])
}

/// The car follows its recording from step 5 on, until the law takes over.
fn under(scene: &Scene, law: Law) -> Intervention {
    let samples: Vec<Sample> = scene.tracks[0].samples[5..].iter().flatten().copied().collect();
    Intervention { actions: vec![Action::FollowThenObey { track: 0, from_step: 5, samples, law }] }
}

fn driven(scene: &Scene, act: &Intervention, ego: &mut dyn Driver) -> (Outcome, Vec<Sample>) {
    let (outcome, trace) = rollout_traced(&Plant::new(scene).unwrap(), act, ego).unwrap();
    let actor = trace.actors.into_iter().find(|actor| actor.actor == ActorRef::Track(0)).unwrap();
    (outcome, actor.samples.into_iter().flatten().collect())
}

fn way(law: Law) -> Vec<Sample> {
    let scene = beside();
    driven(&scene, &under(&scene, law), Policy::Idm.driver().as_mut()).1
}

/// Speeds at the steps after the law took over, at step 5.
fn speeds(acceleration: &str) -> Vec<f64> {
    way(law(None, acceleration, None))[5..].iter().map(Sample::speed_mps).collect()
}

#[test]
fn a_law_accelerates_as_it_says_and_no_more_than_brakes_and_engine_give() {
    let gains = |acceleration| speeds(acceleration).windows(2).map(|v| (v[1] - v[0]) / 0.1).take(8).collect::<Vec<_>>();
    for (says, does) in [("-3", -3.0), ("1.5", 1.5), ("-1e9", -0.9 * 9.81), ("1 / 0", 2.76), ("0 / 0", 0.0)] {
        for gain in gains(says) {
            assert!((gain - does).abs() < 1e-6, "{says}: {gain}");
        }
    }
    // It never drives backwards.
    assert_eq!(speeds("-8").last().copied(), Some(0.0));
}

#[test]
fn before_its_onset_the_samples_are_followed_bit_for_bit_and_from_then_on_it_obeys() {
    let recorded = way(law(Some("false"), "-8", None));
    let scene = beside();
    assert!(recorded.iter().zip(scene.tracks[0].samples.iter().flatten()).all(|(a, b)| a == b));
    let stops = way(law(Some("own_path_left_m < 50"), "if(since_onset_s < 1, 0, -8)", None));
    let first = stops.iter().zip(&recorded).position(|(a, b)| a.position.x < b.position.x - 1e-6).unwrap();
    // The path of the samples is 85 m long and begins at x = 35: 50 m are left at x = 70, a second later it brakes.
    assert!((stops[first - 1].position.x - 80.0).abs() < 1.5, "{}", stops[first - 1].position.x);
    // The onset stays: it does not begin to drive again.
    assert_eq!(stops.last().unwrap().speed_mps(), 0.0);
}

#[test]
fn an_offset_moves_it_beside_its_path_no_faster_than_two_metres_a_second() {
    let moved = way(law(None, "0", Some("0 - 3.5")));
    let aside: Vec<f64> = moved.iter().map(|s| s.position.y).collect();
    assert!(aside.last().is_some_and(|y| y.abs() < 0.2), "{aside:?}");
    assert!(aside.iter().all(|y| *y > -0.8));
    let fastest = aside.windows(2).map(|y| (y[1] - y[0]).abs() / 0.1).fold(0.0, f64::max);
    assert!((1.0..4.0).contains(&fastest), "{fastest}");
}

#[test]
fn what_it_observes_is_what_there_is() {
    // An observed value becomes visible as an acceleration: 2 m/s² where it is as computed by hand at that step.
    let holds_at_once = |condition: &str| {
        let text = format!("if(since_onset_s < 0.05, if({condition}, 2, -2), 0)");
        speeds(&text)[1] > 10.0
    };
    // At step 5 the ego is at x = 5 (about: IDM speeds up or holds), the car at x = 35, y = 3.5; both head east.
    for (condition, holds) in [
        ("abs(own_speed_mps - 10) < 1e-6", true),
        ("abs(seen_ego_left_m + 3.5) < 0.01", true),
        ("seen_ego_ahead_m < -29 and seen_ego_ahead_m > -31", true),
        ("seen_gap_m > 25 and seen_gap_m < 26.5", true),
        ("abs(seen_ego_heading_rad) < 0.001", true),
        ("abs(seen_closing_mps) < 1", true),
        ("seen_ttc_s >= 20", true),
        ("abs(planned_acceleration_mps2) < 1e-6", true),
        ("abs(own_path_left_m - 85) < 0.01", true),
        ("others_gap_m == 50 and others_ahead_gap_m == 50", true),
        ("adversary_index == 0 and adversary_count == 1", true),
        ("ego_to_conflict_m == 200 and own_to_conflict_m == 200", true),
        ("seen_ego_speed_mps < 9", false),
        ("seen_ego_acceleration_mps2 < -3", false),
    ] {
        assert_eq!(holds_at_once(condition), holds, "{condition}");
    }
}

#[test]
fn who_is_in_its_way_and_where_the_paths_meet_is_seen() {
    let mut scene = beside();
    scene.tracks.push(car("ahead", straight(sample(55.0, 3.5, 0.0, 0.0), 91)));
    let stops = law(None, "if(others_ahead_gap_m < 12, -8, 0)", None);
    let (outcome, way) = driven(&scene, &under(&scene, stops), Policy::Idm.driver().as_mut());
    assert!(!outcome.adversaries[0].struck_parked && way.last().unwrap().speed_mps() == 0.0);
    assert!(way.last().unwrap().position.x < 51.0, "{:?}", way.last());
    let (_, way) = driven(&scene, &under(&scene, law(None, "1", None)), Policy::Idm.driver().as_mut());
    assert!(way.last().unwrap().position.x > 60.0, "who does not look does not stop: {:?}", way.last());
    // A path that turns onto the ego's route meets it.
    let mut crossing = beside();
    crossing.tracks[0].samples = straight(sample(60.0, 40.0, -std::f64::consts::FRAC_PI_2, 8.0), 91);
    let waits = law(None, "if(own_to_conflict_m < 15 and ego_to_conflict_m > 0, -8, 0)", None);
    let (_, way) = driven(&crossing, &under(&crossing, waits), Policy::Idm.driver().as_mut());
    let slowest = way.iter().position(|s| s.speed_mps() == 0.0).unwrap();
    assert!((5.0..15.0).contains(&way[slowest].position.y), "{}", way[slowest].position.y);
}

/// Drives at constant speed and brakes from a step on.
struct BrakesFrom(usize);

impl Driver for BrakesFrom {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        let acceleration_mps2 = if view.step() >= self.0 { -4.0 } else { 0.0 };
        Control::Drive { acceleration_mps2, steering_rad: 0.0 }
    }
}

#[test]
fn an_adversary_under_a_law_answers_the_ego_and_its_motion_is_part_of_the_trace_digest() {
    let scene = beside();
    let follows_the_ego = under(&scene, law(None, "seen_ego_speed_mps - own_speed_mps", None));
    let [steady, braking] = [1000, 30].map(|from| driven(&scene, &follows_the_ego, &mut BrakesFrom(from)));
    let first = steady.1.iter().zip(&braking.1).position(|(a, b)| a != b).unwrap();
    // The ego is slower at step 31; the adversary sees that then and is slower at step 32.
    assert_eq!(first, 32);
    let again = driven(&scene, &follows_the_ego, &mut BrakesFrom(30));
    assert_eq!(again.0.trace, braking.0.trace);
    let other = under(&scene, law(None, "1.01 * seen_ego_speed_mps - own_speed_mps", None));
    assert_ne!(driven(&scene, &other, &mut BrakesFrom(30)).0.trace, braking.0.trace);
}

#[test]
fn a_law_that_reads_what_nobody_observes_is_refused() {
    let scene = beside();
    let mut wrong = law(None, "0", None);
    wrong.acceleration = Formula::try_from(vec![Op::Load(vocabulary::LAW.len())]).unwrap();
    let refused = rollout(&Plant::new(&scene).unwrap(), &under(&scene, wrong), Policy::Idm.driver().as_mut());
    assert!(refused.unwrap_err().to_string().contains("what is observed"));
}
