//! Downstream study files: which generators, which scenes, which arms, and how an ego learns.

use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::scenes::pool_of;
use super::training_file::apart;
use super::{ExperimentError, ProgramFile, SceneSource, toml_file};
use crate::ego::Setting;
use crate::kernel::{Digest, Threads};
use crate::learn::{Reward, SacOptions, TrainingOptions};
use crate::objects::downstream::SetName;
use crate::scene::Pool;

/// Number of scenes in a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetSizes {
    /// Of every set to train on.
    pub training: usize,
    /// Of every set to examine by.
    pub evaluation: usize,
}

/// One way to train.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arm {
    pub name: String,
    /// Its episodes are drawn evenly from all scenes of these sets.
    pub trains_on: Vec<SetName>,
}

/// How an ego learns: `[training]` of a training file without the seed, and without a rule that keeps one of several actors, since
/// the last one is what a study reports.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    pub setting: Setting,
    pub updates: u64,
    /// Number of these updates that are made on the plain set, once per seed for all arms: the arms go on from there, with its replay buffer.
    #[serde(default, skip_serializing_if = "is_none")]
    pub plain_updates: u64,
    pub steps_per_update: u64,
    pub steps_before: u64,
    pub episodes_per_round: usize,
    pub buffer: usize,
    /// Updates between two examinations.
    pub evaluate_every: u64,
    /// As in a training file: the average of the actors is examined in place of the present one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub average: Option<f64>,
    pub sac: SacOptions,
    pub reward: Reward,
}

fn is_none(updates: &u64) -> bool {
    *updates == 0
}

impl Schedule {
    /// The training of one seed.
    pub fn training(&self, seed: u64) -> TrainingOptions {
        let Schedule {
            setting,
            updates,
            plain_updates: _,
            steps_per_update,
            steps_before,
            episodes_per_round,
            buffer,
            evaluate_every,
            average,
            sac,
            reward,
        } = *self;
        // Nobody asks which actor was best.
        let (crash_rate_max, route_completion_min) = (1.0, 0.0);
        TrainingOptions {
            seed,
            setting,
            updates,
            steps_per_update,
            steps_before,
            episodes_per_round,
            buffer,
            evaluate_every,
            crash_rate_max,
            route_completion_min,
            average,
            learning_rate_last: None,
            sac,
            reward,
        }
    }
}

/// A whole study file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DownstreamFile {
    /// Lower-case letters, digits, `-` and `_`.
    pub name: String,
    /// One sentence for tables and figures.
    pub describes: String,
    /// File of `evodrive program export`, relative to this one: its parent and its program are the generators, and scenes are
    /// simulated, and planned for, under its conditions.
    pub program: PathBuf,
    /// Place of the study's record, relative to this file.
    pub record: PathBuf,
    /// One training per seed and arm.
    pub seeds: Vec<u64>,
    /// Scenes to train on: twice as many as a set has, and some more, since a program acts not everywhere.
    pub scenes: SceneSource,
    /// Scenes to examine by.
    pub evaluation: SceneSource,
    pub sets: SetSizes,
    /// An ego for each of SafeBench's traffic families, as ChatScene fine-tunes them; sets have their sizes a family then.
    #[serde(default)]
    pub by_family: bool,
    #[serde(rename = "arm")]
    pub arms: Vec<Arm>,
    pub training: Schedule,
    /// The file that it was read from.
    #[serde(skip)]
    pub file: PathBuf,
}

