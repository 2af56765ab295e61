//! Motions that no road user of a kind makes cost realism where an experiment weighs them, and recorded traffic makes none of them.

use super::motions::Case;
use super::{body_m, catalogue, options_of_kind};
use crate::harness::shared;
use evodrive::adapters::Family;
use evodrive::candidates::{Judging, Trials, admit};
use evodrive::ego::Policy;
use evodrive::evaluation::metrics::realism::{realism, realism_of};
use evodrive::evaluation::metrics::rolling;
use evodrive::evaluation::replay_row::recorded_reports;
use evodrive::families;
use evodrive::formats::import_files;
use evodrive::kernel::{Seed, Vec2};
use evodrive::objects::{Gate, LineageId, Operation, OperationKind, ProgramPatch, SolutionId};
use evodrive::scene::{AgentKind, DT_S, PreparedScene, Sample};
use evodrive::sim::{Action, AdversaryReport, Intervention, Outcome, Plant, SimulatorOptions, WithRecording, rollout};
use serde_json::{Value, json};
use std::sync::Arc;

/// A motion is caught where its diagnostic loses at least half.
const CAUGHT: f64 = 0.5;
/// Share of scenes in which it must be.
const SHARE: f64 = 0.95;

fn asked() -> SimulatorOptions {
    SimulatorOptions { of_kind: true, ..SimulatorOptions::SHIPPED }
}

fn played(case: &Case, action: Action) -> Outcome {
    let plant = Plant::with_options(PreparedScene::new(Arc::new(case.scene.clone())), &asked()).unwrap();
    rollout(&plant, &Intervention { actions: vec![action] }, Policy::Idm.driver().as_mut()).unwrap()
}

/// Inserts a road user far from everybody for four seconds: `at` gives its place `t` seconds after it appears, and its heading.
fn inserted(case: &Case, kind: AgentKind, at: impl Fn(f64) -> (Vec2, f64)) -> Action {
    let (length_m, width_m) = body_m(kind);
    let sample = |k: usize| {
        let (t, dt) = (k as f64 * DT_S, 0.5 * DT_S);
        let (position, heading_rad) = at(t);
        Sample { position, heading_rad, velocity: (at(t + dt).0 - at(t - dt).0) * (1.0 / (2.0 * dt)) }
    };
    Action::Insert { kind, length_m, width_m, from_step: case.from_step, samples: (0..40).map(sample).collect() }
}

/// Share of the scenes in which a diagnostic catches a motion that begins at the case's vehicle, beside it or in its place.
fn share(diagnostic: &str, motion: impl Fn(&Case) -> Action) -> f64 {
    let options = options_of_kind();
    let found: Vec<f64> =
        catalogue::cases().iter().map(|case| realism(&played(case, motion(case)), &options).0[diagnostic]).collect();
    assert!(found.len() >= 25, "{} scenes", found.len());
    found.iter().filter(|d| **d <= CAUGHT).count() as f64 / found.len() as f64
}

/// The first place of the case's vehicle, moved well aside, so that nobody is near.
fn place(case: &Case) -> (Vec2, f64) {
    let first = &case.log[0];
    (first.position + Vec2::from_heading(first.heading_rad).left() * 30.0, first.heading_rad)
}

#[test]
fn a_standing_car_that_slides_aside_is_caught_and_one_that_stands_or_rolls_is_not() {
    let slides = |mps: f64| {
        move |case: &Case| {
            let (at, heading) = place(case);
            let aside = Vec2::from_heading(heading).left();
            inserted(case, AgentKind::Vehicle, move |t| (at + aside * (mps * t.max(0.0)), heading))
        }
    };
    // 0.2 m/s is a fifth of what `bounded_slip` lets pass.
    assert!(share("rolling", slides(0.2)) >= SHARE);
    assert_eq!(share("bounded_slip", slides(0.2)), 0.0, "it is too slow for the diagnostic of its speed");
    assert_eq!(share("rolling", slides(0.0)), 0.0);
    let rolls = |case: &Case| {
        let (at, heading) = place(case);
        let ahead = Vec2::from_heading(heading);
        inserted(case, AgentKind::Vehicle, move |t| (at + ahead * (6.0 * t), heading))
    };
    assert_eq!(share("rolling", rolls), 0.0);
}

