//! The family's signature: experts that a rerun of their training gives again, mixed by one weight that leads from
//! realistic to adversarial.

use std::sync::Arc;

use super::training::{BETA, Levels, Pair, fit, loss, preferences};
use super::*;
use crate::ego;
use crate::families::sources;
use crate::families::tests::{built, worlds};
use crate::kernel::{Seed, num};
use crate::motion::Candidate;
use crate::objects::{FamilyName, ParameterValue};
use crate::stage::Situation;

#[test]
fn training_again_gives_the_committed_experts() {
    let trained = training::experts().unwrap();
    let expected = include_str!("experts.json");
    assert_eq!(
        trained.text(),
        expected,
        "if this is meant, the text on the left belongs into src/generators/families/sage/experts.json"
    );
    assert_eq!(&trained, Experts::committed());
}

/// A situation's marked vehicle with the candidates of an expert.
fn proposed(situation: &Situation, theta: &[f64]) -> Vec<Part> {
    let stage = Stage { situation, seed: Seed(3), counsel: None };
    let (actor, from_step) = (situation.marked().next().unwrap(), situation.first_step());
    let window = Window { from_step, steps: situation.scene.steps - from_step };
    let mut parts = vec![Part { actor, window, candidates: vec![], offsets: None, driven: None, simulated: 0 }];
    propose(&stage, &contract::prior_options(), theta, &mut parts);
    parts
}

fn situations(count: usize) -> Vec<Situation> {
    worlds(count).map(|scene| Situation::new(Arc::new(scene), &ego::Policy::Idm).unwrap()).collect()
}

#[test]
fn an_expert_sees_of_a_candidate_what_full_measuring_sees() {
    let zero = vec![0.0; measure::FEATURES.len()];
    let (mut off_road, mut far) = (0, 0);
    for situation in situations(6) {
        let parts = proposed(&situation, &zero);
        let (actor, from_step) = (parts[0].actor, parts[0].window.from_step);
        let judged = Judged { situation: &situation, actor, from_step, adversaries: &[actor] };
        for candidate in &parts[0].candidates {
            let (bounded, whole) = (Measured::for_expert(candidate, &judged), Measured::of(candidate, &judged));
            assert_eq!(bounded.features().map(f64::to_bits), whole.features().map(f64::to_bits));
            off_road += usize::from(whole.features()[9] > 0.0);
            far += usize::from(bounded != whole);
        }
    }
    assert!(off_road > 20 && far > 20, "{off_road} and {far} candidates: nothing lies where bounds matter");
}

#[test]
fn goals_are_measured_anew_where_anything_that_they_depend_on_differs() {
    let mixed = Experts::committed().mixed(0.5);
    let shipped = contract::prior_options();
    let options = [
        shipped,
        PriorOptions { goal_spacing_m: 1.5 * shipped.goal_spacing_m, ..shipped },
        PriorOptions { profile_step_mps2: 0.5 * shipped.profile_step_mps2, ..shipped },
        PriorOptions { profile_levels: shipped.profile_levels - 1, ..shipped },
    ];
    let scene = Arc::new(worlds(1).next().unwrap());
    let fresh = || Situation::new(scene.clone(), &ego::Policy::Idm).unwrap();
    let of = |situation: &Situation, options: &PriorOptions, (later, shorter): (usize, usize)| {
        let stage = Stage { situation, seed: Seed(3), counsel: None };
        let (actor, from_step) = (situation.marked().next().unwrap(), situation.first_step() + later);
        let window = Window { from_step, steps: situation.scene.steps - from_step - shorter };
        let mut parts = vec![Part { actor, window, candidates: vec![], offsets: None, driven: None, simulated: 0 }];
        propose(&stage, options, &mixed, &mut parts);
        parts.remove(0).candidates
    };
    let shared = fresh();
    for (options, window) in options.iter().flat_map(|options| [(0, 0), (0, 1), (1, 0)].map(|w| (options, w))) {
        let (kept, anew) = (of(&shared, options, window), of(&fresh(), options, window));
        assert_eq!(kept, anew, "{options:?} {window:?}");
    }
}

