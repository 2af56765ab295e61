//! Features that make KING and STRIVE those methods, on generated worlds; and that any legal program of any family compiles on
//! any legal scene or names the constraint that failed.

use std::sync::{Arc, OnceLock};

use evodrive::adapters::Domain;
use evodrive::compiler::{ActorDecision, CompileFailure, Compiled, Situation, compile};
use evodrive::ego::Policy;
use evodrive::families::king::expert;
use evodrive::families::king::loss::{Attraction, Loss};
use evodrive::families::strive::solution::{Solution, Solver, exists};
use evodrive::families::{king, sources, strive};
use evodrive::kernel::{Seed, Vec2};
use evodrive::objects::{FamilyName, ParameterValue, Program, Setting, Slot};
use evodrive::scene::Sample;
use evodrive::search::adam::Rates;
use evodrive::search::descent::{Descent, Iterate, Mover, Slopes, at_record, covered, descend};
use evodrive::search::ranking::is_met;
use evodrive::sim::{self, Action};
use evodrive::synth::{SynthOptions, WorldKind};
use evodrive::{
    motion::Window,
    stage::{Bystanders, EgoPath, Part, Settings, Source, Stage},
};
use proptest::prelude::*;

use crate::worlds;

fn family(name: &str) -> Source {
    sources().get(&FamilyName::new(name)).unwrap().clone()
}

/// Two scenes of every kind of world, prepared once.
fn situations() -> &'static [Situation] {
    static SITUATIONS: OnceLock<Vec<Situation>> = OnceLock::new();
    SITUATIONS.get_or_init(|| {
        let options = SynthOptions { interaction_time_s_max: 4.0, following_share: 0.2, ..worlds::options() };
        worlds::situations(&options, 11, 2 * WorldKind::ALL.len())
    })
}

fn parent_compiled(name: &str, situation: &Situation) -> Compiled {
    let family = family(name);
    compile(&family.parent, &family, situation, Seed(1)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// The parts of a parent program once its motion operator has run.
fn opened(name: &str, situation: &Situation) -> Vec<Part> {
    let decision = parent_compiled(name, situation).decision;
    let mut settings = Settings::default();
    let parent = family(name).parent;
    let numbers = parent.parameters.iter().filter_map(|(k, v)| match v {
        ParameterValue::Number(x) => Some((k.clone(), *x)),
        ParameterValue::Choice(_) => None,
    });
    settings.numbers.extend(numbers);
    let part = |a: &ActorDecision| Part {
        actor: a.track,
        window: Window { from_step: a.window.from_step, steps: a.window.steps },
        candidates: vec![],
        offsets: None,
        driven: None,
        simulated: 0,
    };
    let mut parts: Vec<Part> = decision.actors.iter().map(part).collect();
    let stage = Stage { situation, seed: Seed(1), counsel: None };
    let run = if name == king::NAME { king::motion } else { strive::motion };
    run(&stage, &settings, &mut parts).unwrap();
    parts.retain(|part| part.driven.is_some());
    parts
}

fn contact(situation: &Situation, compiled: &Compiled) -> bool {
    let outcome = sim::rollout(&situation.plant, &compiled.intervention, Policy::Idm.driver().as_mut()).unwrap();
    outcome.contact.is_some_and(|c| c.adversary)
}

fn bystanders(situation: &Situation, parts: &[Part]) -> Bystanders {
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    Bystanders::of(situation, &adversaries, covered(&at_record(situation, parts)))
}

fn kings_loss<'a>(situation: &'a Situation, parts: &[Part], bystanders: &'a Bystanders) -> Loss<'a> {
    Loss {
        pursuit: Attraction::Nearest,
        pursuer_weights: vec![1.0; parts.len()],
        attraction_weight: 1.0,
        departure_weight: 23.0,
        departure_sigma_m: 1.0,
        repulsion_weight: 5.0,
        repulsion_m_max: 1.25,
        bystander_weight: 5.0,
        bystanders,
        field: situation.road_field(),
        off_road_m_max: vec![f64::INFINITY; parts.len()],
        overlapping_at_record: true,
    }
}

/// KING's search with its own step length against an ego that does not answer: its undisturbed rollout.
fn kings_descent(situation: &Situation, parts: &[Part], iterations: usize) -> Vec<Iterate> {
    let rates = Rates { rate: 0.005, first_decay: 0.8, second_decay: 0.99 };
    let descent = Descent { iterations, refinements: 0, rates, replay_every: 1000 };
    let bystanders = bystanders(situation, parts);
    let loss = kings_loss(situation, parts, &bystanders);
    descend(situation, parts, &descent, &|movers: &[Mover], _: &EgoPath, slopes: &mut Slopes| {
        loss.of(movers, &situation.ego, slopes)
    })
}

#[test]
fn kings_loss_falls_in_every_scene() {
    let mut shares = Vec::new();
    for situation in situations() {
        let parts = opened("king", situation);
        let iterates = kings_descent(situation, &parts, 60);
        // The record itself meets the ego: nothing is left to search.
        if iterates.len() == 1 {
            continue;
        }
        let first = iterates[0].terms.total();
        let least = iterates.iter().map(|i| i.terms.total()).fold(f64::INFINITY, f64::min);
        println!("{}: {first:.3} to {least:.3}", situation.scene_id());
        assert!(least < first, "{}: {first} to {least}", situation.scene_id());
        shares.push((first - least) / first.abs().max(1.0));
    }
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    assert!(shares.len() >= 15 && mean > 0.1, "{mean} over {}", shares.len());
}

#[test]
fn king_uses_a_contact_that_a_rule_expert_could_have_avoided_and_that_nothing_broke_off() {
    let mut met = 0;
    for situation in situations() {
        let compiled = parent_compiled("king", situation);
        if !compiled.decision.actors.iter().any(|actor| is_met(actor.score)) {
            continue;
        }
        met += 1;
        assert!(contact(situation, &compiled), "{}", situation.scene_id());
        let parts = opened("king", situation);
        let bystanders = bystanders(situation, &parts);
        let movers = followed(situation, &parts, &compiled);
        assert!(expert::solves(situation, &movers, &bystanders), "{}", situation.scene_id());
    }
    assert!(met >= 5, "{met} of {}", situations().len());
}

/// A parent with some numbers changed.
fn edited(name: &str, numbers: &[(&str, f64)]) -> Program {
    let mut program = family(name).parent;
    for (parameter, value) in numbers {
        program.parameters.insert((*parameter).into(), ParameterValue::Number(*value));
    }
    program
}

fn compiled(program: &Program, situation: &Situation) -> Compiled {
    let family = family(program.source_family.as_str());
    compile(program, &family, situation, Seed(1)).unwrap_or_else(|e| panic!("{e}"))
}

/// Actor, its samples and its recorded samples at the same steps.
fn driven<'a>(situation: &'a Situation, compiled: &'a Compiled) -> Vec<(usize, Vec<(&'a Sample, &'a Sample)>)> {
    let of = |action: &'a Action| match action {
        Action::Follow { track, from_step, samples } => {
            let log = &situation.scene.tracks[*track];
            let pairs = samples.iter().enumerate().filter_map(|(k, own)| Some((own, log.at(from_step + k)?)));
            Some((*track, pairs.collect()))
        }
        _ => None,
    };
    compiled.intervention.actions.iter().filter_map(of).collect()
}