#[test]
fn a_car_that_slides_within_half_a_second_of_appearing_is_caught() {
    let slides = |case: &Case| {
        let (at, heading) = place(case);
        let aside = Vec2::from_heading(heading).left();
        inserted(case, AgentKind::Vehicle, move |t| (at + aside * (1.6 * t.clamp(0.0, 0.5)), heading))
    };
    assert!(share("rolling", slides) >= SHARE, "{}", share("rolling", slides));
}

#[test]
fn a_turn_on_the_spot_is_caught() {
    let turns = |case: &Case| {
        let (at, heading) = place(case);
        inserted(case, AgentKind::Vehicle, move |t| (at, heading + 0.3 * t))
    };
    assert!(share("rolling", turns) >= SHARE);
}

#[test]
fn a_car_s_motion_in_the_box_of_a_cyclist_or_a_pedestrian_is_caught() {
    let moves = |kind: AgentKind, mps: f64| {
        move |case: &Case| {
            let (at, heading) = place(case);
            let ahead = Vec2::from_heading(heading);
            inserted(case, kind, move |t| (at + ahead * (mps * t), heading))
        }
    };
    for (kind, mps) in [(AgentKind::Cyclist, 11.0), (AgentKind::Pedestrian, 4.0)] {
        assert!(share("speed_of_kind", moves(kind, mps)) >= SHARE, "{kind:?} at {mps} m/s");
        assert_eq!(share("speed_of_kind", moves(AgentKind::Vehicle, mps)), 0.0, "a car at {mps} m/s");
    }
    assert_eq!(share("speed_of_kind", moves(AgentKind::Cyclist, 6.0)), 0.0);
    assert_eq!(share("speed_of_kind", moves(AgentKind::Pedestrian, 1.5)), 0.0);
}

#[test]
fn an_outcome_that_was_not_asked_says_nothing_of_kinds() {
    let case = &catalogue::cases()[0];
    let action = case.follow(case.log.clone());
    let plant = Plant::new(&case.scene).unwrap();
    let plain = rollout(&plant, &Intervention { actions: vec![action] }, Policy::Idm.driver().as_mut()).unwrap();
    assert!(plain.adversaries[0].of_kind.is_none());
    assert!(!serde_json::to_string(&plain).unwrap().contains("of_kind"), "so its digest is what it always was");
}

/// Recorded road users of a folder's scenes, judged as if they had been generated, by kind: what the two diagnostics cost, percent, and
/// how many they are.
fn penalties_pct(scenes: &[evodrive::scene::Scene]) -> (f64, usize) {
    let options = options_of_kind();
    let mut all = Vec::new();
    for scene in scenes {
        let plant = Plant::with_options(PreparedScene::new(Arc::new(scene.clone())), &asked()).unwrap();
        for report in recorded_reports(&plant) {
            let (by_name, _) = realism_of(std::slice::from_ref(&report), &options);
            all.push(100.0 * (2.0 - by_name["rolling"] - by_name["speed_of_kind"]) / 12.0);
        }
    }
    (all.iter().sum::<f64>() / all.len().max(1) as f64, all.len())
}

#[test]
fn recorded_traffic_does_nothing_that_its_kind_does_not() {
    let Some(folder) = shared("data/commonroad") else { return };
    let scenes = import_files(&crate::harness::files(&folder, "USA_")).scenes;
    let (penalty_pct, count) = penalties_pct(&scenes);
    println!("RP of both diagnostics {penalty_pct:.4} % of {count} recorded vehicles");
    assert!(count >= 50 && penalty_pct <= 0.5, "{penalty_pct} % of {count}");
}

