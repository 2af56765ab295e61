//! Programs of both families on generated and hand-made scenes.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::*;
use crate::adapters::Domain;
use crate::ego;
use crate::families::{grammar, sources};
use crate::kernel::Vec2;
use crate::objects::{
    Counsel, FamilyName, MechanismModule, MechanismRef, ParameterValue, PolicyRule, Setting, Slot, ValueType,
};
use crate::scene::fixture::two_lane_scene;
use crate::sim::{self, Action};
use proptest::prelude::*;

fn family(name: &str) -> Source {
    sources().get(&FamilyName::new(name)).unwrap().clone()
}

fn situation() -> Situation {
    Situation::new(Arc::new(two_lane_scene()), &ego::Policy::Idm).unwrap()
}

fn module(slot: &str, output: ValueType, inputs: &[&str], expression: &str) -> MechanismModule {
    MechanismModule {
        slot: slot.into(),
        inputs: inputs.iter().map(|i| i.to_string()).collect(),
        output,
        expression: expression.into(),
        tags: vec![],
    }
}

fn with_node(
    program: &mut crate::objects::Program,
    name: &str,
    slot: Slot,
    kind: &str,
    input: &[&str],
    settings: Vec<(&str, Setting)>,
) {
    let (_, mut node) = grammar::node(name, slot, kind, input, []);
    node.settings = settings.into_iter().map(|(k, v)| (k.to_string(), v)).collect::<BTreeMap<_, _>>();
    program.operator_graph.insert(name.into(), node);
}

