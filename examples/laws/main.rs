//! Labels hand-written patches against their parent on scenes of a family's experiment, paired by scene:
//! `cargo run --release --example laws -- cat held_out examples/laws/*.json`. Choose among variants on `evolution`, and report on
//! `held_out`.

use std::collections::BTreeMap;
use std::path::Path;

use evodrive::backend::Backend;
use evodrive::candidates::{Judging, Trials, admit};
use evodrive::epoch::{Applied, Labelled, SceneEntry};
use evodrive::experiment::Experiment;
use evodrive::kernel::Threads;
use evodrive::objects::{LineageId, Program, ProgramPatch, SceneScore, Score, SolutionId};
use evodrive::stage::Source;
use evodrive::{ego::Policy, families};

type Failed = Box<dyn std::error::Error>;

/// The program that a file of operations makes of a family's parent.
fn patched(family: &Source, operations: &Path) -> Result<Program, Failed> {
    let lineage = LineageId::new(format!("{}-idm", family.contract.family));
    let parent = family.parent.adopted(&lineage);
    let patch = ProgramPatch {
        source_baseline: family.contract.family.clone(),
        parent_solution_id: parent.solution_id.clone(),
        parent_program_hash: parent.hash()?.to_hex(),
        operations: serde_json::from_slice(&std::fs::read(operations)?)?,
        hypothesis: "written by hand".into(),
        memory_refs_used: vec![],
        cluster_refs_used: vec![],
        repair_summary: None,
        free: Default::default(),
    };
    let child = SolutionId::new(format!("{lineage}/e0s0"));
    let registry = families::registry();
    let judging = Judging::whole(&family.contract, &registry);
    let admission = admit(&parent, &patch, child, &judging, &|_, _| Trials::default());
    let failed: Vec<String> = admission.gates.failed().flat_map(|verdict| verdict.problems.clone()).collect();
    let candidate = admission.candidate.ok_or_else(|| format!("{}: {}", operations.display(), failed.join("; ")))?;
    Ok(candidate.program)
}

/// Mean difference over the scenes that both have a label in, and half the width of its 95 % interval by the normal approximation.
fn paired(child: &Score, parent: &Score, of: fn(&SceneScore) -> f64) -> (f64, f64) {
    let before: BTreeMap<&str, f64> = parent.scenes.iter().map(|scene| (scene.scene.as_str(), of(scene))).collect();
    let change = |scene: &SceneScore| before.get(scene.scene.as_str()).map(|before| of(scene) - before);
    let changes: Vec<f64> = child.scenes.iter().filter_map(change).collect();
    let n = changes.len().max(1) as f64;
    let mean = changes.iter().sum::<f64>() / n;
    let variance = changes.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, 1.96 * (variance / n).sqrt())
}

fn main() -> Result<(), Failed> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, split, files @ ..] = &arguments[..] else {
        return Err("expected: a family, `evolution` or `held_out`, then files of operations".into());
    };
    let threads = Threads::new(2)?;
    let experiment = Experiment::read(Path::new(&format!("experiments/metadrive/{name}-idm.toml")))?;
    let study = experiment.study(experiment.scenes(&[], &threads)?, &threads)?;
    let places = match split.as_str() {
        "evolution" => &study.evolution,
        "held_out" => &study.held_out,
        other => return Err(format!("found `{other}`, expected `evolution` or `held_out`").into()),
    };
    let scenes: Vec<SceneEntry> =
        places.iter().map(|at| SceneEntry::new(study.scenes[*at].prepared.scene.clone())).collect();
    let sources = families::sources();
    let family = sources.iter().find(|family| family.contract.family.as_str() == name).ok_or("no such family")?;
    let applied = Applied {
        source: family,
        ego: &Policy::Idm,
        seed: study.seed,
        simulator: &study.simulator,
        backend: Backend::Own,
        evaluation: &study.evaluation,
        counsels: &BTreeMap::new(),
    };
    let mut programs = vec![("parent".to_string(), family.parent.clone())];
    for file in files {
        programs.push((file.clone(), patched(family, Path::new(file))?));
    }
    let all: Vec<&Program> = programs.iter().map(|(_, program)| program).collect();
    let labelled = applied.label(&all, &scenes, &threads)?;
    println!(
        "{} {split} scenes: attack, realism, coverage; change of attack and of scene realism, 95 % interval",
        scenes.len()
    );
    let parent = &labelled.first().ok_or("no scene could be labelled")?.score;
    for ((what, _), Labelled { score, .. }) in programs.iter().zip(&labelled) {
        let (attack, attack_by) = paired(score, parent, |scene| scene.attack);
        let (realism, realism_by) = paired(score, parent, |scene| scene.realism);
        println!(
            "{:.3}  {:.3}  {:.2}  {attack:+.3} ± {attack_by:.3}  {realism:+.3} ± {realism_by:.3}  {what}",
            score.objectives.attack, score.objectives.realism, score.coverage
        );
    }
    Ok(())
}