#[test]
fn a_noisy_recording_is_as_plausible_as_a_clean_one() {
    // Cars that stand and roll, recorded with 5 cm of jitter in each direction and two degrees in heading.
    let options = options_of_kind();
    let case = &catalogue::cases()[0];
    let mut stream = Seed(5).stream(&["noise"]);
    let mut lost: Vec<f64> = Vec::new();
    for n in 0..60 {
        let mps = [0.0, 4.0, 12.0][n % 3];
        let mut scene = case.scene.clone();
        let track = &mut scene.tracks[case.track];
        let (at, heading) = place(case);
        for (k, sample) in track.samples.iter_mut().enumerate() {
            let jitter = Vec2::new(stream.normal(0.0, 0.05), stream.normal(0.0, 0.05));
            let position = at + Vec2::from_heading(heading) * (mps * k as f64 * DT_S) + jitter;
            let heading_rad = heading + stream.normal(0.0, 0.035);
            *sample = Some(Sample { position, heading_rad, velocity: Vec2::from_heading(heading) * mps });
        }
        let plant = Plant::with_options(PreparedScene::new(Arc::new(scene)), &asked()).unwrap();
        let of_kind = WithRecording { simulated: plant.recorded_of_kind(case.track), recorded: None };
        let limits = options.calibration.of(AgentKind::Vehicle);
        let report = AdversaryReport { of_kind: Some(of_kind), ..recorded_reports(&plant)[0].clone() };
        lost.push(100.0 * (1.0 - rolling::ROW.value(&report, limits)) / 12.0);
    }
    let mean_pct = lost.iter().sum::<f64>() / lost.len() as f64;
    println!("RP of rolling {mean_pct:.3} % of {} noisy motions", lost.len());
    assert!(mean_pct <= 0.5, "{mean_pct} %");
}

fn adv_bmt() -> Family {
    families::registry().iter().find(|family| family.contract.family.as_str() == "adv_bmt").unwrap().clone()
}

/// Returns what the gate of protected parts says of one edit.
fn refused(fixed_bodies: bool, path: &str, value: Value) -> Vec<String> {
    let (registry, family) = (families::registry(), adv_bmt());
    let mut parent = family.parent.clone();
    parent.lineage_id = LineageId::new("adv_bmt-idm");
    parent.solution_id = SolutionId::new("adv_bmt-idm/parent");
    let op = if path.ends_with("/-") { OperationKind::Add } else { OperationKind::Replace };
    let patch = ProgramPatch {
        source_baseline: family.contract.family.clone(),
        parent_solution_id: parent.solution_id.clone(),
        parent_program_hash: parent.hash().unwrap().to_hex(),
        operations: vec![Operation { op, path: path.into(), value: Some(value) }],
        hypothesis: "another body".into(),
        memory_refs_used: vec![],
        cluster_refs_used: vec![],
        repair_summary: None,
        free: Default::default(),
    };
    let judging = Judging { fixed_bodies, ..Judging::whole(&family.contract, &registry) };
    let admission = admit(&parent, &patch, SolutionId::new("adv_bmt-idm/e1s0"), &judging, &|_, _| Trials::default());
    let protected = admission.gates.verdicts.into_iter().find(|verdict| verdict.gate == Gate::Protected).unwrap();
    protected.problems.into_iter().filter(|problem| problem.contains("bodies are fixed")).collect()
}

#[test]
fn no_way_leads_to_another_body_where_bodies_are_fixed() {
    let rule =
        json!({"name": "swap", "when": "true", "parameters": {}, "operators": {"actor": {"shape": "pedestrian"}}});
    let node =
        json!({"slot": "actor", "kind": "inserted_actor", "settings": {"shape": "cyclist"}, "inputs": ["select"]});
    let ways = [
        ("/operator_graph/actor/settings/shape", json!("cyclist")),
        ("/operator_graph/actor", node),
        ("/scenario_conditioned_policy/-", rule),
    ];
    for (path, value) in ways {
        let problems = refused(true, path, value.clone());
        assert_eq!(problems.len(), 1, "{path}: {problems:?}");
        assert!(problems[0].contains("`vehicle`"), "it says what the parent has: {}", problems[0]);
        assert!(refused(false, path, value).is_empty(), "{path} is free where bodies are");
    }
    assert!(refused(true, "/parameters/sample_count", json!(4.0)).is_empty(), "everything else is free");
}
