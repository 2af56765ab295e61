//! The ego policies.

use crate::ego::learned::{ACTION, OBSERVATION};
use crate::ego::{Network, Policy, PolicyError};
use crate::kernel::{Seed, Vec2};
use crate::scene::{Light, LightState};
use crate::scenes::*;
use crate::sim::*;

#[test]
fn policies_are_found_by_their_names_and_differ_in_their_digests() {
    let policies: Vec<Policy> = ["idm", "idm-lights", "replay"].iter().map(|n| n.parse().unwrap()).collect();
    for (i, policy) in policies.iter().enumerate() {
        assert_eq!(policy.name().parse(), Ok(policy.clone()));
        assert!(policies[i + 1..].iter().all(|other| other.digest() != policy.digest()));
    }
    assert_eq!("learned".parse::<Policy>(), Err(PolicyError::NoWeights));
    assert!("expert".parse::<Policy>().is_err());
}

#[test]
fn only_the_ego_that_minds_lights_stops_at_a_red_one() {
    let mut scene = straight_road(121, 8.0, vec![]);
    let states = vec![LightState::Stop; 121];
    scene.lights = vec![Light { lane: 0, stop_point: Vec2::new(60.0, 0.5), states }];
    let plant = Plant::new(&scene).unwrap();
    let end = |policy: Policy| rollout_traced(&plant, &Intervention::default(), &mut *policy.driver()).unwrap();
    assert_eq!(end(Policy::Idm).0.end, End::Arrived);
    let (outcome, trace) = end(Policy::IdmMindingLights);
    assert_eq!(outcome.end, End::Horizon);
    assert!(trace.ego.last().unwrap().position.x < 60.0);
}

/// A network of one layer that drives straight on at a pace that its speed input sets.
fn cruise() -> Vec<u8> {
    let mut weights = vec![0.0; ACTION * OBSERVATION + ACTION];
    weights[0] = -4.0;
    weights[ACTION * OBSERVATION] = 1.6;
    Network::to_bytes(&[OBSERVATION, ACTION], &[weights])
}

#[test]
fn a_learned_ego_drives_by_its_weights() {
    let mut scene = straight_road(91, 4.0, vec![]);
    scene.ego.route = vec![Vec2::ZERO, Vec2::new(300.0, 0.0)];
    let plant = Plant::new(&scene).unwrap();
    let policy = Policy::learned(&cruise()).unwrap();
    let (outcome, trace) = rollout_traced(&plant, &Intervention::default(), &mut *policy.driver()).unwrap();
    assert_eq!(outcome.end, End::Horizon);
    // Throttle tanh(1.6 - 4 v / 20) is zero at 8 m/s.
    assert!((trace.ego.last().unwrap().speed_mps() - 8.0).abs() < 0.3, "{outcome:?}");
}

#[test]
fn a_learned_ego_sees_its_surroundings_and_repeats_itself() {
    let mut stream = Seed(1).stream(&["weights"]);
    let mut draw = |n: usize| (0..n).map(|_| stream.normal(0.0, 0.4)).collect::<Vec<f64>>();
    let layers = [draw(16 * OBSERVATION + 16), draw(ACTION * 16 + ACTION)];
    let policy = Policy::learned(&Network::to_bytes(&[OBSERVATION, 16, ACTION], &layers)).unwrap();
    let run = |count: usize| {
        let plant = Plant::new(&crossing(4, count, 91)).unwrap();
        rollout(&plant, &Intervention::default(), &mut *policy.driver()).unwrap()
    };
    assert_eq!(run(20), run(20));
    assert_ne!(run(20).ego, run(1).ego);
}
