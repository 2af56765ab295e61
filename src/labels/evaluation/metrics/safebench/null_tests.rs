//! Tests that doing nothing is worth nothing in SafeBench's protocol.

use std::collections::BTreeMap;

use super::ars::tests::PUBLISHED;
use crate::archive::{ArchiveOptions, pf_area_pct};
use crate::ego::Policy;
use crate::evaluation::protocol::balanced::balanced;
use crate::evaluation::protocol::safebench::{Group, Runs, safebench_run};
use crate::kernel::Seed;
use crate::motion::traffic_family::{actions, standard};
use crate::objects::benchmark::SafebenchRun;
use crate::scene::Scene;
use crate::scene::safebench::{Stage, TrafficFamily};
use crate::sim::{Action, Intervention, Plant, Scripts, rollout};
use crate::synth::{FamilyOptions, family_member};

fn pool() -> Vec<(Group, Scene)> {
    let options = FamilyOptions::all();
    let scenes = (0..options.count()).map(|i| family_member(&options, Seed(7), i).unwrap());
    let group = |scene: &Scene| scene.staging.as_ref().map(|staging| (staging.family, staging.route)).unwrap();
    scenes.map(|scene| (group(&scene), scene)).collect()
}

fn labelled(pool: &[(Group, Scene)], program: impl Fn(&Scene) -> Vec<Action>) -> Vec<(Group, SafebenchRun)> {
    let run = |(group, scene): &(Group, Scene)| {
        let intervention = Intervention { actions: program(scene) };
        let outcome = rollout(&Plant::new(scene).unwrap(), &intervention, &mut *Policy::Idm.driver()).unwrap();
        (*group, safebench_run(&outcome, &PUBLISHED).unwrap())
    };
    pool.iter().map(run).collect()
}

fn published(scene: &Scene) -> Vec<Action> {
    let stage = Stage::of(scene).unwrap();
    actions(&stage, &standard(stage.staging().family), Scripts::AsDefined).unwrap()
}

/// The published actors a kilometre away, where nothing ever sets them off.
fn staged_but_idle(scene: &Scene) -> Vec<Action> {
    let mut actions = published(scene);
    for action in &mut actions {
        if let Action::Triggered(script) = action {
            script.trigger.distance_m = 0.0;
            script.spawn.position.x += 1000.0;
        }
    }
    actions
}

fn gathered(runs: &[(Group, SafebenchRun)]) -> Runs {
    let mut all = Runs::default();
    runs.iter().for_each(|(group, run)| all.add(*group, *run));
    all
}

#[test]
fn a_program_that_does_nothing_has_no_collision_no_attack_no_realism_and_adds_no_area() {
    let pool = pool();
    let (parent, nothing) = (labelled(&pool, published), labelled(&pool, |_| vec![]));
    let idle = labelled(&pool, staged_but_idle);
    let before: BTreeMap<Group, _> = gathered(&parent).groups();
    for runs in [&nothing, &idle] {
        let scores = gathered(runs).benchmark().unwrap().mean;
        println!("CR {} OS {} ARS {}", scores.collision_rate, scores.overall_score, scores.realism);
        assert_eq!((scores.collision_rate, scores.attack, scores.realism, scores.valid_rate), (0.0, 0.0, 0.0, 0.0));
        assert!(scores.overall_score > 0.95, "nobody disturbs the ego: {}", scores.overall_score);
        let options = ArchiveOptions {
            reference: [0.0; 2],
            r0: 0.8,
            a0: 0.3,
            epsilon_r: 0.01,
            epsilon_a: 0.02,
            epsilon_pf: 0.1,
            level: 0.8,
            coverage_floor: 0.8,
            ..ArchiveOptions::default()
        };
        for (group, score) in gathered(runs).groups() {
            let gain = pf_area_pct(&[before[&group].point()], &[score.point()], 3, &options);
            assert_eq!(gain, 0.0, "{group:?}");
        }
    }
}

#[test]
fn balanced_selection_never_keeps_a_run_of_a_program_that_does_nothing_before_a_valid_one() {
    let pool = pool();
    let parent = labelled(&pool, published);
    let valid: Vec<(Group, SafebenchRun)> = parent.iter().copied().filter(|(_, run)| run.realism.valid).collect();
    assert!(valid.len() > 40, "{}", valid.len());
    let of_valid = |group: &Group| valid.iter().any(|(own, _)| own == group);
    let idle = labelled(&pool, |_| vec![]).into_iter().filter(|(group, _)| of_valid(group));
    let runs: Vec<(Group, SafebenchRun)> = idle.chain(valid.iter().copied()).collect();
    let kept = balanced(&runs, 2);
    assert_eq!(kept.len(), valid.len(), "each group keeps its one valid run and no other");
    assert!(kept.iter().all(|place| runs[*place].1.realism.acted));
}

#[test]
fn every_published_scenario_has_groups_in_which_it_is_a_valid_scene() {
    let runs = labelled(&pool(), published);
    for family in TrafficFamily::ALL {
        let of: Vec<&SafebenchRun> = runs.iter().filter(|(g, _)| g.0 == family).map(|(_, run)| run).collect();
        let valid = of.iter().filter(|run| run.realism.valid).count();
        let mean = |i: usize| of.iter().map(|run| run.realism.sub_scores[i]).sum::<f64>() / of.len() as f64;
        println!("{}: {valid} of {} valid, {:?}", family.name(), of.len(), [0, 1, 2, 3].map(mean));
        assert!(valid * 2 > of.len(), "{}: {valid} of {}", family.name(), of.len());
    }
}
