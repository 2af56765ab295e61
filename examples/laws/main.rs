//! Labels hand-written patches against their parent on the held-out scenes of a family's experiment:
//! `cargo run --release --example laws -- cat examples/laws/*.json`

use std::collections::BTreeMap;
use std::path::Path;

use evodrive::candidates::{Trials, admit};
use evodrive::epoch::{Applied, Labelled, SceneEntry};
use evodrive::experiment::Experiment;
use evodrive::kernel::Threads;
use evodrive::objects::{LineageId, Program, ProgramPatch, SolutionId};
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
    };
    let child = SolutionId::new(format!("{lineage}/e0s0"));
    let registry = families::registry();
    let admission = admit(&parent, &patch, child, &family.contract, &registry, &|_, _| Trials::default());
    let failed: Vec<String> = admission.gates.failed().flat_map(|verdict| verdict.problems.clone()).collect();
    let candidate = admission.candidate.ok_or_else(|| format!("{}: {}", operations.display(), failed.join("; ")))?;
    Ok(candidate.program)
}

fn main() -> Result<(), Failed> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (name, files) = arguments.split_first().ok_or("a family, then files of operations")?;
    let threads = Threads::new(2)?;
    let experiment = Experiment::read(Path::new(&format!("experiments/metadrive/{name}-idm.toml")))?;
    let study = experiment.study(experiment.scenes(&[], &threads)?, &threads)?;
    let held_out = study.held_out.iter().map(|at| study.scenes[*at].prepared.scene.clone());
    let scenes: Vec<SceneEntry> = held_out.map(SceneEntry::new).collect();
    let sources = families::sources();
    let family = sources.iter().find(|family| family.contract.family.as_str() == name).ok_or("no such family")?;
    let applied = Applied {
        source: family,
        ego: &Policy::Idm,
        seed: study.seed,
        simulator: &study.simulator,
        evaluation: &study.evaluation,
        counsels: &BTreeMap::new(),
    };
    let mut programs = vec![("parent".to_string(), family.parent.clone())];
    for file in files {
        programs.push((file.clone(), patched(family, Path::new(file))?));
    }
    let all: Vec<&Program> = programs.iter().map(|(_, program)| program).collect();
    println!("{} held-out scenes; attack, realism, coverage", scenes.len());
    for ((what, _), Labelled { score, .. }) in programs.iter().zip(applied.label(&all, &scenes, &threads)?) {
        let of = &score.objectives;
        println!("{:.3}  {:.3}  {:.2}  {what}", of.attack, of.realism, score.coverage);
    }
    Ok(())
}
