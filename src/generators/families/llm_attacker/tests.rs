//! The family's signature: the identity of the attackers is searched with feedback from the driver.

use std::sync::Arc;

use super::promise::WEIGHTS;
use super::*;
use crate::ego;
use crate::families::sources;
use crate::families::tests::{built, worlds};
use crate::kernel::{Seed, num};
use crate::objects::counsel::Vehicle;
use crate::objects::{Counsel, FamilyName, MechanismModule, MechanismRef, ParameterValue, Program, Setting, ValueType};
use crate::sim;
use crate::stage::Situation;

fn parent(rounds: f64) -> (crate::stage::Source, Program) {
    let family = sources().get(&FamilyName::new(NAME)).unwrap().clone();
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

/// A scene in which several vehicles may attack, with the table that a model is shown.
fn counselled() -> (Situation, Vec<Vehicle>) {
    let (family, program) = parent(0.0);
    let meeting = worlds(22).find_map(|scene| {
        let situation = Situation::new(Arc::new(scene), &ego::Policy::Idm).unwrap();
        let stage = Stage { situation: &situation, seed: Seed(1), counsel: None };
        let vehicles = counsel::vehicles(&stage, &program, 8).unwrap();
        // The last of the table can still attack.
        let last = Counsel { attackers: vec![vehicles.last()?.track], ..Counsel::default() };
        let attacks = decided(&family, &program, &situation, Some(&last)) == last.attackers;
        (vehicles.len() >= 4 && attacks).then_some((situation, vehicles))
    });
    meeting.unwrap()
}

/// Returns the attackers.
fn decided(
    family: &crate::stage::Source,
    program: &Program,
    situation: &Situation,
    counsel: Option<&Counsel>,
) -> Vec<TrackIx> {
    let prepared = crate::compiler::Prepared::new(program, family).unwrap();
    let compiled = prepared.compile_counselled(situation, Seed(1), counsel).unwrap();
    compiled.decision.actors.iter().map(|actor| actor.track).collect()
}

#[test]
fn counsel_changes_who_attacks_and_without_it_the_rules_decide() {
    let (situation, vehicles) = counselled();
    let (family, program) = parent(0.0);
    let by_rule = decided(&family, &program, &situation, None);
    assert_eq!(by_rule.len(), 1);
    let others: Vec<TrackIx> = vehicles.iter().map(|v| v.track).filter(|track| *track != by_rule[0]).collect();
    let advised = Counsel { attackers: vec![*others.last().unwrap()], ..Counsel::default() };
    assert_eq!(decided(&family, &program, &situation, Some(&advised)), advised.attackers);
    assert_eq!(decided(&family, &program, &situation, Some(&Counsel::default())), by_rule, "nobody is advised");
    let mut deaf = program.clone();
    deaf.parameters.insert(COUNSEL_WEIGHT.into(), ParameterValue::Number(0.0));
    assert_eq!(decided(&family, &deaf, &situation, Some(&advised)), by_rule, "a program may ignore counsel");
}

#[test]
fn expressions_may_read_who_was_advised() {
    let (situation, vehicles) = counselled();
    let (family, mut program) = parent(0.0);
    let advised = Counsel { attackers: vec![vehicles.last().unwrap().track], ..Counsel::default() };
    program.parameters.insert(COUNSEL_WEIGHT.into(), ParameterValue::Number(0.0));
    program.mechanism_modules.insert(
        "advised_only".into(),
        MechanismModule {
            slot: "attacker_guard".into(),
            inputs: vec![COUNSEL_RANK.into()],
            output: ValueType::Boolean,
            expression: format!("{COUNSEL_RANK} > 0"),
            tags: vec![],
        },
    );
    let guard = Setting::Mechanism(MechanismRef { mechanism: "advised_only".into() });
    program.operator_graph.get_mut("actor").unwrap().settings.insert("guard".into(), guard);
    assert_eq!(decided(&family, &program, &situation, Some(&advised)), advised.attackers);
    assert!(decided(&family, &program, &situation, None).is_empty(), "nobody is advised, so nobody is eligible");
}

#[test]
fn a_proposal_is_carried_out_by_exactly_its_attackers_whatever_the_parent_weighs() {
    let (family, mut program) = parent(3.0);
    for name in WEIGHTS.into_iter().chain(["reach_weight"]) {
        program.parameters.insert(name.into(), ParameterValue::Number(4.0));
    }
    let blind = counsel::blind(&program);
    let mut several = 0;
    for scene in worlds(11) {
        let situation = Situation::new(Arc::new(scene), &ego::Policy::Idm).unwrap();
        let stage = Stage { situation: &situation, seed: Seed(1), counsel: None };
        let vehicles = counsel::vehicles(&stage, &program, 8).unwrap();
        let pair =
            Counsel { attackers: vehicles.iter().rev().take(2).map(|v| v.track).collect(), ..Counsel::default() };
        let prepared = crate::compiler::Prepared::new(&blind, &family).unwrap();
        // What breaks a constraint is refused with its reason.
        let Ok(compiled) = prepared.compile_counselled(&situation, Seed(1), Some(&pair)) else { continue };
        let mut attackers: Vec<TrackIx> = compiled.decision.actors.iter().map(|actor| actor.track).collect();
        let mut wanted = pair.attackers.clone();
        attackers.sort_unstable();
        wanted.sort_unstable();
        assert!(attackers.iter().all(|track| wanted.contains(track)), "{attackers:?} of {wanted:?}");
        several += usize::from(attackers == wanted);
    }
    assert!(several >= 5, "{several} of 11 pairs attacked together");
}

#[test]
fn the_table_stands_in_the_order_of_the_rules_and_is_bounded() {
    let (situation, vehicles) = counselled();
    let stage = Stage { situation: &situation, seed: Seed(1), counsel: None };
    let (_, program) = parent(0.0);
    let few = counsel::vehicles(&stage, &program, 2).unwrap();
    assert_eq!(few.len(), 2);
    let mut weightless = program.clone();
    for name in WEIGHTS {
        weightless.parameters.insert(name.into(), ParameterValue::Number(0.0));
    }
    let by_reach: Vec<bool> =
        counsel::vehicles(&stage, &weightless, 8).unwrap().iter().map(|vehicle| vehicle.reach).collect();
    assert!(by_reach.windows(2).all(|pair| pair[0] >= pair[1]), "who reaches the ego comes first: {by_reach:?}");
    assert!(vehicles.iter().all(|vehicle| situation.scene.tracks[vehicle.track].id == vehicle.id));
}

fn vocabulary_place(name: &str) -> usize {
    crate::adapters::vocabulary::ACTOR.iter().position(|feature| feature.name == name).unwrap()
}
