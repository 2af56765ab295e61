//! The scenes of an experiment: generated, imported or read from a pool.

use std::path::{Path, PathBuf};

use super::{Experiment, ExperimentError, SceneSource};
use crate::formats::summary::{self, BesideRoutes, FileScenes, HEAD_BYTES, Part};
use crate::kernel::{Seed, Threads};
use crate::scene::{Pool, Scene, pool};
use crate::store;
use crate::synth::{self, FamilyOptions, SynthError, SynthOptions};

/// Bytes that a scenario file or a pool may have.
const SCENE_FILE_BYTES_MAX: u64 = 1 << 30;
/// Endings of the scenario files that a folder is searched for.
const SCENARIO_ENDINGS: [&str; 6] = [".xml", ".json", ".pkl", ".tfrecord", ".xodr", ".cr.xml"];

impl Experiment {
    /// Its scenes, or those of `instead` (a pool, scenario files or folders) where some are named.
    ///
    /// # Errors
    /// Files that cannot be read, nothing that can be imported, scenes that cannot be generated.
    pub fn scenes(&self, instead: &[PathBuf], threads: &Threads) -> Result<Pool, ExperimentError> {
        if !instead.is_empty() {
            return read_scenes(instead, threads);
        }
        pool_of(&self.scenes, &|path| self.beside(path), threads)
    }
}

/// The scenes of a source; `beside` says where files lie that it names.
pub fn pool_of(
    source: &SceneSource,
    beside: &dyn Fn(&Path) -> PathBuf,
    threads: &Threads,
) -> Result<Pool, ExperimentError> {
    match source {
        SceneSource::Synth { count, seed, options } => generate(*count, *seed, options, threads),
        SceneSource::Safebench { seed, options } => generate_families(*seed, options, threads),
        SceneSource::Files { paths } => {
            read_scenes(&paths.iter().map(|path| beside(path)).collect::<Vec<_>>(), threads)
        }
        SceneSource::Pool { path } => read_pool(&beside(path)),
    }
}

fn unusable(error: impl std::fmt::Display) -> ExperimentError {
    ExperimentError::Scenes(error.to_string())
}

/// The scenes of pools, and what can be imported from files and folders. A path that ends in `.pool` is a pool.
///
/// # Errors
/// Files that cannot be read, nothing that can be imported, two different scenes of one id.
pub fn read_scenes(paths: &[PathBuf], threads: &Threads) -> Result<Pool, ExperimentError> {
    let is_pool = |path: &&PathBuf| path.extension().is_some_and(|end| end == "pool");
    let (pools, files): (Vec<&PathBuf>, Vec<&PathBuf>) = paths.iter().partition(is_pool);
    let mut read = Vec::new();
    for path in pools {
        read.push((path.display().to_string(), read_pool(path)?));
    }
    if !files.is_empty() {
        let names: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
        let files: Vec<PathBuf> = files.into_iter().cloned().collect();
        read.push((names.join(", "), import(&files, threads)?));
    }
    Ok(Pool::merged(read).map_err(unusable)?.0)
}

/// The pool in a file.
pub fn read_pool(path: &Path) -> Result<Pool, ExperimentError> {
    let bytes = store::read_bounded(path, SCENE_FILE_BYTES_MAX)?;
    pool::decode(&path.display().to_string(), &bytes).map_err(unusable)
}

/// Generates a pool; scenes are independent of each other and of the number of threads.
fn generate(count: usize, seed: u64, options: &SynthOptions, threads: &Threads) -> Result<Pool, ExperimentError> {
    each(count, &|i| synth::pool_member(options, Seed(seed), i), threads)
}

/// Generates the scenes of SafeBench's traffic families.
fn generate_families(seed: u64, options: &FamilyOptions, threads: &Threads) -> Result<Pool, ExperimentError> {
    options.check().map_err(unusable)?;
    each(options.count(), &|i| synth::family_member(options, Seed(seed), i), threads)
}

fn each(
    count: usize,
    scene: &(dyn Fn(usize) -> Result<Scene, SynthError> + Sync),
    threads: &Threads,
) -> Result<Pool, ExperimentError> {
    let places: Vec<usize> = (0..count).collect();
    let scenes = threads.map(&places, |_, &i| scene(i));
    Pool::new(scenes.into_iter().collect::<Result<Vec<Scene>, _>>().map_err(unusable)?, Vec::new()).map_err(unusable)
}

/// Imports files and folders. What cannot be used is left out with its reason; nothing usable at all is an error. A
/// thread has one file in memory at a time.
pub fn import(paths: &[PathBuf], threads: &Threads) -> Result<Pool, ExperimentError> {
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
        return Err(unusable(format!("no scene could be imported:\n{}", reasons.join("\n"))));
    }
    Pool::new(summary.scenes, summary.left_out).map_err(unusable)
}
