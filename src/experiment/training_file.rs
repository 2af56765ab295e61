//! Training files: on which scenes an ego learns, by which rules, and how long.

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

use super::scenes::pool_of;
use super::{ExperimentError, SceneSource};
use crate::kernel::{Digest, Threads};
use crate::learn::TrainingOptions;
use crate::scene::Pool;
use crate::sim::SimulatorOptions;
use crate::store;

/// Bytes that a training file may have.
const FILE_BYTES_MAX: u64 = 1 << 20;

/// A whole training file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingFile {
    /// Lower-case letters, digits, `-` and `_`: it names the weights.
    pub name: String,
    /// One sentence for the card.
    pub describes: String,
    /// What is known to go wrong with the weights that came of it, for the card; no part of the recipe.
    #[serde(default)]
    pub known_faults: Vec<String>,
    /// Scenes to learn on.
    pub scenes: SceneSource,
    /// Scenes by which actors are compared. They must not be those of the protocol's held-out set.
    pub validation: SceneSource,
    /// Under which rules scenes are simulated.
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
    /// What cannot be read; an option that is unknown, missing or out of its range.
    pub fn read(path: &Path) -> Result<TrainingFile, ExperimentError> {
        let problem = |problem: String| ExperimentError::File { file: path.display().to_string(), problem };
        let bytes = store::read_bounded(path, FILE_BYTES_MAX)?;
        let text =
            String::from_utf8(bytes).map_err(|_| problem("is no UTF-8; a training file is a text file".into()))?;
        let read: Result<TrainingFile, toml::de::Error> = toml::from_str(&text);
        let mut file = read.map_err(|error| problem(error.to_string().trim_end().to_string()))?;
        let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
        if file.name.is_empty() || !file.name.chars().all(fits) {
            return Err(problem(format!("name is {:?}, expected lower-case letters, digits, - and _", file.name)));
        }
        file.training.check().map_err(|error| problem(error.to_string()))?;
        file.simulator.check().map_err(|error| problem(error.to_string()))?;
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
        if let Some(both) = validation.scenes.iter().find(|scene| training.scenes.contains(scene)) {
            let problem = format!("[validation] holds scene {}, which [scenes] holds too; name another seed", both.id);
            return Err(ExperimentError::File { file: self.file.display().to_string(), problem });
        }
        Ok([training, validation])
    }

    /// Digest of all that the weights depend on.
    ///
    /// # Errors
    /// Options that have no canonical form.
    pub fn recipe(&self, pools: &[Pool; 2]) -> Result<Digest, ExperimentError> {
        let content = (&self.training, &self.simulator, pools.each_ref().map(Pool::digest));
        Digest::of("evodrive/training/1", &content).map_err(|error| ExperimentError::File {
            file: self.file.display().to_string(),
            problem: error.to_string(),
        })
    }
}
