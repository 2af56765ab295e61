//! Training files: on which scenes an ego learns, by which rules, and how long.

use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::scenes::pool_of;
use super::{ExperimentError, SceneSource, toml_file};
use crate::kernel::{Digest, Threads};
use crate::learn::TrainingOptions;
use crate::scene::{Pool, Scene};
use crate::sim::SimulatorOptions;

/// A whole training file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingFile {
    /// Lower-case letters, digits, `-` and `_`: it names the weights.
    pub name: String,
    /// One sentence for the card.
    pub describes: String,
    /// Known faults of the weights that came of it, for the card; no part of the recipe.
    #[serde(default)]
    pub known_faults: Vec<String>,
    /// Scenes to learn on.
    pub scenes: SceneSource,
    /// Scenes by which actors are compared. They must not be those of the protocol's held-out set.
    pub validation: SceneSource,
    /// Rules under which scenes are simulated.
    pub simulator: SimulatorOptions,
    pub training: TrainingOptions,
    /// The file that it was read from.
    #[serde(skip)]
    pub file: PathBuf,
}

impl TrainingFile {
    /// Reads a training file and checks every option.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or an option is unknown, missing or out of its range.
    pub fn read(path: &Path) -> Result<TrainingFile, ExperimentError> {
        let mut file: TrainingFile = toml_file::read(path, "training")?;
        toml_file::check_name(path, &file.name)?;
        file.training.check().map_err(|error| toml_file::problem(path, error))?;
        file.simulator.check().map_err(|error| toml_file::problem(path, error))?;
        file.file = path.to_path_buf();
        Ok(file)
    }

    /// Its pools: to learn on, and to compare by.
    ///
    /// # Errors
    /// Scenes that cannot be read or generated; a scene that is in both.
    pub fn pools(&self, threads: &Threads) -> Result<[Pool; 2], ExperimentError> {
        let beside = |path: &Path| self.file.parent().unwrap_or(Path::new(".")).join(path);
        let [training, validation] = [&self.scenes, &self.validation].map(|source| pool_of(source, &beside, threads));
        let (training, validation) = (training?, validation?);
        apart(&self.file, "validation", &training, &validation)?;
        Ok([training, validation])
    }

    /// Digest of all that the weights depend on.
    ///
    /// # Errors
    /// Options that have no canonical form.
    pub fn recipe(&self, pools: &[Pool; 2]) -> Result<Digest, ExperimentError> {
        let content = (&self.training, &self.simulator, pools.each_ref().map(Pool::digest));
        Digest::of("evodrive/training/1", &content).map_err(|error| toml_file::problem(&self.file, error))
    }
}

/// Checks that no scene to learn on is one to compare by.
///
/// # Errors
/// The first scene that is in both; `table` is the one of the second pool.
pub fn apart(file: &Path, table: &str, training: &Pool, other: &Pool) -> Result<(), ExperimentError> {
    let known: BTreeSet<Digest> = training.scenes.iter().map(Scene::digest).collect();
    match other.scenes.iter().find(|scene| known.contains(&scene.digest())) {
        None => Ok(()),
        Some(both) => {
            let problem = format!("[{table}] holds scene {}, which [scenes] holds too; name another seed", both.id);
            Err(toml_file::problem(file, problem))
        }
    }
}
