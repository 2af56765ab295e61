//! A backend in an experiment file: the table `[simulator.backend]`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::kernel::{Digest, canon::CanonError};

/// The table `[simulator.backend]`: another simulator than ours.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BackendOptions {
    /// Name by which the worker calls itself.
    pub name: String,
    /// Version of the simulator behind the worker.
    pub version: String,
    /// Digest that the worker gives of its own code.
    pub digest: Digest,
    /// Handed to the worker with every request.
    #[serde(default)]
    pub options: BTreeMap<String, Value>,
    /// The ego around whose drive families plan.
    #[serde(default)]
    pub plan_around: PlanAround,
    /// File of the recorded rollouts, relative to the experiment file. It counts into no key.
    pub cassette: PathBuf,
    /// How the worker is reached when rollouts are recorded. It counts into no key.
    pub worker: WorkerOptions,
}

/// The ego whose undisturbed drive families plan around.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanAround {
    /// The ego of the simulator that judges.
    #[default]
    Backend,
    /// The ego of our own simulator, whoever judges: both then play the same commands.
    Evodrive,
}

/// The table `[simulator.backend.worker]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorkerOptions {
    /// Program and arguments.
    pub command: Vec<String>,
    /// Most processes at once.
    pub workers: usize,
    /// Longest time for an answer, s.
    pub seconds: f64,
    /// How often a request is sent again after a worker ended or was too slow.
    pub retries: u32,
    /// Rollouts after which a process is replaced by a new one, for a simulator that leaks memory; `None` for never.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rollouts: Option<u32>,
}

impl BackendOptions {
    /// Returns the digest of everything that can change an answer: name, version, options and the worker's own digest.
    pub fn key(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/backend/1", &(&self.name, &self.version, self.digest, &self.options))
    }

    /// Returns the digest of everything that can change an answer or a question: [`BackendOptions::key`] and the ego planned around.
    pub fn rules(&self) -> Result<Digest, CanonError> {
        match self.plan_around {
            // Keys of runs recorded before there was a choice.
            PlanAround::Evodrive => self.key(),
            PlanAround::Backend => Digest::of("evodrive/backend-planned/1", &self.key()?),
        }
    }

    /// Returns `true` if it is our own simulator with a planner of the experimenter's own as the ego.
    pub fn drives(&self) -> bool {
        self.name == DRIVER
    }

    /// Returns `true` if the driver is not told under which program it drives: all but planners that ask for it.
    pub fn is_blind(&self) -> bool {
        is_blind(&self.name, &self.options)
    }

    /// Returns the same backend without the parts that change no answer.
    pub fn content(&self) -> BackendOptions {
        let worker = WorkerOptions { command: Vec::new(), workers: 1, seconds: 1.0, retries: 0, rollouts: None };
        BackendOptions { cassette: PathBuf::new(), worker, ..self.clone() }
    }

    /// Returns the first field that is out of bounds: its name, the value found and the values expected.
    pub fn fault(&self) -> Option<(String, String, &'static str)> {
        let WorkerOptions { command, workers, seconds, retries, rollouts } = &self.worker;
        let word = |text: &str| (1..=64).contains(&text.chars().count());
        if !word(&self.name) || self.name == OWN {
            return Some((
                "name".into(),
                self.name.clone(),
                "1 to 64 characters, not `evodrive`, which needs no worker",
            ));
        }
        if !word(&self.version) {
            return Some(("version".into(), self.version.clone(), "1 to 64 characters"));
        }
        if command.first().is_none_or(String::is_empty) {
            return Some(("worker.command".into(), format!("{command:?}"), "a program and its arguments"));
        }
        if !(1..=64).contains(workers) {
            return Some(("worker.workers".into(), workers.to_string(), "1 to 64"));
        }
        // NaN lies in no range.
        if !(0.1..=86_400.0).contains(seconds) {
            return Some(("worker.seconds".into(), seconds.to_string(), "0.1 to 86400"));
        }
        if *rollouts == Some(0) {
            return Some((
                "worker.rollouts".into(),
                "0".into(),
                "1 or more; leave it out for a worker that is never replaced",
            ));
        }
        (*retries > 10).then(|| ("worker.retries".into(), retries.to_string(), "0 to 10"))
    }
}

/// Returns `true` if a driver of that name and with those options is not told under which program it drives.
pub(super) fn is_blind(name: &str, options: &BTreeMap<String, Value>) -> bool {
    name != DRIVER || options.get(BLIND) != Some(&Value::Bool(false))
}

/// The name under which rollouts of our own simulator with a planner are recorded.
pub(super) const DRIVER: &str = "evodrive-driver";
/// The option of such rollouts that is false where the planner is told under which program it drives.
pub(super) const BLIND: &str = "blind";
/// The name of our own simulator in experiment files.
pub const OWN: &str = "evodrive";
