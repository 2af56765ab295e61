//! Single rollouts whose outcome is known beforehand.

use crate::ego::Policy;
use crate::kernel::Vec2;
use crate::scene::{AgentKind, Sample};
use crate::sim::scenes::*;
use crate::sim::*;

fn run(scene: &crate::scene::Scene, intervention: &Intervention, policy: Policy) -> Outcome {
    let plant = Plant::new(scene).unwrap();
    let outcome = rollout(&plant, intervention, &mut *policy.driver()).unwrap();
    let (traced, trace) = rollout_traced(&plant, intervention, &mut *policy.driver()).unwrap();
    assert_eq!(outcome, traced);
    assert_eq!(trace.ego.len(), outcome.steps + 1);
    assert!(trace.actors.iter().all(|a| a.samples.len() == trace.ego.len()));
    outcome
}

#[test]
fn an_idm_ego_on_an_empty_road_arrives() {
    let outcome = run(&straight_road(91, 8.0, vec![]), &Intervention::default(), Policy::Idm);
    assert_eq!(outcome.end, End::Arrived, "{outcome:?}");
    assert!(outcome.ego_lateral_m_max < 1e-9);
    assert!(outcome.ego.speed_mps_max < 40.0 / 3.6 + 0.1);
}

#[test]
fn an_idm_ego_stops_behind_a_standing_car() {
    let scene = straight_road(91, 8.0, vec![car("wall", straight(sample(60.0, 0.0, 0.0, 0.0), 91))]);
    let outcome = run(&scene, &Intervention::default(), Policy::Idm);
    assert_eq!(outcome.end, End::Horizon, "{outcome:?}");
    assert!(outcome.contact.is_none() && outcome.distance_m_min.unwrap() > 1.0, "{outcome:?}");
}

#[test]
fn a_replayed_ego_is_hit_by_a_crossing_car_at_the_analytic_time() {
    // Fronts of ego (x = 8t + 2.25) and side of the crossing car (y = -40 + 10t + 2.25 reaches -0.95).
    let crossing = car("cross", straight(sample(30.0, -40.0, crate::kernel::num::FRAC_PI_2, 10.0), 91));
    let outcome = run(&straight_road(91, 8.0, vec![crossing]), &Intervention::default(), Policy::Replay);
    let contact = outcome.contact.expect("a contact");
    let expected: f64 = (40.0 - 2.25 - 0.95) / 10.0;
    assert!(contact.time_s >= expected - 1e-9 && contact.time_s < expected + 0.02, "{contact:?} {expected}");
    assert_eq!(contact.with, ActorRef::Track(0));
    assert!(!contact.adversary);
}

#[test]
fn an_adversary_that_cuts_in_and_stops_is_struck_by_the_ego() {
    let parked = car("other", straight(sample(200.0, 0.0, 0.0, 0.0), 91));
    let scene = straight_road(91, 10.0, vec![parked]);
    let samples: Vec<Sample> = (0..80).map(|_| sample(10.0, 0.0, 0.0, 0.0)).collect();
    let act = Intervention { actions: vec![Action::Follow { track: 0, from_step: 3, samples }] };
    let outcome = run(&scene, &act, Policy::Idm);
    let contact = outcome.contact.expect("a contact");
    assert!(contact.adversary && contact.striker == Striker::Ego, "{contact:?}");
    assert_eq!(outcome.distance_m_min, Some(0.0));
    assert_eq!(outcome.post_encroachment_s_min, Some(0.0));
    assert!(outcome.adversaries[0].simulated.jump_m > 100.0);
}

#[test]
fn a_rollout_told_in_parts_is_the_same_and_passes_through_all_of_them() {
    for seed in 0..20 {
        let scene = crossing(seed, 20, 91);
        let (plant, act) = (Plant::new(&scene).unwrap(), intercept(&scene, 10));
        let mut parts = Vec::new();
        let outcome = rollout_in_parts(&plant, &act, &mut *Policy::Idm.driver(), |part| parts.push(part)).unwrap();
        assert_eq!(outcome, rollout_counted(&plant, &act, &mut *Policy::Idm.driver()).unwrap());
        assert_eq!((parts[0], parts[parts.len() - 1]), (Part::Setup, Part::Setup));
        let begins = |part| parts.iter().filter(|p| **p == part).count() as u64;
        assert!([Part::Motion, Part::Contact].iter().all(|&part| begins(part) == outcome.1.steps), "{parts:?}");
        assert!(Part::ALL.iter().all(|&part| begins(part) > 0));
    }
}