#[test]
fn kings_costs_of_road_and_bystanders_bind() {
    // Off the road and into bystanders before the rollout ends, with the costs and without.
    let mut sums = [(0.0, 0); 2];
    for situation in situations() {
        let programs = [edited("king", &[]), edited("king", &[("departure_weight", 0.0), ("bystander_weight", 0.0)])];
        for (sum, program) in sums.iter_mut().zip(&programs) {
            let intervention = compiled(program, situation).intervention;
            let driver = &mut *Policy::Idm.driver();
            let outcome = sim::rollout(&situation.plant, &intervention, driver).unwrap();
            for adversary in &outcome.adversaries {
                *sum = (sum.0 + adversary.simulated.off_road_m, sum.1 + usize::from(adversary.struck_bystander));
            }
        }
    }
    println!("(metres off the road, adversaries that strike a bystander) with KING's costs and without: {sums:?}");
    assert!(sums[0].0 <= sums[1].0 && sums[0].1 < sums[1].1, "{sums:?}");
}

#[test]
fn kings_gradient_reaches_smaller_losses_than_actions_drawn_at_random_with_the_same_budget() {
    let iterations = 60;
    // The distance that Adam's steps can reach together.
    let spread = 0.005 * iterations as f64;
    let prepared: Vec<(&Situation, Vec<Part>)> =
        situations().iter().take(WorldKind::ALL.len()).map(|s| (s, opened("king", s))).collect();
    let least = |losses: &mut dyn Iterator<Item = f64>| losses.fold(f64::INFINITY, f64::min);
    let descended: f64 = prepared
        .iter()
        .map(|(s, parts)| least(&mut kings_descent(s, parts, iterations).iter().map(|i| i.terms.total())))
        .sum();
    for seed in 0..3 {
        let drawn: f64 = prepared
            .iter()
            .map(|(situation, parts)| {
                let bystanders = bystanders(situation, parts);
                let loss = kings_loss(situation, parts, &bystanders);
                let mut stream = Seed(seed).stream(&["random actions", situation.scene_id()]);
                let mut at = |part: &Part| {
                    let space = part.driven.as_deref().unwrap();
                    let place = space.start().iter().map(|x| x + stream.uniform(-spread, spread)).collect();
                    Mover::new(situation, part, space, place)
                };
                least(&mut (0..=iterations).map(|_| {
                    let movers: Vec<Mover> = parts.iter().map(&mut at).collect();
                    loss.of(&movers, &situation.ego, &mut Slopes::of(&movers))
                }))
            })
            .sum();
        println!("KING's loss over {} scenes: {descended:.2} by slope, {drawn:.2} by chance", prepared.len());
        assert!(descended < drawn - 1.0, "{descended} {drawn}");
    }
}

