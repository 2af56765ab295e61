//! The family's signature: experts that a rerun of their training gives again, mixed by one weight that leads from
//! realistic to adversarial.

use std::sync::Arc;

use super::training::{BETA, Levels, Pair, fit, loss, preferences};
use super::*;
use crate::ego;
use crate::families::sources;
use crate::families::tests::{built, worlds};
use crate::kernel::{Seed, num};
use crate::motion::motion_prior;
use crate::objects::{FamilyName, ParameterValue};
use crate::stage::Situation;

#[test]
fn training_again_gives_the_committed_experts() {
    let trained = training::experts().unwrap();
    let expected = include_str!("experts.json");
    assert_eq!(
        trained.text(),
        expected,
        "if this is meant, the text on the left belongs into src/families/sage/experts.json"
    );
    assert_eq!(&trained, Experts::committed());
}

/// Expected reward parts under the mixed expert, over scenes that training never saw.
fn expected(weight: f64) -> (f64, f64, f64) {
    let mixed = Experts::committed().mixed(weight);
    let (mut adversarial, mut unrealism, mut infeasible) = (0.0, 0.0, 0.0);
    for scene in worlds(22) {
        let situation = Situation::new(Arc::new(scene), &ego::Policy::Idm).unwrap();
        let (actor, from_step) = (situation.marked().next().unwrap(), situation.first_step());
        let anchor = situation.track(actor).at(from_step - 1).unwrap();
        let mut stream = Seed(3).stream(&["prior", situation.scene_id()]);
        let options = contract::prior_options();
        let mut candidates = motion_prior::candidates(&situation.lanes, anchor, 80, &options, &mut stream);
        let judged = Judged { situation: &situation, actor, from_step, adversaries: &[actor] };
        reweigh(&mut candidates, &judged, &mixed);
        for candidate in &candidates {
            let (p, measured) = (num::exp(candidate.prior_log_probability), Measured::of(candidate, &judged));
            adversarial += p * measured.adversarial() / 22.0;
            unrealism += p * measured.unrealism() / 22.0;
            infeasible += p * if measured.is_feasible() { 0.0 } else { 1.0 / 22.0 };
        }
    }
    (adversarial, unrealism, infeasible)
}

#[test]
fn the_weight_moves_the_mean_candidate_monotonically_from_realistic_to_adversarial() {
    let means = [0.0, 0.25, 0.5, 0.75, 1.0].map(expected);
    println!("(R_adv, penalties, infeasible) at w = 0, 1/4, 1/2, 3/4, 1: {means:?}");
    for pair in means.windows(2) {
        assert!(pair[1].0 > pair[0].0, "danger: {means:?}");
        assert!(pair[1].2 > pair[0].2, "share that violates the map: {means:?}");
        // Candidates of the lane-graph prior are all gentle: the dynamic penalties have little room either way.
        assert!((pair[1].1 - pair[0].1).abs() < 0.02, "penalties: {means:?}");
    }
    assert!(means[4].0 > 1.1 * means[0].0 && means[4].2 > means[0].2 + 0.05, "{means:?}");
}

#[test]
fn a_program_that_follows_the_weight_attacks_more_with_it() {
    let family = sources().get(&FamilyName::new(NAME)).unwrap().clone();
    let attacks = |weight: f64| {
        let mut program = family.parent.clone();
        program.parameters.insert("preference_weight".into(), ParameterValue::Number(weight));
        let near = worlds(22).filter(|scene| {
            let situation = Situation::new(Arc::new(scene.clone()), &ego::Policy::Idm).unwrap();
            let compiled = built(&family, &program, &situation);
            let mut driver = ego::Policy::Idm.driver();
            let outcome = crate::sim::rollout(&situation.plant, &compiled.intervention, driver.as_mut()).unwrap();
            outcome.contact.is_some_and(|c| c.adversary)
        });
        near.count()
    };
    let contacts = [attacks(0.0), attacks(0.5), attacks(1.0)];
    println!("contacts of 22 at w = 0, 1/2, 1: {contacts:?}");
    assert!(contacts[0] <= contacts[1] && contacts[1] <= contacts[2] && contacts[0] < contacts[2], "{contacts:?}");
}

#[test]
fn the_loss_by_hand_and_its_gradient_by_differences() {
    let mut pairs: Vec<Pair> = vec![[0.0; 10], [0.0; 10]];
    (pairs[0][0], pairs[1][1]) = (1.0, -2.0);
    let theta = [4.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let by_hand = 0.5 * (num::ln(1.0 + num::exp(-BETA * 4.0)) + num::ln(1.0 + num::exp(BETA * 6.0)));
    let (value, gradient) = loss(&theta, &pairs);
    assert!((value - by_hand).abs() < 1e-15);
    for k in 0..2 {
        let mut moved = theta;
        moved[k] += 1e-5;
        let slope = (loss(&moved, &pairs).0 - value) / 1e-5;
        assert!((slope - gradient[k]).abs() < 1e-6);
    }
}

#[test]
fn training_lowers_the_loss_and_orders_its_pairs() {
    let mut pairs: Vec<Pair> = vec![[0.0; 10], [0.0; 10]];
    (pairs[0][0], pairs[1][1]) = (1.0, -1.0);
    let theta = fit(&Levels { feasibility: vec![pairs[0]], reward: vec![pairs[1]] });
    assert!(theta[0] > 1.0 && theta[1] < -1.0 && theta[2] == 0.0, "{theta:?}");
    assert!(loss(&theta, &pairs).0 < loss(&[0.0; 10], &pairs).0);
}

#[test]
fn every_infeasible_candidate_loses_first_and_equal_rewards_make_no_pair() {
    let (situation, compiled) = crate::families::tests::compiled(NAME, crate::scene::fixture::two_lane_scene());
    let crate::sim::Action::Follow { samples, .. } = &compiled.intervention.actions[0] else { panic!() };
    let judged = Judged { situation: &situation, actor: 0, from_step: 1, adversaries: &[0] };
    let measured = Measured::of(&Candidate::new(samples.clone(), 0.0), &judged);
    let aside: Vec<_> = samples
        .iter()
        .map(|s| crate::scene::Sample { position: s.position + crate::kernel::Vec2::new(0.0, -30.0), ..*s })
        .collect();
    let off_road = Measured::of(&Candidate::new(aside, 0.0), &judged);
    assert!(measured.is_feasible() && !off_road.is_feasible());
    let mut stream = Seed(1).stream(&["pairs"]);
    let pairs = preferences(&[measured, measured, off_road], (10.0, 1.0), &mut stream);
    assert_eq!((pairs.feasibility.len(), pairs.reward.len()), (1, 0));
    let departure = measure::FEATURES.iter().position(|f| *f == "road_departure").unwrap();
    assert!(pairs.feasibility[0][departure] < 0.0);
}
