//! The catalogue of implausible motions on generated scenes: each is caught by its own diagnostic nearly everywhere, and
//! the ways around are closed.

use std::sync::{Arc, OnceLock};

use super::motions::Case;
use super::{options, played, worlds};
use evodrive::ego::Policy;
use evodrive::evaluation::metrics::realism::realism;
use evodrive::kernel::{Seed, Threads, Vec2};
use evodrive::objects::replay::{Replayed, Suite};
use evodrive::scene::{PreparedScene, Scene};
use evodrive::sim::Action;
use evodrive::synth::WorldKind;

/// A motion is caught where its diagnostic loses at least half.
const CAUGHT: f64 = 0.5;
/// Share of scenes in which it must be.
const SHARE: f64 = 0.95;
const SCENES: usize = 48;

pub fn cases() -> &'static [Case] {
    static CASES: OnceLock<Vec<Case>> = OnceLock::new();
    CASES.get_or_init(|| {
        let kinds = [
            WorldKind::Straight,
            WorldKind::Curve,
            WorldKind::UnsignalledCrossing,
            WorldKind::Merge,
            WorldKind::LaneDrop,
            WorldKind::Highway,
        ];
        let scenes = worlds(&kinds, 14, Seed(11), SCENES).into_iter();
        scenes.filter_map(Case::of).filter(lasts).collect()
    })
}

/// Returns `true` if the scene is not over before a motion has shown what it is.
fn lasts(case: &Case) -> bool {
    played(&case.scene, case.follow(case.log.clone()), &Policy::Idm).steps >= 40
}

/// Share of the scenes in which `diagnostic` catches a motion, and their number.
fn caught(diagnostic: &str, motion: impl Fn(&Case) -> Option<(Scene, Action)>) -> (f64, usize) {
    caught_with(diagnostic, &Policy::Idm, motion)
}

fn caught_with(diagnostic: &str, ego: &Policy, motion: impl Fn(&Case) -> Option<(Scene, Action)>) -> (f64, usize) {
    let options = options();
    let mut found: Vec<f64> = Vec::new();
    for (scene, action) in cases().iter().filter_map(motion) {
        let outcome = played(&scene, action, ego);
        found.push(realism(&outcome, &options).0[diagnostic]);
    }
    let share = found.iter().filter(|d| **d <= CAUGHT).count() as f64 / found.len() as f64;
    println!("{diagnostic}: {:.1} % of {} scenes", 100.0 * share, found.len());
    (share, found.len())
}

fn is_caught(diagnostic: &str, motion: impl Fn(&Case) -> Action) {
    let (share, count) = caught(diagnostic, |case| Some((case.scene.clone(), motion(case))));
    assert!(share >= SHARE && count >= 25, "{diagnostic}: {share} of {count}");
}

#[test]
fn a_teleport_breaks_continuity() {
    is_caught("trajectory_continuity", Case::teleport);
}

#[test]
fn a_teleport_made_smooth_is_an_acceleration() {
    is_caught("bounded_acceleration", Case::smooth_teleport);
}

#[test]
fn a_brake_of_two_g_is_out_of_bounds() {
    is_caught("bounded_acceleration", Case::two_g_brake);
}

#[test]
fn a_sideways_slide_is_slip() {
    is_caught("bounded_slip", Case::sideways_slide);
}

#[test]
fn driving_against_traffic_is_seen_by_the_lanes() {
    is_caught("lane_direction", Case::against_traffic);
}

#[test]
fn leaving_the_road_is_seen_by_the_map() {
    is_caught("map_validity", Case::off_the_road);
}

#[test]
fn a_way_through_a_parked_car_is_seen() {
    let (share, count) = caught("parked_obstacles", |case| Some(case.through_parked()));
    assert!(share >= SHARE && count >= 25, "{share} of {count}");
}

#[test]
fn a_way_through_another_car_is_seen() {
    // The ego keeps to its log, so that traffic does too and nobody gives way; where the ego is met first, the scene is
    // over before the other car is reached.
    let reached = |case: &Case| {
        let action = case.through_another()?;
        let steps = played(&case.scene, action.clone(), &Policy::Replay).steps;
        (steps >= 22).then(|| (case.scene.clone(), action))
    };
    let (share, count) = caught_with("collision_validity", &Policy::Replay, reached);
    assert!(share >= SHARE && count >= 25, "{share} of {count}");
}

#[test]
fn appearing_in_another_car_is_seen() {
    is_caught("initial_non_overlap", Case::onto_another);
}

#[test]
fn standing_where_one_would_have_driven_is_an_uncompleted_route() {
    is_caught("route_completion", Case::gives_up);
}

