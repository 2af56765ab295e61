//! The family's signature: the identity of the attackers is searched with feedback from the driver.

use std::sync::Arc;

use super::*;
use crate::baselines::registry;
use crate::baselines::tests::{built, worlds};
use crate::ego;
use crate::objects::{FamilyName, ParameterValue, Program};
use crate::sim;

fn parent(rounds: f64) -> (crate::adapters::Family, Program) {
    let family = registry().get(&FamilyName::new(NAME)).unwrap().clone();
    let mut program = family.parent.clone();
    program.parameters.insert("reflection_rounds".into(), ParameterValue::Number(rounds));
    (family, program)
}

/// Per scene: the attackers, and whether one of them meets the ego.
fn attacks(rounds: f64) -> Vec<(Vec<TrackIx>, bool)> {
    let (family, program) = parent(rounds);
    let attack = |scene| {
        let situation = Situation::new(Arc::new(scene), &ego::Policy::Idm).unwrap();
        let compiled = built(&family, &program, &situation);
        let outcome =
            sim::rollout(&situation.plant, &compiled.intervention, ego::Policy::Idm.driver().as_mut()).unwrap();
        let tracks = compiled.decision.actors.iter().map(|actor| actor.track).collect();
        (tracks, outcome.contact.is_some_and(|contact| contact.adversary))
    };
    worlds(22).map(attack).collect()
}

#[test]
fn feedback_changes_who_attacks_and_never_loses_an_attack_that_worked() {
    let (blind, deliberate) = (attacks(0.0), attacks(3.0));
    let others = blind.iter().zip(&deliberate).filter(|(a, b)| a.0 != b.0).count();
    let several = deliberate.iter().filter(|(tracks, _)| tracks.len() > 1).count();
    let hits = |attacks: &[(Vec<TrackIx>, bool)]| attacks.iter().filter(|(_, hit)| *hit).count();
    println!("of 22: hits {} -> {}, {others} other sets, {several} with two", hits(&blind), hits(&deliberate));
    assert!(blind.iter().zip(&deliberate).all(|(a, b)| !a.1 || b.1), "what worked is kept");
    assert!(hits(&deliberate) > hits(&blind), "feedback finds attacks that the first proposal misses");
    assert!(others > 0, "the attackers are searched, not only their trajectories");
}

#[test]
fn the_first_proposal_by_hand() {
    let facts = |values: &[(&str, f64)]| {
        let mut facts = ActorFacts::of_guest();
        for (name, value) in values {
            let place = vocabulary_place(name);
            facts.values[place] = *value;
        }
        facts
    };
    let weights = [1.0, 0.7, 0.5, 0.3, 0.5];
    let ahead = facts(&[("gap_m", 20.0), ("closing_speed_mps", 5.0), ("same_lane", 1.0), ("paths_cross", 1.0)]);
    let by_hand = num::exp(-4.0 / 3.0) + 0.7 * num::exp(-1.0) + 0.5 + 0.3;
    assert!((promise(&ahead, &weights) - by_hand).abs() < 1e-12);
    let behind = facts(&[("gap_m", 20.0), ("behind", 1.0)]);
    assert!((promise(&behind, &weights) - (0.7 * num::exp(-1.0) - 0.5)).abs() < 1e-12);
}

fn vocabulary_place(name: &str) -> usize {
    crate::adapters::vocabulary::ACTOR.iter().position(|feature| feature.name == name).unwrap()
}
