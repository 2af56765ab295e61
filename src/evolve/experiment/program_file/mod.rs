//! Program files: one program with everything that it needs to be played elsewhere, as JSON, or as TOML for people. `read.rs`
//! says what is refused; docs/FORMAT.md is the format.

mod comments;
mod contract;
mod error;
mod finding;
mod hand;
mod lines;
mod parts;
mod published;
mod read;
pub mod safebench;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod toml_tests;
mod written;

pub use contract::ContractMark;
pub use error::{NotWritten, ProgramFileError};
pub use finding::Finding;
pub use lines::value_span;

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

use crate::backend::BackendOptions;
use crate::evaluation::EvaluationOptions;
use crate::families;
use crate::kernel::{Digest, canon::CanonError};
use crate::objects::event::Versions;
use crate::objects::{Counsel, FamilyName, Origin, ParameterValue, Program};
use crate::scene::Scene;
use crate::scene::safebench::TrafficFamily;
use crate::sim::SimulatorOptions;

/// Name and version of the format; another major version is refused.
pub const FORMAT: &str = "evodrive-program/1";

/// A program that left its run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramFile {
    pub format: String,
    /// Digest of all that follows.
    pub digest: Digest,
    /// b
    pub family: FamilyName,
    /// Mark of the contract on what the program may contain, as its run knew it.
    pub contract: ContractMark,
    pub program: Program,
    /// Hash of the program's content.
    pub program_hash: Digest,
    /// Program that its lineage started from: composed and set as in the run.
    pub parent: Program,
    /// Parameters that the experiment set for that parent; they are in `parent` already.
    pub parent_settings: BTreeMap<String, ParameterValue>,
    /// How it was labelled.
    pub conditions: Conditions,
    /// Advice on who attacks, by scene; empty in families that take no counsel.
    pub counsel: BTreeMap<String, CarriedCounsel>,
    /// Control sequences of SafeBench that are played as they are in place of a search, by traffic family; only programs that
    /// were made of such a file have some.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub sequences: BTreeMap<TrafficFamily, Vec<f64>>,
    /// Digests of the scenes on which it was evolved, in all those runs: labels there say little about new traffic.
    pub evolution_scenes: BTreeSet<Digest>,
    /// The runs that it came out of, the oldest first.
    pub origins: Vec<Origin>,
}

/// Everything that a label depends on besides program and scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Conditions {
    /// Name of the ego policy.
    pub ego: String,
    /// Root of the random streams.
    pub seed: u64,
    /// Versions of meaning of the program that exported it.
    pub versions: Versions,
    pub simulator: SimulatorOptions,
    /// Simulator of the rollouts of its labels, if it was not our own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub backend: Option<BackendMark>,
    /// With the calibration written out.
    pub evaluation: EvaluationOptions,
}

/// Another simulator whose labels a program was evolved on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BackendMark {
    /// As its worker calls it.
    pub name: String,
    /// Version of the simulator behind the worker.
    pub version: String,
    /// Digest that the worker gave of its own code.
    pub digest: Digest,
}

impl BackendMark {
    /// Returns what a program file says of an experiment's backend.
    pub fn of(backend: &BackendOptions) -> BackendMark {
        BackendMark { name: backend.name.clone(), version: backend.version.clone(), digest: backend.digest }
    }
}

/// The counsel of one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CarriedCounsel {
    /// Digest of the scene: a scene of the same id with other content takes no counsel from here.
    pub scene: Digest,
    pub counsel: Counsel,
}

impl ProgramFile {
    /// The file with its digest.
    ///
    /// # Errors
    /// A number in it that is not finite.
    pub fn sealed(self) -> Result<ProgramFile, CanonError> {
        Ok(ProgramFile { digest: self.computed()?, ..self })
    }

    /// Returns `true` if the program is its lineage's parent itself.
    pub fn is_parent(&self) -> bool {
        self.program.solution_id == self.parent.solution_id
    }

    /// The counsel for a scene: what was taken there, or the sequence of its traffic family. A scene that is no longer what it was
    /// takes none.
    pub fn counsel_in(&self, scene: &Scene, digest: Digest) -> Option<Counsel> {
        let carried = self.counsel.get(&scene.id).filter(|carried| carried.scene == digest);
        let profile = || self.sequences.get(&scene.staging.as_ref()?.family);
        match carried {
            Some(carried) => Some(carried.counsel.clone()),
            None => Some(Counsel { profile: profile()?.clone(), ..Counsel::default() }),
        }
    }

    /// Returns `true` if programs of its family are compiled with counsel where there is some.
    pub fn takes_counsel(&self) -> bool {
        families::sources_by_hand().get(&self.family).is_some_and(|source| source.asks.counsel.is_some())
    }

    /// Digest of everything but the digest itself.
    fn computed(&self) -> Result<Digest, CanonError> {
        let content = ProgramFile { digest: Digest::of_bytes(&[]), ..self.clone() };
        Digest::of("evodrive/program-file/1", &content)
    }

    /// Its bytes: the same for the same content.
    ///
    /// # Errors
    /// None for a file that was sealed or read: its numbers are finite and its keys are texts.
    pub fn to_bytes(&self) -> Result<Vec<u8>, serde_json::Error> {
        let mut bytes = serde_json::to_vec_pretty(self)?;
        bytes.push(b'\n');
        Ok(bytes)
    }
}
