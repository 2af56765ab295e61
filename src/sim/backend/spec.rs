//! What an experiment file says about a backend: the table `[simulator.backend]`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::kernel::{Digest, canon::CanonError};

/// The table `[simulator.backend]`: another simulator than ours.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BackendOptions {
    /// As the worker calls it.
    pub name: String,
    /// Of the simulator behind the worker.
    pub version: String,
    /// What the worker says of its own code.
    pub digest: Digest,
    /// Handed to the worker with every request.
    #[serde(default)]
    pub options: BTreeMap<String, Value>,
    /// Around whose drive families plan.
    #[serde(default)]
    pub plan_around: PlanAround,
    /// File of the recorded rollouts, relative to the experiment file. It counts into no key.
    pub cassette: PathBuf,
    /// How it is reached when rollouts are recorded. It counts into no key.
    pub worker: WorkerOptions,
}

/// Whose undisturbed drive of the ego the situation holds for which families plan.
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
    /// Processes at once, at most.
    pub workers: usize,
    /// Longest time for an answer, s.
    pub seconds: f64,
    /// How often a request is sent again after a worker ended or was too slow.
    pub retries: u32,
    /// After how many rollouts a process is replaced by a new one, for a simulator that keeps memory; never without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rollouts: Option<u32>,
}

impl BackendOptions {
    /// What of it can change an answer: name, version, options and the worker's own digest.
    pub fn key(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/backend/1", &(&self.name, &self.version, self.digest, &self.options))
    }

    /// What of it can change an answer or what is asked: [`BackendOptions::key`] and whose ego is planned around.
    pub fn rules(&self) -> Result<Digest, CanonError> {
        match self.plan_around {
            // Recorded runs from before there was a choice.
            PlanAround::Evodrive => self.key(),
            PlanAround::Backend => Digest::of("evodrive/backend-planned/1", &self.key()?),
        }
    }

    /// Whether it is our own simulator with a planner of the experimenter's own as the ego.
    pub fn drives(&self) -> bool {
        self.name == DRIVER
    }

    /// Whether whoever drives is not told under which program: all but planners that ask for it.
    pub fn is_blind(&self) -> bool {
        is_blind(&self.name, &self.options)
    }

    /// The same backend without the parts that change no answer.
    pub fn content(&self) -> BackendOptions {
        let worker = WorkerOptions { command: Vec::new(), workers: 1, seconds: 1.0, retries: 0, rollouts: None };
        BackendOptions { cassette: PathBuf::new(), worker, ..self.clone() }
    }

    /// The first field that is out of bounds: its name, what was found and what is expected.
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

/// Whether a driver by that name and with those options is not told under which program it drives.
pub(super) fn is_blind(name: &str, options: &BTreeMap<String, Value>) -> bool {
    name != DRIVER || options.get(BLIND) != Some(&Value::Bool(false))
}

/// The name under which rollouts of our own simulator with a planner are recorded.
pub(super) const DRIVER: &str = "evodrive-driver";
/// The option of such rollouts that is false where the planner is told under which program it drives.
pub(super) const BLIND: &str = "blind";
/// The name of our own simulator in experiment files.
pub const OWN: &str = "evodrive";
