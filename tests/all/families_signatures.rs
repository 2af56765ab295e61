//! Mechanisms that make the families that choose among candidates those methods: with a toy in the place of one, on the same
//! scenes, what the mechanism is for gets worse.

use std::sync::OnceLock;

use evodrive::compiler::{Compiled, Prepared, Situation};
use evodrive::ego::Policy;
use evodrive::families::sources;
use evodrive::kernel::{Seed, num};
use evodrive::objects::program::MechanismRef;
use evodrive::objects::{FamilyName, MechanismModule, ParameterValue, Program, Setting, ValueType};
use evodrive::search::posterior::NO_CONTACT;
use evodrive::sim::{self, Action, Intervention, Outcome};
use evodrive::synth::WorldKind;

use crate::worlds;

/// Four scenes of every kind of world, prepared once.
fn situations() -> &'static [Situation] {
    static SITUATIONS: OnceLock<Vec<Situation>> = OnceLock::new();
    SITUATIONS.get_or_init(|| worlds::situations(&worlds::options(), 500, 4 * WorldKind::ALL.len()))
}

fn parent(name: &str) -> Program {
    sources().get(&FamilyName::new(name)).unwrap().parent.clone()
}

fn with_number(mut program: Program, name: &str, value: f64) -> Program {
    program.parameters.insert(name.into(), ParameterValue::Number(value));
    program
}

/// Puts an expression in the place of the search's own score.
fn with_score(mut program: Program, slot: &str, expression: &str) -> Program {
    let reads = |name: &&str| expression.contains(*name);
    let inputs = ["prior_log_probability", "collision_likelihood"].iter().filter(|name| reads(name));
    let module = MechanismModule {
        slot: slot.into(),
        inputs: inputs.map(|name| name.to_string()).collect(),
        output: ValueType::Number,
        expression: expression.into(),
        tags: vec![],
    };
    program.mechanism_modules.insert("toy".into(), module);
    let search = program.operator_graph.get_mut("search").unwrap();
    search.settings.insert("score".into(), Setting::Mechanism(MechanismRef { mechanism: "toy".into() }));
    search.settings.insert("combine".into(), Setting::Choice("replace".into()));
    program
}

/// Puts a candidate drawn at random in the place of the best one.
fn drawn_at_random(mut program: Program) -> Program {
    let choice = program.operator_graph.get_mut("choice").unwrap();
    choice.kind = "soft_choice".into();
    choice.settings.insert("temperature".into(), Setting::Number(5.0));
    program
}

/// Returns what a program makes of every scene, and how it ends.
fn played(program: &Program, seed: u64) -> Vec<(Compiled, Outcome)> {
    let sources = sources();
    let prepared = Prepared::new(program, sources.get(&program.source_family).unwrap()).unwrap();
    let play = |situation: &Situation| {
        let compiled = prepared.compile(situation, Seed(seed)).unwrap();
        let driver = &mut *Policy::Idm.driver();
        let outcome = sim::rollout(&situation.plant, &compiled.intervention, driver).unwrap();
        (compiled, outcome)
    };
    situations().iter().map(play).collect()
}

fn contacts(played: &[(Compiled, Outcome)]) -> usize {
    played.iter().filter(|(_, outcome)| outcome.contact.is_some_and(|c| c.adversary)).count()
}

/// Mean of 1 on contact, else exp(−distance / 8 m): SEAL's own label of criticality, as it came out.
fn criticality(played: &[(Compiled, Outcome)]) -> f64 {
    let of = |outcome: &Outcome| match outcome.contact {
        Some(contact) if contact.adversary => 1.0,
        _ => outcome.distance_m_min.map_or(0.0, |d| num::exp(-d / 8.0)),
    };
    played.iter().map(|(_, outcome)| of(outcome)).sum::<f64>() / played.len() as f64
}

/// Mean log P(OV) of the choices in the given scenes.
fn mean_log_prior(played: &[(Compiled, Outcome)], scenes: &[usize]) -> f64 {
    let logs = scenes.iter().flat_map(|k| &played[*k].0.decision.actors).map(|actor| actor.prior_log_probability);
    logs.sum::<f64>() / scenes.len() as f64
}

#[test]
fn cats_largest_posterior_meets_the_ego_more_often_than_any_candidate() {
    let best = contacts(&played(&parent("cat"), 1));
    for seed in 1..4 {
        let uniform = drawn_at_random(with_score(parent("cat"), "candidate_score", "0"));
        let by_chance = contacts(&played(&uniform, seed));
        println!("CAT {best}, a candidate at random {by_chance} of {}", situations().len());
        assert!(best >= by_chance + 4, "{best} {by_chance}");
    }
}