/// Expected reward parts under the mixed expert, over scenes that training never saw.
fn expected(situations: &[Situation], weight: f64) -> (f64, f64, f64) {
    let mixed = Experts::committed().mixed(weight);
    let (mut adversarial, mut unrealism, mut infeasible) = (0.0, 0.0, 0.0);
    let share = 1.0 / situations.len() as f64;
    for situation in situations {
        let parts = proposed(situation, &mixed);
        let (actor, from_step) = (parts[0].actor, parts[0].window.from_step);
        let judged = Judged { situation, actor, from_step, adversaries: &[actor] };
        for candidate in &parts[0].candidates {
            let (p, measured) = (num::exp(candidate.prior_log_probability), Measured::of(candidate, &judged));
            adversarial += p * measured.adversarial() * share;
            unrealism += p * measured.unrealism() * share;
            infeasible += p * if measured.is_feasible() { 0.0 } else { share };
        }
    }
    (adversarial, unrealism, infeasible)
}

/// The candidate that the reward with even weights chooses among those of an expert: R_adv, and where it ends.
fn chosen(situation: &Situation, theta: &[f64]) -> (f64, crate::kernel::Vec2) {
    let parts = proposed(situation, theta);
    let (actor, from_step) = (parts[0].actor, parts[0].window.from_step);
    let judged = Judged { situation, actor, from_step, adversaries: &[actor] };
    let measured = parts[0].candidates.iter().map(|c| (Measured::of(c, &judged), c));
    let (best, candidate) = measured.max_by(|a, b| a.0.reward(0.5, 0.5).total_cmp(&b.0.reward(0.5, 0.5))).unwrap();
    (best.adversarial(), candidate.samples[candidate.samples.len() - 1].position)
}

#[test]
fn the_experts_decide_and_without_them_the_choice_is_another() {
    let situations = situations(22);
    let zero = vec![0.0; measure::FEATURES.len()];
    let mixed = Experts::committed().mixed(0.5);
    let pairs: Vec<_> = situations.iter().map(|s| (chosen(s, &mixed), chosen(s, &zero))).collect();
    let changed = pairs.iter().filter(|(with, without)| with.1 != without.1).count();
    let with = pairs.iter().map(|pair| pair.0.0).sum::<f64>() / 22.0;
    let without = pairs.iter().map(|pair| pair.1.0).sum::<f64>() / 22.0;
    println!("R_adv of the choice: {with:.3} with the experts, {without:.3} without; {changed} of 22 choices differ");
    assert!(changed >= 8 && with > without, "{changed} {with} {without}");
}

#[test]
fn the_weight_moves_the_mean_candidate_monotonically_from_realistic_to_adversarial() {
    let situations = situations(22);
    let means = [0.0, 0.25, 0.5, 0.75, 1.0].map(|weight| expected(&situations, weight));
    println!("(R_adv, penalties, infeasible) at w = 0, 1/4, 1/2, 3/4, 1: {means:?}");
    for pair in means.windows(2) {
        assert!(pair[1].0 > pair[0].0, "danger: {means:?}");
        // Candidates of the lane-graph prior are all gentle: the dynamic penalties have little room either way.
        assert!((pair[1].1 - pair[0].1).abs() < 0.05, "penalties: {means:?}");
    }
    assert!(means[4].0 > 1.1 * means[0].0 && means[4].2 > means[0].2 + 0.02, "{means:?}");
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
    let pairs = preferences(&[measured, measured, off_road], 10.0, 1.0, &mut stream);
    assert_eq!((pairs.feasibility.len(), pairs.reward.len()), (1, 0));
    let departure = measure::FEATURES.iter().position(|f| *f == "road_departure").unwrap();
    assert!(pairs.feasibility[0][departure] < 0.0);
}