fn built(program: &crate::objects::Program, family: &Source, seed: u64) -> Compiled {
    compile(program, family, &situation(), Seed(seed)).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn both_parents_move_the_marked_vehicle_after_the_history() {
    for name in ["cat", "at"] {
        let family = family(name);
        let compiled = built(&family.parent, &family, 1);
        assert!(compiled.decision.applies, "{name}: {}", compiled.decision.reason);
        let [Action::Follow { track: 0, from_step: 1, samples }] = compiled.intervention.actions.as_slice() else {
            panic!("{name}: {:?}", compiled.intervention)
        };
        assert_eq!(samples.len(), 59, "{name}");
    }
}

#[test]
fn cats_parent_keeps_candidates_of_the_prior_and_takes_the_largest_posterior() {
    let family = family("cat");
    let decision = built(&family.parent, &family, 1).decision;
    assert_eq!(decision.actors[0].candidates, 32);
    // A car 20 m ahead can brake into the ego's way: some candidate meets it.
    assert!(decision.actors[0].score > -100.0, "{decision:?}");
}

#[test]
fn compiling_is_pure() {
    for name in ["cat", "at"] {
        let family = family(name);
        assert_eq!(built(&family.parent, &family, 5), built(&family.parent, &family, 5));
    }
}

#[test]
fn at_stays_within_a_metre_of_the_log() {
    let family = family("at");
    for seed in 0..4 {
        let compiled = built(&family.parent, &family, seed);
        let scene = two_lane_scene();
        for action in &compiled.intervention.actions {
            let Action::Follow { track, from_step, samples } = action else { panic!() };
            for (k, sample) in samples.iter().enumerate() {
                let log = scene.tracks[*track].at(from_step + k).unwrap();
                assert!(sample.position.distance(log.position) <= 1.0 + 1e-9);
            }
            assert_eq!(samples[0].position, scene.tracks[*track].at(*from_step).unwrap().position);
        }
    }
}

#[test]
fn an_expression_ranks_actors_and_several_may_attack() {
    let family = family("cat");
    let mut program = family.parent.clone();
    program
        .mechanism_modules
        .insert("pressure".into(), module("actor_score", ValueType::Number, &["actor_speed_mps"], "actor_speed_mps"));
    let settings = vec![("score", grammar::from_mechanism("pressure")), ("count", Setting::Number(2.0))];
    with_node(&mut program, "actor", Slot::Actor, "ranked_actors", &["select"], settings);
    let compiled = built(&program, &family, 1);
    let tracks: Vec<_> = compiled.decision.actors.iter().map(|a| a.track).collect();
    // The car beside drives 12 m/s, the one ahead 8 m/s.
    assert_eq!(tracks, [1, 0]);
}

#[test]
fn a_guard_removes_candidates_and_says_how_many() {
    let family = family("cat");
    let mut program = family.parent.clone();
    program.mechanism_modules.insert(
        "gentle".into(),
        module("candidate_guard", ValueType::Boolean, &["acceleration_mps2_max"], "acceleration_mps2_max < 1.5"),
    );
    with_node(
        &mut program,
        "gentle",
        Slot::Filter,
        "guard_filter",
        &["search"],
        vec![("guard", grammar::from_mechanism("gentle"))],
    );
    with_node(&mut program, "choice", Slot::Diversity, "best_choice", &["gentle"], vec![]);
    let decision = built(&program, &family, 1).decision;
    let report = &decision.filters[0];
    assert!(report.after < report.before && report.after > 0, "{report:?}");
}

#[test]
fn a_filter_that_refuses_everything_hands_back_its_least_violating_candidate_and_says_so() {
    let family = family("cat");
    let filtered = |gap_m_min: f64| {
        let mut program = family.parent.clone();
        let near = module("candidate_guard", ValueType::Boolean, &["bystander_gap_m_min"], "bystander_gap_m_min < 4");
        program.mechanism_modules.insert("near".into(), near);
        let guard = vec![("guard", grammar::from_mechanism("near"))];
        with_node(&mut program, "near", Slot::Filter, "guard_filter", &["search"], guard);
        let settings = vec![("gap_m_min", Setting::Number(gap_m_min))];
        with_node(&mut program, "apart", Slot::Filter, "bystander_filter", &["near"], settings);
        with_node(&mut program, "choice", Slot::Diversity, "best_choice", &["apart"], vec![]);
        built(&program, &family, 1)
    };
    assert_eq!(filtered(0.0).decision.filters[1].violation, None);
    // The guard keeps those that come near the car beside; none of them stays five metres away.
    let shut = filtered(5.0).decision;
    let report = &shut.filters[1];
    assert!(shut.applies && report.after == 1 && report.before > 1, "{report:?}");
    let widest_m = 5.0 * (1.0 - report.violation.unwrap());
    // It is the least: a bound just below the gap that it says lets a candidate pass, one just above lets none.
    let [below, above] = [widest_m - 1e-6, widest_m + 1e-6].map(|gap_m| filtered(gap_m).decision.filters[1].clone());
    assert!(below.violation.is_none() && below.after >= 1, "{below:?}");
    assert!(above.violation.is_some_and(|by| by < 1e-5), "{above:?}");
}

#[test]
fn what_modules_come_to_is_taken_down_where_somebody_watches_and_no_bit_moves() {
    let family = family("cat");
    let mut program = family.parent.clone();
    let flat = module("candidate_score", ValueType::Number, &["gap_m"], "if(gap_m > -1, 2.5, 0)");
    let ranking = module("actor_score", ValueType::Number, &["gap_m"], "-gap_m");
    program.mechanism_modules = BTreeMap::from([("flat".into(), flat), ("near".into(), ranking)]);
    let search = program.operator_graph.get_mut("search").unwrap();
    search.settings.insert("score".into(), Setting::Mechanism(MechanismRef { mechanism: "flat".into() }));
    let situation = situation();
    let plain = Prepared::new(&program, &family).unwrap();
    let watching = Prepared::new(&program, &family).unwrap().watching();
    let compiled = watching.compile(&situation, Seed(1)).unwrap();
    assert_eq!(plain.compile(&situation, Seed(1)).unwrap(), compiled);
    let values = watching.watched("flat");
    assert!(values.len() >= compiled.decision.actors[0].candidates && values.iter().all(|value| *value == 2.5));
    assert!(watching.watched("near").is_empty(), "no setting refers to it, so it is not asked");
    assert!(plain.watched("flat").is_empty());
}

#[test]
fn a_gate_that_does_not_hold_leaves_the_scene_as_it_was() {
    let family = family("at");
    let mut program = family.parent.clone();
    program
        .mechanism_modules
        .insert("crowd".into(), module("scene_gate", ValueType::Boolean, &["vehicle_count"], "vehicle_count > 50"));
    with_node(
        &mut program,
        "select",
        Slot::Select,
        "gated_scenes",
        &[],
        vec![("gate", grammar::from_mechanism("crowd"))],
    );
    let compiled = built(&program, &family, 1);
    assert!(!compiled.decision.applies && compiled.intervention.actions.is_empty());
    assert_eq!(compiled.decision.reason, "select: the gate does not hold");
}

#[test]
fn a_rule_changes_parameters_where_its_condition_holds() {
    let family = family("cat");
    let mut program = family.parent.clone();
    program.scenario_conditioned_policy.push(PolicyRule {
        name: "short".into(),
        when: "vehicle_count >= 1".into(),
        parameters: BTreeMap::from([("duration_s".into(), ParameterValue::Number(3.0))]),
        operators: BTreeMap::new(),
    });
    let decision = built(&program, &family, 1).decision;
    assert_eq!((decision.mode, decision.actors[0].window.steps), (vec!["short".to_string()], 30));
}

#[test]
fn a_foreign_operator_does_not_compile() {
    let (cat, at) = (family("cat"), family("at"));
    assert!(matches!(
        compile(&at.parent, &cat, &situation(), Seed(1)),
        Err(CompileFailure::Contract(problems)) if !problems.is_empty()
    ));
    assert!(compile(&at.parent, &cat, &situation(), Seed(1)).is_err());
    assert!(compile(&cat.parent, &cat, &situation(), Seed(1)).is_ok());
}

/// A program with every numeric parameter drawn from its range.
fn drawn(family: &Source, shares: &[f64]) -> crate::objects::Program {
    let mut program = family.parent.clone();
    for ((name, spec), share) in family.contract.parameters.iter().zip(shares.iter().cycle()) {
        let value = match &spec.domain {
            Domain::Number { low, high, .. } => low + (high - low) * share,
            Domain::Integer { low, high, .. } => (*low as f64 + (high - low) as f64 * share).round(),
            _ => continue,
        };
        program.parameters.insert(name.clone(), ParameterValue::Number(value));
    }
    program
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_legal_program_compiles_on_any_scene_or_names_a_constraint(
        shares in prop::collection::vec(0.0..1.0f64, 9), seed in 0u64..1000,
        speed in 0.0..30.0f64, turn in -3.0..3.0f64, gap in 3usize..30, laneless in any::<bool>(),
    ) {
        let mut scene = two_lane_scene();
        if laneless {
            scene.road.lanes.clear();
        }
        scene.tracks[0].samples = crate::scene::fixture::straight(60, Vec2::new(30.0, 1.0), turn, speed);
        scene.tracks[0].samples[gap] = None;
        let situation = Situation::new(Arc::new(scene), &ego::Policy::Idm).unwrap();
        for name in ["cat", "at"] {
            let family = family(name);
            let program = drawn(&family, &shares);
            match compile(&program, &family, &situation, Seed(seed)) {
                Ok(compiled) => {
                    let mut driver = ego::Policy::Idm.driver();
                    let outcome = sim::rollout(&situation.plant, &compiled.intervention, driver.as_mut());
                    prop_assert!(outcome.is_ok(), "{:?}", outcome);
                    prop_assert_eq!(compiled.decision.applies, !compiled.intervention.actions.is_empty());
                }
                Err(CompileFailure::Constraint { .. }) => {}
                Err(other) => prop_assert!(false, "{other}"),
            }
        }
    }
}

#[test]
fn on_generated_worlds_both_parents_compile_and_cat_makes_the_ego_crash_more_often() {
    let options = crate::synth::SynthOptions { tracks_per_scene: 24, ..crate::scene::fixture::worlds() };
    let (cat, at) = (family("cat"), family("at"));
    let (mut contacts, mut near) = ([0, 0], 0);
    for index in 0..22 {
        let scene = crate::synth::pool_member(&options, Seed(5), index).unwrap();
        let situation = Situation::new(Arc::new(scene), &ego::Policy::Idm).unwrap();
        for (which, family) in [&cat, &at].into_iter().enumerate() {
            let compiled = compile(&family.parent, family, &situation, Seed(1)).unwrap();
            assert!(compiled.decision.applies, "{}: {}", situation.scene_id(), compiled.decision.reason);
            near += usize::from(which == 0 && compiled.decision.actors[0].score > -100.0);
            let mut driver = ego::Policy::Idm.driver();
            let outcome = sim::rollout(&situation.plant, &compiled.intervention, driver.as_mut()).unwrap();
            contacts[which] += usize::from(outcome.contact.is_some_and(|c| c.adversary));
        }
    }
    println!("of 22: CAT {} contacts ({near} foreseen), AT {}", contacts[0], contacts[1]);
    assert!(contacts[0] >= 3 && contacts[0] > contacts[1], "{contacts:?}");
}

/// Every numeric parameter at the far end of its range, one program each.
fn edits(parent: &crate::objects::Program, family: &Source) -> Vec<crate::objects::Program> {
    let far = |(name, spec): (&String, &crate::adapters::ParameterSpec)| {
        let ParameterValue::Number(now) = parent.parameters.get(name)? else { return None };
        let (low, high) = match spec.domain {
            Domain::Number { low, high, .. } => (low, high),
            Domain::Integer { low, high, .. } => (low as f64, high as f64),
            _ => return None,
        };
        let mut child = parent.clone();
        let value = if now - low > high - now { low } else { high };
        child.parameters.insert(name.clone(), ParameterValue::Number(value));
        Some(child)
    };
    family.contract.parameters.iter().filter_map(far).collect()
}

#[test]
fn programs_that_are_alike_in_effect_compile_alike() {
    let situation = situation();
    let mut edited = 0;
    let searched = Searched::new(64 << 20);
    for name in ["cat", "at", "seal"] {
        let family = family(name);
        let mut parent = family.parent.clone();
        parent.mechanism_modules.insert(
            "quick".into(),
            module(
                "actor_score",
                ValueType::Number,
                &["actor_speed_mps", "duration_s"],
                "actor_speed_mps * duration_s",
            ),
        );
        let settings = vec![("score", grammar::from_mechanism("quick")), ("count", Setting::Number(1.0))];
        with_node(&mut parent, "actor", Slot::Actor, "ranked_actors", &["select"], settings);
        let all = |program: &crate::objects::Program| {
            let prepared = Prepared::new(program, &family).unwrap_or_else(|e| panic!("{name}: {e}"));
            let compiled = prepared.compile(&situation, Seed(1));
            let shared = prepared.clone().sharing(&searched).compile(&situation, Seed(1));
            assert_eq!(
                shared.ok(),
                compiled.as_ref().ok().cloned(),
                "{name}: what another program searched was taken over"
            );
            (prepared.in_effect(&situation.scene_values).unwrap(), compiled)
        };
        let (before, compiled) = all(&parent);
        for child in edits(&parent, &family) {
            let (after, differently) = all(&child);
            assert!(after != before || differently.ok() == compiled.as_ref().ok().cloned(), "{name}");
            edited += usize::from(after != before);
            // The same edit under a rule that does not hold here.
            let mut guarded = parent.clone();
            let (when, parameters) = ("vehicle_count > 1000".into(), child.parameters);
            guarded.scenario_conditioned_policy =
                vec![PolicyRule { name: "crowd".into(), when, parameters, operators: BTreeMap::new() }];
            let (after, alike) = all(&guarded);
            assert_eq!((after, alike.ok()), (before, compiled.as_ref().ok().cloned()), "{name}");
        }
    }
    assert!(edited > 20, "{edited}");
}

#[test]
fn a_kept_search_is_that_of_its_scene_its_ego_its_seed_and_its_counsel() {
    let searched = Searched::new(64 << 20);
    let called = |id: &str, ahead_m: f64, policy: &ego::Policy| {
        let mut scene = two_lane_scene();
        scene.id = id.into();
        scene.tracks[0].samples = crate::scene::fixture::straight(60, Vec2::new(ahead_m, 0.0), 0.0, 8.0);
        Situation::new(Arc::new(scene), policy).unwrap()
    };
    let under = |ahead_m: f64, policy: &ego::Policy| called("usual", ahead_m, policy);
    let usual = under(20.0, &ego::Policy::Idm);
    let twin = called("twin", 20.0, &ego::Policy::Idm);
    assert_eq!(twin.digest(), usual.digest(), "one content under two ids");
    for name in ["at", "llm_attacker"] {
        let family = family(name);
        let prepared = Prepared::new(&family.parent, &family).unwrap();
        let commanded = |situation: &Situation, seed: u64, counsel: Option<&Counsel>| {
            let compiled = |prepared: &Prepared<'_>| prepared.compile_counselled(situation, Seed(seed), counsel).ok();
            let alone = compiled(&prepared);
            assert_eq!(compiled(&prepared.clone().sharing(&searched)), alone, "{name}");
            alone.expect("a motion").intervention
        };
        let advised = [0, 1].map(|track| Counsel { attackers: vec![track], ..Counsel::default() });
        let before = commanded(&usual, 1, Some(&advised[0]));
        assert_ne!(commanded(&under(24.0, &ego::Policy::Idm), 1, Some(&advised[0])), before, "{name}: another scene");
        if name == "at" {
            assert_ne!(commanded(&usual, 2, Some(&advised[0])), before, "other draws");
            // Random streams are named by the scene's id, so that the first of two twins must not decide for both.
            assert_ne!(commanded(&twin, 1, Some(&advised[0])), before, "another id");
            assert_ne!(commanded(&under(20.0, &ego::Policy::Replay), 1, Some(&advised[0])), before, "another ego");
        } else {
            assert_ne!(commanded(&usual, 1, Some(&advised[1])), before, "another counsel");
        }
    }
}

#[test]
fn a_rule_takes_effect_where_it_holds_and_a_parameter_where_it_is_read() {
    let family = family("cat");
    let effect = |program: &crate::objects::Program| {
        Prepared::new(program, &family).unwrap().in_effect(&situation().scene_values).unwrap()
    };
    let with_rule = |when: &str| {
        let mut program = family.parent.clone();
        let parameters = BTreeMap::from([("duration_s".to_string(), ParameterValue::Number(2.0))]);
        program.scenario_conditioned_policy =
            vec![PolicyRule { name: "short".into(), when: when.into(), parameters, operators: BTreeMap::new() }];
        effect(&program)
    };
    let before = effect(&family.parent);
    assert_eq!(with_rule("vehicle_count > 1000"), before);
    assert_ne!(with_rule("vehicle_count > 0"), before);
    let reading = |expression: &str, cost: f64| {
        let mut program = family.parent.clone();
        let reads: Vec<&str> =
            ["actor_speed_mps", "lane_change_cost"].into_iter().filter(|name| expression.contains(name)).collect();
        program.mechanism_modules.insert("rank".into(), module("actor_score", ValueType::Number, &reads, expression));
        let settings = vec![("score", grammar::from_mechanism("rank")), ("count", Setting::Number(1.0))];
        with_node(&mut program, "actor", Slot::Actor, "ranked_actors", &["select"], settings);
        program.parameters.insert("lane_change_cost".into(), ParameterValue::Number(cost));
        // Nothing but the expression is left to read the parameter.
        let fixed = BTreeMap::from([("lane_change_cost".to_string(), Setting::Number(0.5))]);
        program.scenario_conditioned_policy = vec![PolicyRule {
            name: "fixed".into(),
            when: "vehicle_count > 0".into(),
            parameters: BTreeMap::new(),
            operators: BTreeMap::from([("motion".to_string(), fixed)]),
        }];
        effect(&program)
    };
    assert_eq!(reading("actor_speed_mps", 2.0), reading("actor_speed_mps", 3.0), "nothing reads it");
    assert_ne!(reading("actor_speed_mps * lane_change_cost", 2.0), reading("actor_speed_mps * lane_change_cost", 3.0));
    assert_ne!(reading("actor_speed_mps", 2.0), reading("-actor_speed_mps", 2.0));
}
