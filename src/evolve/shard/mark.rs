//! Mark of the study that a shard belongs to: everything that could make the same task come out differently.

use serde::{Deserialize, Serialize};

use super::error::ShardError;
use crate::adapters::ADAPTER_VERSION;
use crate::backend::Header;
use crate::epoch::Study;
use crate::evaluation::EVAL_VERSION;
use crate::kernel::Digest;
use crate::objects::event::Versions;
use crate::sim::SIM_VERSION;

/// The study that work belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyMark {
    pub name: String,
    pub experiment: Digest,
    pub pool: Digest,
    /// Versions of meaning of the program.
    pub versions: Versions,
    /// Simulator of the rollouts, where it is not ours.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub backend: Option<Header>,
}

impl StudyMark {
    pub fn of(study: &Study) -> StudyMark {
        StudyMark {
            name: study.name.clone(),
            experiment: study.experiment,
            pool: study.pool_digest,
            versions: Versions { adapter: ADAPTER_VERSION, sim: SIM_VERSION, eval: EVAL_VERSION },
            backend: study.backend.as_ref().map(Header::of),
        }
    }

    /// Refuses a file of another study than this one.
    pub fn check(&self, found: &StudyMark, file: &str) -> Result<(), ShardError> {
        let versions = |mark: &StudyMark| {
            let Versions { adapter, sim, eval } = mark.versions;
            format!("adapter {adapter}, sim {sim}, eval {eval}")
        };
        let backend = |mark: &StudyMark| serde_json::to_string(&mark.backend).unwrap_or_default();
        let build = "use the same release of evodrive on all machines";
        let other =
            "name the run that it was planned for, or the folder with that run's experiment.toml and scenes.pool";
        let fields = [
            ("versions", versions(self), versions(found), build),
            ("experiment", self.experiment.to_hex(), found.experiment.to_hex(), other),
            ("pool", self.pool.to_hex(), found.pool.to_hex(), other),
            ("backend", backend(self), backend(found), other),
        ];
        match fields.into_iter().find(|(_, expected, found, _)| expected != found) {
            None => Ok(()),
            Some((field, expected, found, remedy)) => {
                Err(ShardError::Foreign { file: file.to_string(), field, expected, found, remedy })
            }
        }
    }
}
