//! The scenes of an experiment: generated, imported or read from a pool.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::{Experiment, ExperimentError, SceneSource};
use crate::formats::summary::{self, BesideRoutes, FileScenes, HEAD_BYTES, Part, Reading};
use crate::kernel::{Seed, Threads};
use crate::scene::{LeftOut, Pool, Scene, pool};
use crate::store;
use crate::synth::{self, FamilyOptions, SynthError, SynthOptions};

/// Bytes that a scenario file or a pool may have.
const SCENE_FILE_BYTES_MAX: u64 = 1 << 30;
/// Endings of the scenario files that a folder is searched for.
const SCENARIO_ENDINGS: [&str; 5] = [".pkl", ".json", ".xml", ".xodr", ".tfrecord"];

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
/// Files that cannot be read, nothing that can be imported, two pools with different scenes of one id.
pub fn read_scenes(paths: &[PathBuf], threads: &Threads) -> Result<Pool, ExperimentError> {
    read_scenes_as(paths, Reading::default(), threads)
}

/// [`read_scenes`], with how files are read.
///
/// # Errors
/// As [`read_scenes`].
pub fn read_scenes_as(paths: &[PathBuf], reading: Reading, threads: &Threads) -> Result<Pool, ExperimentError> {
    let is_pool = |path: &&PathBuf| path.extension().is_some_and(|end| end == "pool");
    let (pools, files): (Vec<&PathBuf>, Vec<&PathBuf>) = paths.iter().partition(is_pool);
    let mut read = Vec::new();
    for path in pools {
        read.push((path.display().to_string(), read_pool(path)?));
    }
    if !files.is_empty() {
        let names: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
        let files: Vec<PathBuf> = files.into_iter().cloned().collect();
        read.push((names.join(", "), import(&files, reading, threads)?));
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

/// Waymo numbers its files behind the ending: `training.tfrecord-00000-of-01000`. Each may be packed.
fn is_scenario_file(name: &str) -> bool {
    let name = name.strip_suffix(".gz").unwrap_or(name);
    SCENARIO_ENDINGS.iter().any(|ending| name.ends_with(ending)) || name.contains(".tfrecord-")
}

/// No file of these folders is a scenario file: what was looked for, and what is there instead.
fn nothing_in(folders: &[PathBuf], others: &[PathBuf]) -> ExperimentError {
    let listed = |paths: &[PathBuf]| paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
    let mut text = format!(
        "{}: no scenario file here or in the folders below; looked for names with {} (`evodrive formats` says what each is)",
        listed(folders),
        SCENARIO_ENDINGS.join(", ")
    );
    let (pools, rest): (Vec<_>, Vec<_>) =
        others.iter().cloned().partition(|path| path.extension().is_some_and(|ending| ending == "pool"));
    match (pools.as_slice(), rest.as_slice()) {
        ([], []) => text += "; no file at all was found",
        ([], [first, ..]) => text += &format!("; found {} other files, e.g. {}", rest.len(), first.display()),
        (pools, _) => text += &format!("; a pool is named itself, not its folder: {}", listed(pools)),
    }
    ExperimentError::Scenes(text)
}

/// Why nothing came of files, each reason once with the first file and how many others share it.
fn reasons(left_out: &[LeftOut]) -> Vec<String> {
    let (mut shared, mut places): (Vec<(&LeftOut, usize)>, BTreeMap<&str, usize>) = Default::default();
    for left in left_out {
        match places.get(left.reason.as_str()) {
            Some(&place) => shared[place].1 += 1,
            None => {
                places.insert(&left.reason, shared.len());
                shared.push((left, 0));
            }
        }
    }
    let line = |(first, others): (&LeftOut, usize)| match others {
        0 => format!("  {}: {}", first.file, first.reason),
        _ => format!("  {} and {others} more: {}", first.file, first.reason),
    };
    shared.into_iter().map(line).collect()
}

/// Imports files and folders. What cannot be used is left out with its reason; nothing usable at all is an error. A
/// thread has one file in memory at a time.
fn import(paths: &[PathBuf], reading: Reading, threads: &Threads) -> Result<Pool, ExperimentError> {
    let mut files: Vec<(String, PathBuf)> = Vec::new();
    let mut others: Vec<PathBuf> = Vec::new();
    for path in paths {
        for file in store::list_files(path, &[])? {
            let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            // A file that is named itself is read whatever its name is.
            if *path == file || is_scenario_file(&name) { files.push((name, file)) } else { others.push(file) }
        }
    }
    if files.is_empty() {
        return Err(nothing_in(paths, &others));
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
        Ok(bytes) => summary::read_file(name, &bytes, beside.as_ref(), reading.conventions),
        Err(error) => FileScenes::left_out(name, error.to_string()),
    });
    let summary = summary::summed(files.into_iter().map(|(name, _)| name).zip(read), reading.same_id);
    if summary.scenes.is_empty() {
        return Err(unusable(format!("no scene could be imported:\n{}", reasons(&summary.left_out).join("\n"))));
    }
    let pool = Pool::new(summary.scenes, summary.left_out).map_err(unusable)?;
    Ok(Pool { seals_provenance: true, ..pool })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Why nothing comes from a folder with these files.
    fn refused(files: &[&str]) -> String {
        let dir = tempfile::tempdir().unwrap();
        for name in files {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "no scenario").unwrap();
        }
        let error = read_scenes(&[dir.path().to_path_buf()], &Threads::new(1).unwrap()).unwrap_err().to_string();
        error.replace(dir.path().to_str().unwrap(), "DIR")
    }

    #[test]
    fn a_folder_without_a_scenario_file_says_what_was_looked_for_and_what_is_there() {
        let empty = refused(&[]);
        assert!(empty.starts_with("DIR: no scenario file here or in the folders below; looked for"), "{empty}");
        for ending in SCENARIO_ENDINGS {
            assert!(empty.contains(ending), "{ending}: {empty}");
        }
        assert!(empty.ends_with("no file at all was found"), "{empty}");
        let others = refused(&["a/notes.txt", "b.csv"]);
        assert!(others.ends_with("found 2 other files, e.g. DIR/a/notes.txt"), "{others}");
        let pool = refused(&["notes.txt", "mine.pool"]);
        assert!(pool.ends_with("a pool is named itself, not its folder: DIR/mine.pool"), "{pool}");
    }

    #[test]
    fn a_file_with_a_scenarios_name_is_looked_into_also_where_waymo_numbers_it() {
        let said = refused(&["training.tfrecord-00000-of-01000"]);
        assert!(said.starts_with("no scene could be imported:\n  training.tfrecord-00000-of-01000: "), "{said}");
    }
}
