//! Expressiveness of programs: laws as patches, ways that part and meet, and what a candidate would do.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use evodrive::candidates::{Admission, Judging, Trials, admit};
use evodrive::compiler::{Compiled, Prepared, Situation};
use evodrive::ego::Policy;
use evodrive::families::{grammar, registry, sources};
use evodrive::kernel::{Seed, num};
use evodrive::motion::Candidate;
use evodrive::objects::{
    FamilyName, LineageId, MechanismModule, Operation, Program, ProgramPatch, Setting, Slot, SolutionId, ValueType,
};
use evodrive::scene::Sample;
use evodrive::sim::{Action, rollout_assessed};
use evodrive::stage::Source;
use evodrive::stage::foreseen::{Whose, foreseen, harm};
use evodrive::stage::judged::{Judged, Needs, feature, features};
use evodrive::synth::WorldKind;

use crate::sim::scenes::{car, sample, straight, straight_road};
use crate::worlds;

/// Three held-out scenes of every kind of world: the studies' own begin at other seeds.
fn situations() -> &'static [Situation] {
    static SITUATIONS: OnceLock<Vec<Situation>> = OnceLock::new();
    SITUATIONS.get_or_init(|| worlds::situations(&worlds::options(), 4711, 3 * WorldKind::ALL.len()))
}

fn family(name: &str) -> Source {
    sources().get(&FamilyName::new(name)).unwrap().clone()
}

fn admitted(family: &Source, operations: Vec<Operation>) -> Admission {
    let lineage = LineageId::new(format!("{}-idm", family.contract.family));
    let parent = family.parent.adopted(&lineage);
    let patch = ProgramPatch {
        source_baseline: family.contract.family.clone(),
        parent_solution_id: parent.solution_id.clone(),
        parent_program_hash: parent.hash().unwrap().to_hex(),
        operations,
        hypothesis: "written by hand".into(),
        memory_refs_used: vec![],
        cluster_refs_used: vec![],
        repair_summary: None,
        free: Default::default(),
    };
    let child = SolutionId::new(format!("{lineage}/e0s0"));
    let registry = registry();
    let judging = Judging::whole(&family.contract, &registry);
    admit(&parent, &patch, child, &judging, &|_, _| Trials::default())
}

/// The shipped patch of this name.
fn shipped(name: &str) -> Vec<Operation> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/laws").join(name);
    serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap()
}

const LAWS: [&str; 4] =
    ["brake_ahead.json", "go_when_it_commits.json", "wait_for_the_ego.json", "yield_to_others.json"];