#[test]
fn both_factors_of_cats_posterior_count() {
    let both = played(&parent("cat"), 1);
    let no_collision = played(&with_score(parent("cat"), "candidate_score", "prior_log_probability"), 1);
    let no_prior = played(&with_score(parent("cat"), "candidate_score", "collision_likelihood"), 1);
    // Where no candidate is predicted to meet the ego there is no posterior.
    let is_predicted = |k: &usize| both[*k].0.decision.actors.iter().any(|actor| actor.score > NO_CONTACT);
    let scenes: Vec<usize> = (0..both.len()).filter(is_predicted).collect();
    let found = [&both, &no_collision, &no_prior].map(|p| (contacts(p), mean_log_prior(p, &scenes)));
    println!("(contacts, mean log P(OV)): CAT, without P(Coll), without P(OV): {found:?}, {} scenes", scenes.len());
    assert!(found[0].0 >= found[1].0 + 4, "{found:?}");
    assert!(found[0].1 > found[2].1 + 0.02, "{found:?}");
}

#[test]
fn seals_ranking_finds_more_critical_scenes_than_a_uniform_one() {
    let ranked = criticality(&played(&parent("seal"), 1));
    let uniform = with_score(parent("seal"), "opponent_score", "0");
    let first = criticality(&played(&uniform, 1));
    println!("SEAL {ranked:.3}, all candidates alike {first:.3}");
    assert!(ranked > first + 0.03, "{ranked} {first}");
    for seed in 1..4 {
        let by_chance = criticality(&played(&drawn_at_random(uniform.clone()), seed));
        println!("SEAL {ranked:.3}, a candidate at random {by_chance:.3}");
        assert!(ranked > by_chance + 0.03, "{ranked} {by_chance}");
    }
}

/// Largest distance of a program's adversary from its record, per scene, metres.
fn deviations_m(played: &[(Compiled, Outcome)]) -> Vec<f64> {
    let of = |(situation, (compiled, _)): (&Situation, &(Compiled, Outcome))| {
        let [Action::Follow { track, from_step, samples }] = compiled.intervention.actions.as_slice() else {
            return None;
        };
        let log = &situation.scene.tracks[*track];
        let pairs = samples.iter().enumerate().filter_map(|(k, own)| Some((own, log.at(from_step + k)?)));
        Some(pairs.map(|(own, log)| own.position.distance(log.position)).fold(0.0, f64::max))
    };
    let mut found: Vec<f64> = situations().iter().zip(played).filter_map(of).collect();
    found.sort_by(f64::total_cmp);
    found
}

#[test]
fn ats_offsets_reach_most_of_the_declared_metre_and_bring_the_vehicle_nearer_than_its_record() {
    let attacked = played(&parent("at"), 1);
    let deviations = deviations_m(&attacked);
    let median = deviations[deviations.len() / 2];
    // How near the same vehicle comes as recorded: it follows its own record.
    let as_recorded = |(situation, (compiled, _)): (&Situation, &(Compiled, Outcome))| {
        let [Action::Follow { track, from_step, samples }] = compiled.intervention.actions.as_slice() else {
            return sim::rollout(&situation.plant, &Intervention::default(), &mut *Policy::Idm.driver()).unwrap();
        };
        let log = &situation.scene.tracks[*track];
        let samples = (0..samples.len()).map_while(|k| log.at(from_step + k).copied()).collect();
        let actions = vec![Action::Follow { track: *track, from_step: *from_step, samples }];
        sim::rollout(&situation.plant, &Intervention { actions }, &mut *Policy::Idm.driver()).unwrap()
    };
    let recorded: Vec<Outcome> = situations().iter().zip(&attacked).map(as_recorded).collect();
    let hits = |outcome: &Outcome| outcome.contact.is_some_and(|c| c.adversary);
    let (own, log) = (contacts(&attacked), recorded.iter().filter(|o| hits(o)).count());
    let gap = |outcome: &Outcome| if hits(outcome) { 0.0 } else { outcome.distance_m_min.unwrap_or(200.0).min(50.0) };
    let nearer = attacked.iter().zip(&recorded).map(|((_, own), log)| gap(log) - gap(own)).sum::<f64>();
    println!("AT: median {median:.3} m of {}, {own} contacts for {log}, {nearer:.2} m nearer", deviations.len());
    assert!(median > 0.6 && deviations[deviations.len() - 1] <= 1.0 + 1e-6, "{deviations:?}");
    assert!(own >= log && nearer > 4.0, "{own} {log} {nearer}");
}

#[test]
fn ats_swarm_finds_smaller_losses_than_particles_that_nothing_pulls() {
    // Without its two pulls a swarm draws places at random, as many as AT's.
    let swarm = with_number(parent("at"), "iteration_count", 30.0);
    let random = with_number(with_number(swarm.clone(), "cognitive_pull", 0.0), "social_pull", 0.0);
    let score = |played: &[(Compiled, Outcome)]| {
        played.iter().flat_map(|(c, _)| &c.decision.actors).map(|actor| actor.score).sum::<f64>()
    };
    for seed in 1..4 {
        let (own, toy) = (score(&played(&swarm, seed)), score(&played(&random, seed)));
        println!("AT: loss {:.3}, at random {:.3}", -own, -toy);
        assert!(own > toy, "{own} {toy}");
    }
}