/// Largest rate at which an adversary departs from its record, m/s, mean over the adversaries.
fn departure_speed_mps(situation: &Situation, compiled: &Compiled) -> f64 {
    let of = |pairs: &[(&Sample, &Sample)]| {
        let away: Vec<f64> = pairs.iter().map(|(own, log)| own.position.distance(log.position)).collect();
        away.windows(6).map(|w| (w[5] - w[0]) / 0.5).fold(0.0, f64::max)
    };
    let all = driven(situation, compiled);
    all.iter().map(|(_, pairs)| of(pairs)).sum::<f64>() / all.len().max(1) as f64
}

#[test]
fn strives_likelihood_binds() {
    let weights = |factor: f64| {
        edited("strive", &[("attacker_prior_weight", 0.005 * factor), ("bystander_prior_weight", factor)])
    };
    // The toy: nothing holds a vehicle to what is likely.
    let names =
        ["attacker_prior_weight", "bystander_prior_weight", "attacker_record_weight", "bystander_record_weight"];
    let programs = [edited("strive", &names.map(|name| (name, 0.0))), weights(1.0), weights(20.0)];
    let (mut changed, mut scenes) = (0, 0);
    let (mut speeds, mut logs) = ([0.0; 3], [0.0; 3]);
    for situation in situations() {
        let results: Vec<Compiled> = programs.iter().map(|program| compiled(program, situation)).collect();
        if results.iter().any(|result| !result.decision.applies) {
            continue;
        }
        scenes += 1;
        changed += usize::from(results[1].intervention != results[2].intervention);
        for (k, result) in results.iter().enumerate() {
            speeds[k] += departure_speed_mps(situation, result);
            logs[k] += result.decision.actors.iter().map(|a| a.prior_log_probability).sum::<f64>();
        }
    }
    println!("STRIVE without, at 1 and at 20 times the weight: {speeds:?} m/s, log p {logs:?}, {changed} of {scenes}");
    assert!(scenes >= 15 && changed * 2 > scenes, "{changed} of {scenes}");
    assert!((0..2).all(|k| speeds[2] < speeds[k] && logs[2] > logs[k]), "{speeds:?} {logs:?}");
}

#[test]
fn several_adversaries_take_their_motions_from_one_iterate() {
    for name in ["king", "strive"] {
        let mut several = 0;
        for situation in situations() {
            let decision = parent_compiled(name, situation).decision;
            several += usize::from(decision.actors.len() > 1);
            assert!(decision.actors.windows(2).all(|two| two[0].score == two[1].score), "{name}: {decision:?}");
        }
        assert!(several > 5, "{name}: {several}");
    }
}

#[test]
fn what_strive_keeps_the_ego_could_have_avoided() {
    let rates = Rates { rate: 0.15, first_decay: 0.9, second_decay: 0.999 };
    let solution = Solution { iterations: 25, rates, buffer_m: 0.5 };
    let (mut met, mut kept) = (0, 0);
    for situation in situations() {
        let compiled = parent_compiled("strive", situation);
        if !contact(situation, &compiled) {
            continue;
        }
        met += 1;
        let parts = opened("strive", situation);
        let others = bystanders(situation, &parts);
        let movers = followed(situation, &parts, &compiled);
        kept += usize::from(exists(situation, &movers, &others, &solution));
    }
    println!("STRIVE: {met} contacts, {kept} solvable, of {}", situations().len());
    assert!(met >= 2 && kept == met, "{kept} of {met}");
}

/// The movers that a compiled intervention describes.
fn followed(situation: &Situation, parts: &[Part], compiled: &Compiled) -> Vec<Mover> {
    let mut movers = at_record(situation, parts);
    for mover in &mut movers {
        let action = compiled.intervention.actions.iter().find_map(|action| match action {
            Action::Follow { track, samples, .. } if *track == mover.actor => Some(samples),
            _ => None,
        });
        for (k, sample) in action.unwrap().iter().enumerate() {
            mover.boxes[k + 1] = situation.body(mover.actor, sample);
        }
    }
    movers
}