/// Returns what a program makes of a scene.
fn built(family: &Source, program: &Program, situation: &Situation) -> Compiled {
    let prepared = Prepared::new(program, family).unwrap_or_else(|error| panic!("{error}"));
    prepared.compile(situation, Seed(1)).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_shipped_laws_are_admitted_where_the_contract_offers_laws_and_nowhere_else() {
    let mut offering = vec![];
    for family in sources().iter() {
        let offers = !family.contract.operators.get(&Slot::Law).is_none_or(Vec::is_empty);
        offering.extend(offers.then(|| family.contract.family.to_string()));
        for name in LAWS {
            let admission = admitted(family, shipped(name));
            let problems: Vec<_> = admission.gates.failed().collect();
            assert_eq!(admission.candidate.is_some(), offers, "{} {name}: {problems:?}", family.contract.family);
        }
    }
    // ADV-BMT's inserted body and SafeBench's scripts follow none.
    let moves = |of: &&Source| of.contract.backend != "safebench" && of.contract.family.as_str() != "adv_bmt";
    let moving: Vec<_> = sources().iter().filter(moves).map(|of| of.contract.family.to_string()).collect();
    assert_eq!(offering, moving);
}

/// Contacts with an adversary that stood in the ego's way, and mean metres between the ways driven with and without the law.
fn played(family: &Source, program: &Program) -> (usize, usize) {
    let (mut met, mut struck) = (0, 0);
    for situation in situations() {
        let compiled = built(family, program, situation);
        let outcome =
            rollout_assessed(&situation.plant, &compiled.intervention, Policy::Idm.driver().as_mut()).unwrap();
        met += usize::from(outcome.contact.is_some_and(|contact| contact.adversary));
        struck += outcome.adversaries.iter().filter(|adversary| adversary.struck_bystander).count();
    }
    (met, struck)
}

#[test]
fn a_law_that_times_the_meeting_meets_more_and_one_that_yields_strikes_fewer_bystanders() {
    let cat = family("cat");
    let (parent, parents_victims) = played(&cat, &cat.parent);
    let of = |name: &str| played(&cat, &admitted(&cat, shipped(name)).candidate.unwrap().program);
    let (waiting, _) = of("wait_for_the_ego.json");
    let (_, victims) = of("yield_to_others.json");
    println!(
        "of {}: parent {parent} met, {parents_victims} struck; waiting {waiting}; yielding {victims} struck",
        situations().len()
    );
    assert!(waiting > parent, "{waiting} against {parent}");
    assert!(victims < parents_victims, "{victims} against {parents_victims}");
}

fn module(slot: &str, output: ValueType, inputs: &[&str], expression: &str) -> MechanismModule {
    let inputs = inputs.iter().map(|input| input.to_string()).collect();
    MechanismModule { slot: slot.into(), inputs, output, expression: expression.into(), tags: vec![] }
}

fn put<const N: usize>(
    program: &mut Program,
    name: &str,
    slot: Slot,
    kind: &str,
    inputs: &[&str],
    settings: [(&str, Setting); N],
) {
    program.operator_graph.extend([grammar::node(name, slot, kind, inputs, settings)]);
}

/// CAT with two ways from its one timing node: the parent's, and one whose candidates change their speed more.
fn two_ways(meet: impl Fn(&mut Program)) -> Program {
    let mut program = family("cat").parent;
    let mut brisk = program.operator_graph["motion"].clone();
    brisk.settings.insert("profile_step_mps2".into(), Setting::Number(3.0));
    program.operator_graph.insert("brisk_motion".into(), brisk);
    let mut search = program.operator_graph["search"].clone();
    search.inputs = vec!["brisk_motion".into()];
    program.operator_graph.insert("brisk_search".into(), search);
    meet(&mut program);
    program.operator_graph.get_mut("choice").unwrap().inputs = vec!["met".into()];
    program
}

/// One of the two ways alone.
fn only(way: &str) -> Program {
    let mut program = two_ways(|_| ());
    program.operator_graph.get_mut("choice").unwrap().inputs = vec![way.into()];
    let other = if way == "search" { ["brisk_search", "brisk_motion"] } else { ["search", "motion"] };
    other.iter().for_each(|name| drop(program.operator_graph.remove(*name)));
    program
}

#[test]
fn the_second_way_is_taken_where_the_first_is_not_predicted_to_meet_the_ego() {
    let cat = family("cat");
    let program = two_ways(|p| {
        put(p, "met", Slot::Filter, "first_of", &["search", "brisk_search"], [("until", grammar::word("meeting"))])
    });
    let (mut first, mut second) = (0, 0);
    for situation in situations() {
        let (both, one, other) = (
            built(&cat, &program, situation),
            built(&cat, &only("search"), situation),
            built(&cat, &only("brisk_search"), situation),
        );
        if both.decision.branches == ["met: search"] {
            assert_eq!(both.intervention, one.intervention);
            first += 1;
        } else {
            assert_eq!(both.decision.branches, ["met: brisk_search"]);
            assert_eq!(both.intervention, other.intervention);
            second += 1;
        }
    }
    assert!(first > 3 && second > 3, "{first} {second}");
}

#[test]
fn the_second_way_is_taken_where_a_filter_refused_all_of_the_first() {
    let cat = family("cat");
    let program = two_ways(|p| {
        let shut = module("candidate_guard", ValueType::Boolean, &["speed_mps_max"], "speed_mps_max < 0");
        p.mechanism_modules.insert("shut".into(), shut);
        put(p, "guard", Slot::Filter, "guard_filter", &["search"], [("guard", grammar::from_mechanism("shut"))]);
        put(p, "met", Slot::Filter, "first_of", &["guard", "brisk_search"], [("until", grammar::word("candidate"))]);
    });
    let compiled = built(&cat, &program, &situations()[0]);
    assert_eq!(compiled.decision.branches, ["met: brisk_search"]);
    let open = two_ways(|p| {
        put(p, "met", Slot::Filter, "first_of", &["search", "brisk_search"], [("until", grammar::word("candidate"))])
    });
    let compiled = built(&cat, &open, &situations()[0]);
    assert_eq!(compiled.decision.branches, ["met: search"]);
}

#[test]
fn a_gate_sends_a_scene_one_way_or_the_other() {
    let cat = family("cat");
    let program = two_ways(|p| {
        let gate = module("scene_gate", ValueType::Boolean, &["is_junction"], "is_junction");
        p.mechanism_modules.insert("crowd".into(), gate);
        put(
            p,
            "met",
            Slot::Filter,
            "either",
            &["search", "brisk_search"],
            [("gate", grammar::from_mechanism("crowd"))],
        );
    });
    let taken = |situation| built(&cat, &program, situation).decision.branches.remove(0);
    let ways: std::collections::BTreeSet<String> = situations().iter().map(taken).collect();
    assert_eq!(ways.into_iter().collect::<Vec<_>>(), ["met: brisk_search", "met: search"]);
}

#[test]
fn candidates_of_both_ways_stand_for_choice_together() {
    let cat = family("cat");
    let program = two_ways(|p| put(p, "met", Slot::Filter, "all_of", &["search", "brisk_search"], []));
    for situation in &situations()[..6] {
        let count = |program: &Program| built(&cat, program, situation).decision.actors[0].candidates;
        let (one, other) = (count(&only("search")), count(&only("brisk_search")));
        assert_eq!(count(&program), one + other, "{}", situation.scene_id());
    }
}

#[test]
fn ways_that_cannot_meet_are_refused_with_the_reason() {
    let cat = family("cat");
    let problems = |program: &Program| -> String {
        cat.contract.check_program(program).iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let twice = two_ways(|p| put(p, "met", Slot::Filter, "all_of", &["search", "search"], []));
    assert!(problems(&twice).contains("`search` twice"), "{}", problems(&twice));
    let mut windows = two_ways(|p| put(p, "met", Slot::Filter, "all_of", &["search", "brisk_search"], []));
    assert_eq!(problems(&windows), "");
    let mut late = windows.operator_graph["timing"].clone();
    late.settings.insert("duration_s".into(), Setting::Number(4.0));
    windows.operator_graph.insert("late".into(), late);
    windows.operator_graph.get_mut("brisk_motion").unwrap().inputs = vec!["late".into()];
    assert!(problems(&windows).contains("the same timing node"), "{}", problems(&windows));
    // A fallback may have a window, and an adversary, of its own.
    let mut fallback = windows.clone();
    put(
        &mut fallback,
        "met",
        Slot::Filter,
        "first_of",
        &["search", "brisk_search"],
        [("until", grammar::word("meeting"))],
    );
    assert_eq!(problems(&fallback), "");
    assert!(
        situations().iter().any(|s| built(&cat, &fallback, s).decision.actors.iter().any(|a| a.window.steps == 40))
    );
}

#[test]
fn a_law_is_part_of_the_command_and_only_of_recorded_vehicles() {
    let cat = family("cat");
    let program =
        grammar::with_law(&cat.parent, [("acceleration", "planned_acceleration_mps2"), ("onset", "seen_gap_m < 9")]);
    let compiled = built(&cat, &program, &situations()[0]);
    let [Action::FollowThenObey { law, .. }] = compiled.intervention.actions.as_slice() else {
        panic!("{:?}", compiled.intervention)
    };
    assert!(law.onset.is_some() && law.offset.is_none() && compiled.decision.actors[0].lawful);
    let text = serde_json::to_string(&compiled.intervention).unwrap();
    assert_eq!(serde_json::from_str::<evodrive::sim::Intervention>(&text).unwrap(), compiled.intervention);
}

/// A scene in which the ego drives east at 10 m/s, and a candidate of its only other car.
fn would(candidate: Vec<Option<Sample>>) -> (Situation, Vec<Sample>) {
    let scene = straight_road(91, 10.0, vec![car("other", straight(sample(-30.0, 3.5, 0.0, 10.0), 91))]);
    let situation = Situation::new(Arc::new(scene), &Policy::Idm).unwrap();
    (situation, candidate.into_iter().flatten().skip(1).collect())
}

fn whose(situation: &Situation) -> Whose<'_> {
    Whose { situation, actor: 0, from_step: 1 }
}

#[test]
fn what_a_candidate_would_do_is_worked_by_hand() {
    use evodrive::sim::{Side, Striker};
    // From behind in the ego's lane, twice as fast: it runs into the rear, which the ego cannot see coming.
    let (situation, rams) = would(straight(sample(-30.0, 0.0, 0.0, 20.0), 91));
    let found = foreseen(&rams, whose(&situation));
    assert_eq!((found.side, found.striker), (Some(Side::Rear), Some(Striker::Other)));
    assert!(found.angle_rad < 1e-9 && found.seen_coming_s < 1.0, "{found:?}");
    // It stands ahead in the ego's lane: the ego runs into it and has seen it for as long as it drives up to it.
    let (situation, stands) = would(straight(sample(40.0, 0.0, 0.0, 0.0), 91));
    let found = foreseen(&stands, whose(&situation));
    assert_eq!((found.side, found.striker), (Some(Side::Front), Some(Striker::Ego)));
    assert!(found.seen_coming_s > 2.0, "{found:?}");
    // It comes from the left across the ego's way and meets its flank.
    let (situation, crosses) = would(straight(sample(30.0, 33.0, -num::FRAC_PI_2, 11.0), 91));
    let found = foreseen(&crosses, whose(&situation));
    assert!((found.angle_rad - num::FRAC_PI_2).abs() < 0.05 && found.side.is_some(), "{found:?}");
    // It stays far away.
    let (situation, away) = would(straight(sample(-30.0, 60.0, 0.0, 10.0), 91));
    let found = foreseen(&away, whose(&situation));
    assert_eq!((found.side, found.striker, found.seen_coming_s), (None, None, 0.0));
}

#[test]
fn harm_is_what_a_candidate_adds_to_the_actors_own_record() {
    let (situation, same) = would(straight(sample(-30.0, 3.5, 0.0, 10.0), 91));
    let none = harm(&same, whose(&situation));
    assert!(none.acceleration_mps2 < 0.2 && none.off_road_m < 1e-9 && none.jerk_mps3 < 1.0, "{none:?}");
    let brakes = |k: usize| {
        let t = 0.1 * k as f64;
        let speed = (10.0 - 6.0 * t).max(0.0);
        let x = -30.0 + if speed > 0.0 { 10.0 * t - 3.0 * t * t } else { 100.0 / 12.0 };
        Some(sample(x, 3.5, 0.0, speed))
    };
    let (situation, stops) = would((0..60).map(brakes).collect());
    let added = harm(&stops, whose(&situation));
    assert!((4.0..7.0).contains(&added.acceleration_mps2), "{added:?}");
    // The lane is 4 m wide about y = 0: at y = 12 the outer side of a car of 1.9 m is about 11 m off it.
    let (situation, off) = would(straight(sample(-30.0, 12.0, 0.0, 10.0), 91));
    let beside = harm(&off, whose(&situation)).off_road_m;
    let (situation, against) = would(straight(sample(60.0, 0.0, num::PI, 10.0), 91));
    let wrong = harm(&against, whose(&situation)).wrong_way_m;
    assert!(beside > 5.0 && wrong > 20.0, "{beside} {wrong}");
}

/// Checks that a candidate foresees the quantity of realism's route completion: at the end, and at the contact.
#[test]
fn the_share_of_the_logged_way_is_that_of_the_place_at_the_contact_or_the_end() {
    let share = |candidate: Vec<Option<Sample>>| {
        let (situation, samples) = would(candidate);
        let judged = Judged { situation: &situation, actor: 0, from_step: 1, adversaries: &[0] };
        let candidate = Candidate::new(samples, 0.0);
        let values = features(&candidate, &judged, Needs::of(["log_way_share"]));
        feature(&values, "log_way_share").unwrap()
    };
    let beside = |speed| straight(sample(-30.0, 3.5, 0.0, speed), 91);
    assert!((share(beside(10.0)) - 1.0).abs() < 1e-9, "{}", share(beside(10.0)));
    assert!((share(beside(5.0)) - 0.5).abs() < 1e-9, "{}", share(beside(5.0)));
    assert!(share(beside(0.0)) < 1e-9 && share(beside(20.0)) == 1.0);
    // It stops for good after 2 s, 20 m on: 20 of 90 m where nobody meets it.
    let stops = |y| {
        let place = |k: usize| Some(sample(-30.0 + (k as f64).min(20.0), y, 0.0, if k < 20 { 10.0 } else { 0.0 }));
        (0..91).map(place).collect::<Vec<_>>()
    };
    assert!((share(stops(3.5)) - 20.0 / 90.0).abs() < 1e-9, "{}", share(stops(3.5)));
    // From behind in the ego's lane, twice as fast, it strikes the ego within 4 s; where it is put after that counts for nothing.
    let mut strikes = straight(sample(-30.0, 0.0, 0.0, 20.0), 91);
    strikes[60..].fill(Some(sample(-30.0, 0.0, 0.0, 0.0)));
    assert_eq!(share(strikes), 1.0);
}

/// CAT with its candidates reshaped behind their search, so that the same one is taken: the way that it commands.
fn reshaped(setting: &str, expression: &str, situation: &Situation) -> Option<Vec<Sample>> {
    let cat = family("cat");
    let mut program = cat.parent.clone();
    let slot = if setting == "speed" { "shape_speed_share" } else { "shape_offset_m" };
    program.mechanism_modules.insert("shape".into(), module(slot, ValueType::Number, &[], expression));
    let shape = grammar::from_mechanism("shape");
    put(&mut program, "reshape", Slot::Filter, "reshape", &["search"], [(setting, shape)]);
    program.operator_graph.get_mut("choice").unwrap().inputs = vec!["reshape".into()];
    let compiled = Prepared::new(&program, &cat).unwrap().compile(situation, Seed(1)).ok()?;
    match compiled.intervention.actions.as_slice() {
        [Action::Follow { samples, .. }] => Some(samples.clone()),
        _ => None,
    }
}

fn driven_m(way: &[Sample]) -> f64 {
    way.windows(2).map(|pair| pair[0].position.distance(pair[1].position)).sum()
}

/// Distance from the nearest piece of a way, positive to its left.
fn beside_m(way: &[Sample], at: &Sample) -> f64 {
    let pieces = way.windows(2).filter(|pair| pair[0].position.distance(pair[1].position) > 1e-6);
    let of = pieces.map(|pair| {
        let along = pair[1].position - pair[0].position;
        let share = ((at.position - pair[0].position).dot(along) / along.norm_squared()).clamp(0.0, 1.0);
        let delta = at.position - pair[0].position - along * share;
        delta.norm() * if along.cross(delta) < 0.0 { -1.0 } else { 1.0 }
    });
    of.min_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap()
}

#[test]
fn reshaped_candidates_drive_the_same_way_at_the_share_of_their_speed_and_beside_it_by_the_offset() {
    let (mut slowed, mut moved) = (0, 0);
    for situation in situations() {
        let Some(whole) = reshaped("speed", "1", situation).filter(|way| driven_m(way) > 20.0) else { continue };
        if let Some(half) = reshaped("speed", "0.5", situation) {
            // The first step is driven before the first sample, so both differ from the ratio by a step at most.
            let share = driven_m(&half) / driven_m(&whole);
            assert!((share - 0.5).abs() < 0.05, "{}: {share}", situation.scene_id());
            assert!(half.iter().skip(1).all(|sample| beside_m(&whole, sample).abs() < 0.3), "{}", situation.scene_id());
            slowed += 1;
        }
        let moves = whole.windows(2).all(|pair| pair[0].position.distance(pair[1].position) > 0.3);
        if let Some(left) = reshaped("offset", "1.5", situation).filter(|_| moves) {
            let aside: Vec<f64> = left.iter().map(|sample| beside_m(&whole, sample)).collect();
            assert!(aside[3] < 0.9 && aside[3] > 0.5, "2 m/s at most: {:?}", &aside[..5]);
            assert!((aside[20] - 1.5).abs() < 0.25, "{}: {:?}", situation.scene_id(), &aside[..25]);
            moved += 1;
        }
    }
    println!("{slowed} at half their speed, {moved} beside their way");
    assert!(slowed > 4 && moved > 2, "{slowed} {moved}");
}