impl DownstreamFile {
    /// Reads a study file and checks every option.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or an option is unknown, missing or out of its range.
    pub fn read(path: &Path) -> Result<DownstreamFile, ExperimentError> {
        let mut file: DownstreamFile = toml_file::read(path, "downstream study")?;
        let refuse = |problem: String| Err(toml_file::problem(path, problem));
        toml_file::check_name(path, &file.name)?;
        for (what, found) in [("training", file.sets.training), ("evaluation", file.sets.evaluation)] {
            if !(1..=100_000).contains(&found) {
                return refuse(format!("sets.{what} is {found}, expected 1 to 100000"));
            }
        }
        if file.seeds.is_empty() || file.seeds.iter().collect::<BTreeSet<_>>().len() < file.seeds.len() {
            return refuse(format!("seeds is {:?}, expected at least one and none twice", file.seeds));
        }
        let mut names = BTreeSet::new();
        for (i, arm) in file.arms.iter().enumerate() {
            toml_file::check_name(path, &arm.name)?;
            if !names.insert(&arm.name) {
                return refuse(format!(
                    "arm[{i}].name is {:?}, which an earlier arm has; give it another name",
                    arm.name
                ));
            }
            if arm.trains_on.is_empty() || arm.trains_on.iter().collect::<BTreeSet<_>>().len() < arm.trains_on.len() {
                return refuse(format!(
                    "arm[{i}].trains_on is empty or names a set twice; expected some of plain, benign, original, evolved"
                ));
            }
        }
        if file.arms.is_empty() {
            return refuse("there is no [[arm]]; give at least one".into());
        }
        let seed = file.seeds[0];
        if file.training.plain_updates >= file.training.updates {
            let (plain, all) = (file.training.plain_updates, file.training.updates);
            return refuse(format!("training.plain_updates is {plain}, expected less than training.updates, {all}"));
        }
        file.training.training(seed).check().map_err(|error| toml_file::problem(path, error))?;
        file.file = path.to_path_buf();
        Ok(file)
    }

    /// A path of the file, from where the program runs.
    pub fn beside(&self, path: &Path) -> PathBuf {
        self.file.parent().unwrap_or(Path::new(".")).join(path)
    }

    /// The program file that it names.
    ///
    /// # Errors
    /// A file that is not a program file, or that holds a parent only.
    pub fn generators(&self) -> Result<ProgramFile, ExperimentError> {
        let path = self.beside(&self.program);
        let read = ProgramFile::read(&path)
            .map_err(|error| toml_file::problem(&self.file, format!("program is {:?}: {error}", self.program)))?;
        if read.is_parent() {
            Err(toml_file::problem(
                &self.file,
                format!("program is {:?}, which is a parent itself; name an evolved program", self.program),
            ))
        } else {
            Ok(read)
        }
    }

    /// Its pools: to train on, and to examine by.
    ///
    /// # Errors
    /// Scenes that cannot be read or generated; a scene that is in both, or on which the program was evolved.
    pub fn pools(&self, program: &ProgramFile, threads: &Threads) -> Result<[Pool; 2], ExperimentError> {
        let beside = |path: &Path| self.beside(path);
        let [training, evaluation] = [&self.scenes, &self.evaluation].map(|source| pool_of(source, &beside, threads));
        let (training, evaluation) = (training?, evaluation?);
        apart(&self.file, "evaluation", &training, &evaluation)?;
        for (table, pool) in [("scenes", &training), ("evaluation", &evaluation)] {
            if let Some(scene) = pool.scenes.iter().find(|scene| program.evolution_scenes.contains(&scene.digest())) {
                let problem = format!(
                    "[{table}] holds scene {}, on which the program was evolved; name scenes that it never saw",
                    scene.id
                );
                return Err(toml_file::problem(&self.file, problem));
            }
        }
        Ok([training, evaluation])
    }

    /// Digest of all that the trainings depend on: schedule, arms, seeds, program, and the digests of the sets.
    ///
    /// # Errors
    /// Options that have no canonical form.
    pub fn recipe(&self, program: &ProgramFile, sets: &[Digest]) -> Result<Digest, ExperimentError> {
        let content = (&self.training, &self.arms, &self.seeds, self.sets, program.digest, sets);
        Digest::of("evodrive/downstream/1", &content).map_err(|error| toml_file::problem(&self.file, error))
    }
}
