//! From an experiment to a study: scenes, split, families, models, options.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::answer::progress;
use super::exit::Failure;
use super::experiment::{Experiment, SceneSource};
use super::models;
use crate::agents::contract_text;
use crate::ego::Policy;
use crate::epoch::{Budget, LineageSpec, SceneEntry, Study};
use crate::evaluation::EvaluationOptions;
use crate::families;
use crate::formats::summary::{self, BesideRoutes, FileScenes, HEAD_BYTES, Part};
use crate::kernel::{Digest, Seed, Threads};
use crate::scene::{Pool, Scene, pool, usable};
use crate::stage::Source;
use crate::store;
use crate::synth;

/// Bytes that a scenario file or a pool may have.
const SCENE_FILE_BYTES_MAX: u64 = 1 << 30;

/// Scenes of an experiment: generated, imported or read from a pool.
pub fn scenes(experiment: &Experiment, file: &Path, instead: &[PathBuf], threads: &Threads) -> Result<Pool, Failure> {
    let beside = file.parent().unwrap_or(Path::new("."));
    match (&experiment.scenes, instead) {
        (_, [one]) if one.extension().is_some_and(|e| e == "pool") => read_pool(one),
        (_, [_, ..]) => import(instead, threads),
        (SceneSource::Synth { count, seed, options }, _) => generate(*count, *seed, options, threads),
        (SceneSource::Safebench { seed, options }, _) => generate_families(*seed, options, threads),
        (SceneSource::Files { paths }, _) => {
            import(&paths.iter().map(|path| beside.join(path)).collect::<Vec<_>>(), threads)
        }
        (SceneSource::Pool { path }, _) => read_pool(&beside.join(path)),
    }
}

pub fn read_pool(path: &Path) -> Result<Pool, Failure> {
    let bytes = store::read_bounded(path, SCENE_FILE_BYTES_MAX)?;
    pool::decode(&path.display().to_string(), &bytes).map_err(Failure::bad_input)
}

/// Generates a pool; scenes are independent of each other and of the number of threads.
pub fn generate(count: usize, seed: u64, options: &synth::SynthOptions, threads: &Threads) -> Result<Pool, Failure> {
    let places: Vec<usize> = (0..count).collect();
    let scenes = threads.map(&places, |_, &i| synth::pool_member(options, Seed(seed), i));
    let scenes = scenes.into_iter().collect::<Result<Vec<Scene>, _>>().map_err(Failure::bad_input)?;
    Pool::new(scenes, Vec::new()).map_err(Failure::bad_input)
}

/// Generates the scenes of SafeBench's traffic families.
pub fn generate_families(seed: u64, options: &synth::FamilyOptions, threads: &Threads) -> Result<Pool, Failure> {
    options.check().map_err(Failure::bad_input)?;
    let places: Vec<usize> = (0..options.count()).collect();
    let scenes = threads.map(&places, |_, &i| synth::family_member(options, Seed(seed), i));
    let scenes = scenes.into_iter().collect::<Result<Vec<Scene>, _>>().map_err(Failure::bad_input)?;
    Pool::new(scenes, Vec::new()).map_err(Failure::bad_input)
}

/// Endings of the scenario files that a folder is searched for.
const SCENARIO_ENDINGS: [&str; 6] = [".xml", ".json", ".pkl", ".tfrecord", ".xodr", ".cr.xml"];

/// Imports files and folders. What cannot be used is left out with its reason; nothing usable at all is an error. A
/// thread has one file in memory at a time.
pub fn import(paths: &[PathBuf], threads: &Threads) -> Result<Pool, Failure> {
    let mut files: Vec<(String, PathBuf)> = Vec::new();
    for path in paths {
        for file in store::list_files(path, &SCENARIO_ENDINGS)? {
            let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            files.push((name, file));
        }
    }
    // A file that cannot be read is told by the second reading.
    let part = |_: usize, file: &(String, PathBuf)| {
        store::read_head(&file.1, HEAD_BYTES).map_or(Part::Alone, |head| summary::part(&head))
    };
    let parts = threads.map(&files, part);
    let bytes_of = |path: &Path| store::read_bounded(path, SCENE_FILE_BYTES_MAX);
    let beside = parts.contains(&Part::Routes).then(|| {
        let mut beside = BesideRoutes::default();
        for ((name, path), _) in files.iter().zip(&parts).filter(|(_, part)| **part == Part::Beside) {
            if let Ok(bytes) = bytes_of(path) {
                beside.add(name, &bytes);
            }
        }
        beside
    });
    let read = threads.map(&files, |_, (name, path)| match bytes_of(path) {
        Ok(bytes) => summary::read_file(name, &bytes, beside.as_ref()),
        Err(error) => FileScenes::left_out(name, error.to_string()),
    });
    let summary = summary::summed(files.into_iter().map(|(name, _)| name).zip(read));
    if summary.scenes.is_empty() {
        let reasons: Vec<String> = summary.left_out.iter().map(|l| format!("  {}: {}", l.file, l.reason)).collect();
        return Err(Failure::bad_input(format!("no scene could be imported:\n{}", reasons.join("\n"))));
    }
    Pool::new(summary.scenes, summary.left_out).map_err(Failure::bad_input)
}