#[test]
fn jitter_is_caught_below_the_filter_s_cut_off_and_above_it() {
    is_caught("bounded_jerk", |case| case.jitter(0.65, 0.8));
    is_caught("trajectory_continuity", |case| case.jitter(0.6, 1.0));
    is_caught("trajectory_continuity", |case| case.jitter(0.5, 2.0));
    is_caught("trajectory_continuity", |case| case.jitter(0.35, 4.0));
}

#[test]
fn velocities_that_belie_the_places_break_continuity() {
    is_caught("trajectory_continuity", Case::lying_velocity);
}

#[test]
fn the_log_itself_and_what_keeps_within_the_tolerance_are_no_act() {
    let options = options();
    for case in cases() {
        for shift in [0.0, 0.2] {
            let way =
                case.log.iter().map(|s| evodrive::scene::Sample { position: s.position + Vec2::new(shift, 0.0), ..*s });
            let outcome = played(&case.scene, case.follow(way.collect()), &Policy::Idm);
            assert!(!outcome.acted(), "{}", case.scene.id);
            let (all, _) = realism(&outcome, &options);
            let low: Vec<_> = all.iter().filter(|(_, d)| **d < 0.98).collect();
            assert!(low.is_empty(), "{}: {low:?}", case.scene.id);
        }
        assert!(played(&case.scene, case.teleport(), &Policy::Idm).acted(), "{}", case.scene.id);
    }
}

#[test]
fn the_do_nothing_row_says_what_the_recorded_scenes_are_and_a_null_program_earns_nothing() {
    use evodrive::sim::{Intervention, Plant, rollout};
    let plants: Vec<_> = cases().iter().map(|case| Plant::new(&case.scene).unwrap()).collect();
    let replayed = played_without_a_program(cases().iter().map(|case| case.scene.clone()), &Policy::Idm).unwrap();
    let row = &replayed.row;
    assert_eq!((row.scenes, replayed.scenes.len(), replayed.failures.len()), (plants.len(), plants.len(), 0));
    let mut contacts = 0;
    for (plant, scene) in plants.iter().zip(&replayed.scenes) {
        let outcome = rollout(plant, &Intervention::default(), Policy::Idm.driver().as_mut()).unwrap();
        assert_eq!((outcome.contact.is_some(), outcome.route_completion), (scene.contact, scene.route_completion));
        assert!(!outcome.acted(), "a null program acts nowhere");
        contacts += usize::from(scene.contact);
    }
    assert_eq!(row.contact_rate, contacts as f64 / plants.len() as f64);
    assert!(row.realism.is_some_and(|r| r > 0.9 && r <= 1.0), "{:?}", row.realism);
    assert!(played_without_a_program([], &Policy::Idm).is_none());
}

/// The do-nothing row of these scenes.
fn played_without_a_program(scenes: impl IntoIterator<Item = Scene>, ego: &Policy) -> Option<Replayed> {
    use evodrive::backend::Backend;
    use evodrive::evaluation::{AttackOptions, EvaluationOptions, MetadriveOptions, Playing, replay_row};
    use evodrive::sim::{ContactClass, SimulatorOptions};
    let attack = AttackOptions {
        counts: ContactClass::ALL.into(),
        counts_if_avoidable: [].into(),
        when: None,
        requires: Default::default(),
    };
    let evaluation =
        EvaluationOptions::Metadrive(MetadriveOptions { attack, realism: options(), metrics: Default::default() });
    let (simulator, seed) = (&SimulatorOptions::SHIPPED, Seed(1));
    let playing = Playing { ego, simulator, backend: Backend::Own, seed, evaluation: &evaluation };
    let scenes: Vec<_> = scenes.into_iter().map(|scene| PreparedScene::new(Arc::new(scene))).collect();
    replay_row(&scenes, Suite::HeldOut, &playing, &Threads::new(2).unwrap()).unwrap()
}

#[test]
fn one_contact_in_four_untouched_scenes_is_a_contact_rate_of_a_quarter() {
    use crate::sim::scenes::{car, sample, straight, straight_road};
    let scene = |x_m: f64| straight_road(91, 8.0, vec![car("stands", straight(sample(x_m, 0.0, 0.0, 0.0), 91))]);
    // The ego drives 72 m and cannot see, so it runs into the one that stands 40 m ahead.
    let row = played_without_a_program([200.0, 40.0, 200.0, 200.0].map(scene), &Policy::Replay).unwrap().row;
    assert_eq!((row.contact_rate, row.realism), (0.25, None));
}