#[test]
fn the_solution_pass_refuses_a_wall_before_the_ego_and_accepts_an_empty_road() {
    let situation = &situations()[0];
    let rates = Rates { rate: 0.15, first_decay: 0.9, second_decay: 0.999 };
    let solution = Solution { iterations: 25, rates, buffer_m: 0.5 };
    let mut parts = opened("strive", situation);
    parts.truncate(1);
    let others = bystanders(situation, &parts);
    let mut movers = at_record(situation, &parts);
    let ego = *situation.ego.at(movers[0].from_step).unwrap();
    for body in &mut movers[0].boxes {
        body.center = ego.position + Vec2::new(500.0, 500.0);
    }
    assert!(exists(situation, &movers, &others, &solution));
    for body in &mut movers[0].boxes {
        body.center = ego.position + Vec2::from_heading(ego.heading_rad) * 1.0;
    }
    assert!(!exists(situation, &movers, &others, &solution));
}

#[test]
fn a_solver_that_remembers_ways_solves_what_the_plain_pass_solves() {
    let rates = Rates { rate: 0.15, first_decay: 0.9, second_decay: 0.999 };
    let solution = Solution { iterations: 25, rates, buffer_m: 0.5 };
    let mut solved = 0;
    for situation in situations().iter().take(WorldKind::ALL.len()) {
        let parts = opened("king", situation);
        let others = bystanders(situation, &parts);
        let mut solver = Solver::new(situation, &others, solution);
        for iterate in kings_descent(situation, &parts, 40).iter().step_by(8) {
            let plain = exists(situation, &iterate.movers, &others, &solution);
            assert!(solver.solves(&iterate.movers) || !plain, "{}", situation.scene_id());
            solved += usize::from(plain);
        }
    }
    assert!(solved > 10, "{solved}");
}

#[test]
fn compiling_gradient_families_is_pure() {
    for name in ["king", "strive"] {
        let situation = &situations()[3];
        assert_eq!(parent_compiled(name, situation), parent_compiled(name, situation));
    }
}

/// A program with every parameter and choice drawn from its range; a group of any size.
fn drawn(family: &Source, shares: &[f64]) -> Program {
    let mut program = family.parent.clone();
    for ((name, spec), share) in family.contract.parameters.iter().zip(shares.iter().cycle()) {
        let value = match &spec.domain {
            Domain::Number { low, high, .. } => low + (high - low) * share,
            Domain::Integer { low, high, .. } => (*low as f64 + (high - low) as f64 * share).round(),
            _ => continue,
        };
        program.parameters.insert(name.clone(), ParameterValue::Number(value));
    }
    for (node, share) in program.operator_graph.values_mut().zip(shares.iter().rev()) {
        let Some(spec) = family.contract.operator(node.slot, &node.kind) else { continue };
        for (name, setting) in &spec.settings {
            if let Domain::Choice { options } = &setting.domain {
                let word = &options[((options.len() as f64 * share) as usize).min(options.len() - 1)];
                node.settings.insert(name.clone(), Setting::Choice(word.clone()));
            }
        }
        let swaps = family.contract.operator(Slot::Timing, "conflict_window").is_some();
        if node.slot == Slot::Timing && swaps && *share > 0.5 {
            node.kind = "conflict_window".into();
            node.settings.insert("lead_s".into(), Setting::Number(0.5 + 5.0 * share));
        }
    }
    program
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn any_legal_program_of_any_family_compiles_on_any_scene_or_names_a_constraint(
        shares in prop::collection::vec(0.0..1.0f64, 11), seed in 0u64..1000, place in 0usize..1000,
        gap in prop::option::of(11usize..60), laneless in prop::bool::weighted(0.2),
    ) {
        let all = situations();
        let mut scene = (*all[place % all.len()].scene).clone();
        if let (Some(gap), Some(first)) = (gap, scene.objects_of_interest.first()) {
            scene.tracks[*first].samples[gap] = None;
        }
        if laneless {
            scene.road.lanes.clear();
            scene.lights.clear();
            scene.stop_signs.clear();
        }
        let situation = Situation::new(Arc::new(scene), &Policy::Idm).unwrap();
        for family in sources().iter() {
            let program = drawn(family, &shares);
            match compile(&program, family, &situation, Seed(seed)) {
                Ok(compiled) => {
                    let outcome = sim::rollout(&situation.plant, &compiled.intervention, Policy::Idm.driver().as_mut());
                    prop_assert!(outcome.is_ok(), "{}: {:?}", family.contract.family, outcome);
                    prop_assert_eq!(compiled.decision.applies, !compiled.intervention.actions.is_empty());
                }
                Err(CompileFailure::Constraint { .. }) => {}
                Err(other) => prop_assert!(false, "{}: {other}", family.contract.family),
            }
        }
    }
}