/// Says which scenes are left out of evolution and why.
pub fn tell_left_out(pool: &Pool) {
    for left in &pool.left_out {
        let what = if left.what.is_empty() { String::new() } else { format!(" ({})", left.what) };
        progress(format!("left out: {}{what}: {}", left.file, left.reason));
    }
    for scene in &pool.scenes {
        if let Err(reason) = usable(scene) {
            progress(format!("not used: {}: {reason}", scene.id));
        }
    }
}

/// Puts a study together. `pool_digest` names all scenes; the study holds those of the split.
pub fn study(experiment: &Experiment, pool: Pool, threads: &Threads) -> Result<Study, Failure> {
    let bad = |error: String| Failure::bad_input(format!("experiment {}: {error}", experiment.name));
    let seed = Seed(experiment.seed);
    let split = pool
        .split(seed, experiment.split.evolution, experiment.split.held_out)
        .map_err(|error| bad(error.to_string()))?;
    let pool_digest: Digest = pool.digest();
    let mut lineages = Vec::new();
    for lineage in &experiment.lineages {
        let ego: Policy = lineage.ego.parse().map_err(|error| bad(format!("lineage {}: {error}", lineage.id)))?;
        let (id, family, parent) = (lineage.id.clone(), lineage.family.clone(), lineage.parent.clone());
        lineages.push(LineageSpec { id, family, ego, parent });
    }
    let wanted: Vec<&str> = split.evolution.iter().chain(&split.held_out).map(|s| s.id.as_str()).collect();
    let mut by_id: BTreeMap<String, Arc<Scene>> =
        pool.scenes.into_iter().map(|s| (s.id.clone(), Arc::new(s))).collect();
    let chosen: Vec<Arc<Scene>> = wanted.iter().filter_map(|id| by_id.remove(*id)).collect();
    let entries = threads.map(&chosen, |_, scene| SceneEntry::new(scene.clone()));
    let families: Vec<&str> = experiment.lineages.iter().map(|l| l.family.as_str()).collect();
    let sources = families::sources();
    for family in families {
        if sources.get(&crate::objects::FamilyName::new(family)).is_none() {
            let known: Vec<&str> = sources.iter().map(|f| f.contract.family.as_str()).collect();
            return Err(bad(format!("no family is called `{family}`; there are {}", known.join(", "))));
        }
    }
    let text = |f: &Source| (f.contract.family.clone(), contract_text(&f.contract));
    let used = |f: &&Source| lineages.iter().any(|spec| spec.family == f.contract.family);
    let contract_texts = sources.iter().filter(used).map(text).collect();
    match &experiment.evaluation {
        EvaluationOptions::Metadrive(options) => options.realism.check().map_err(|error| bad(error.to_string()))?,
        EvaluationOptions::Safebench { safebench } => {
            if let Some((name, expected)) = safebench.fault() {
                return Err(bad(format!("evaluation.safebench.{name}: expected {expected}")));
            }
            if let Some(entry) = entries.iter().find(|entry| entry.group().is_none()) {
                return Err(bad(format!(
                    "scene {} is staged for no traffic family; [evaluation.safebench] takes [scenes] source = \"safebench\"",
                    entry.scene().id
                )));
            }
        }
    }
    experiment.memory.validate().map_err(|error| bad(error.to_string()))?;
    let study = Study {
        name: experiment.name.clone(),
        experiment: experiment.digest()?,
        seed,
        evolution: (0..split.evolution.len()).collect(),
        held_out: (split.evolution.len()..entries.len()).collect(),
        scenes: entries,
        pool_digest,
        lineages,
        contract_texts,
        registry: sources.registry(),
        sources,
        budget: Budget {
            epochs: experiment.budget.epochs,
            slots: experiment.budget.slots,
            window: experiment.split.window,
            max_repair_rounds: experiment.budget.max_repair_rounds,
            probe_scenes: experiment.budget.probe_scenes,
            finalists: experiment.budget.finalists,
        },
        models: models::by_role(experiment),
        evaluation: experiment.evaluation.clone(),
        archive: experiment.archive.clone(),
        selector: experiment.selector.clone(),
        memory: experiment.memory.clone(),
        curation: experiment.curation.clone(),
        world: experiment.world.clone(),
        composition: experiment.composition.clone(),
        counsel: experiment.counsel,
    };
    for lineage in &study.lineages {
        study.parent(lineage).map_err(|error| bad(error.to_string()))?;
    }
    Ok(study)
}