#[test]
fn a_rollout_without_its_account_ends_in_the_same_way() {
    let mut contacts = 0;
    for seed in 0..40 {
        let scene = crossing(seed, 20, 91);
        let (plant, act) = (Plant::new(&scene).unwrap(), intercept(&scene, 10));
        for policy in [Policy::Idm, Policy::Replay] {
            let outcome = rollout(&plant, &act, &mut *policy.driver()).unwrap();
            let ended = ending(&plant, &act, &mut *policy.driver()).unwrap();
            assert_eq!(ended, (outcome.end, outcome.contact));
            contacts += usize::from(outcome.contact.is_some());
        }
    }
    assert!(contacts > 5, "{contacts}");
}

#[test]
fn hostile_interventions_are_refused() {
    let plant = Plant::new(&straight_road(91, 10.0, vec![car("a", straight(sample(9.0, 4.0, 0.0, 9.0), 91))])).unwrap();
    let good = vec![sample(0.0, 9.0, 0.0, 1.0)];
    let bad = vec![sample(f64::NAN, 9.0, 0.0, 1.0)];
    let follow =
        |track, from_step, samples: &Vec<Sample>| Action::Follow { track, from_step, samples: samples.clone() };
    let insert = |length_m, samples: &Vec<Sample>| Action::Insert {
        kind: AgentKind::Pedestrian,
        length_m,
        width_m: 0.5,
        from_step: 0,
        samples: samples.clone(),
    };
    let react =
        |handover_step| Action::FollowThenReact { track: 0, from_step: 5, samples: good.clone(), handover_step };
    let cases = [
        vec![follow(1, 0, &good)],
        vec![follow(0, 91, &good)],
        vec![follow(0, usize::MAX, &good)],
        vec![follow(0, 0, &vec![])],
        vec![follow(0, 0, &bad)],
        vec![follow(0, 0, &good), follow(0, 3, &good)],
        vec![insert(0.0, &good)],
        vec![insert(f64::INFINITY, &good)],
        vec![insert(0.5, &bad)],
        vec![react(4)],
        vec![react(usize::MAX)],
    ];
    for actions in cases {
        let act = Intervention { actions };
        assert!(rollout(&plant, &act, &mut *Policy::Idm.driver()).is_err(), "{act:?}");
    }
}

/// A car that is recorded 20 m beside the ego's road at 10 m/s, and follows a motion of its own from the second step on.
fn beside(at: impl Fn(f64) -> Vec2) -> AdversaryReport {
    let log = straight(sample(0.0, 20.0, 0.0, 10.0), 91);
    let scene = straight_road(91, 8.0, vec![car("other", log)]);
    let moved = |k: usize| {
        let velocity = (at(0.1 * k as f64 + 0.05) - at(0.1 * k as f64 - 0.05)) * 10.0;
        Sample { position: at(0.1 * k as f64), heading_rad: 0.0, velocity }
    };
    let action = Action::Follow { track: 0, from_step: 1, samples: (1..91).map(moved).collect() };
    let plant = Plant::new(&scene).unwrap();
    let acts = Intervention { actions: vec![action] };
    rollout(&plant, &acts, &mut *Policy::Replay.driver()).unwrap().adversaries[0].clone()
}

#[test]
fn an_adversary_completes_the_share_of_its_recorded_way_that_it_has_driven_by_then() {
    // From 1 m on, where both are at the second step.
    let half = beside(|t| Vec2::new(1.0 + 5.0 * (t - 0.1), 20.0)).route_completion.unwrap();
    assert!((half - 0.5).abs() < 1e-9, "half as fast as recorded: {half}");
    let whole = beside(|t| Vec2::new(10.0 * t, 20.0)).route_completion.unwrap();
    assert!((whole - 1.0).abs() < 1e-9, "{whole}");
    assert_eq!(beside(|t| Vec2::new(1.0, 20.0 + 5.0 * t)).route_completion, Some(0.0), "off to another road");
}

#[test]
fn a_quarter_of_a_metre_from_its_recording_an_adversary_does_not_act_and_farther_it_does() {
    assert!(!beside(|t| Vec2::new(10.0 * t, 20.25)).acted);
    let acts = beside(|t| Vec2::new(10.0 * t, 20.26));
    assert!(acts.acted && acts.log_deviation_m_max.is_some_and(|off| (off - 0.26).abs() < 1e-9));
}
