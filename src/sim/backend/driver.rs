//! A planner of the experimenter's own as the ego, as an experiment file declares it: the table `[driver]`. Our simulator
//! plays the rollout and asks the planner at every decision; the motion is recorded like that of another simulator.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::spec::{BLIND, BackendOptions, DRIVER, PlanAround, WorkerOptions};
use crate::ego::{Policy, Setting};
use crate::kernel::{Digest, canon::CanonError};
use crate::sim::{SIM_VERSION, SimulatorOptions};

/// Version of the lines between a rollout and a planner; part of every key.
pub const DRIVER_PROTOCOL: u32 = 1;

/// The table `[driver]`: the program behind the ego `command`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriverOptions {
    /// Program and arguments; started in the folder of the experiment file.
    pub command: Vec<String>,
    /// Files whose bytes, with the arguments, are the planner's identity; relative to the experiment file.
    pub files: Vec<PathBuf>,
    /// File of the recorded rollouts, relative to the experiment file. It counts into no key.
    pub cassette: PathBuf,
    /// Longest time for one decision, s. It counts into no key.
    #[serde(default = "timeout_s")]
    pub timeout_s: f64,
    /// Most processes at once, beside those that play again; no more than `--jobs` are busy. It counts into no key.
    #[serde(default = "processes")]
    pub processes: usize,
    /// Share of the rollouts that another process plays again when they are recorded. It counts into no key.
    #[serde(default = "repeat_share")]
    pub repeat_share: f64,
    /// The observation that each step holds beside what every planner is told. It is part of the identity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observe: Option<Setting>,
    /// True if the planner is not told under which program it drives. It is part of the identity.
    #[serde(default = "blind", skip_serializing_if = "is_blind")]
    pub blind: bool,
    /// The planner's identity: [`DriverOptions::identity`]. Written by hand only where the files may be missing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub digest: Option<Digest>,
    /// The folder of the experiment file; empty in the copy that a run folder keeps.
    #[serde(default)]
    pub folder: PathBuf,
}

fn timeout_s() -> f64 {
    10.0
}

fn processes() -> usize {
    8
}

fn repeat_share() -> f64 {
    0.05
}

fn blind() -> bool {
    true
}

fn is_blind(blind: &bool) -> bool {
    *blind
}

impl DriverOptions {
    /// Returns the digest of everything that can change a planner's answer: the protocol, the arguments, name and digest of each file,
    /// and what it is told beyond the rest. The program's own name is left out, because it may be a path of one machine.
    ///
    /// # Errors
    /// None that a list of texts can cause.
    pub fn identity(
        command: &[String],
        files: &[(String, Digest)],
        observe: Option<Setting>,
        blind: bool,
    ) -> Result<Digest, CanonError> {
        let arguments = command.get(1..).unwrap_or_default();
        match (observe, blind) {
            // Planners from before there was a choice.
            (None, true) => Digest::of("evodrive/driver/1", &(DRIVER_PROTOCOL, arguments, files)),
            _ => {
                let observe = observe.map_or("", Setting::name);
                Digest::of("evodrive/driver/2", &(DRIVER_PROTOCOL, arguments, files, observe, blind))
            }
        }
    }

    /// Returns the ego.
    pub fn policy(&self) -> Option<Policy> {
        self.digest.map(Policy::Command)
    }

    /// Returns the name for readers: that of the first file, or of the program where no file is named.
    pub fn name(&self) -> String {
        let first =
            self.files.first().and_then(|file| file.file_name()).map(|name| name.to_string_lossy().into_owned());
        first.or_else(|| self.command.first().cloned()).unwrap_or_default()
    }

    /// Returns the folder of its files.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns the backend under which its rollouts are recorded. The rules of our simulator count into every key.
    pub fn backend(&self, simulator: &SimulatorOptions) -> Result<BackendOptions, CanonError> {
        let rules = Value::String(simulator.digest()?.to_hex());
        let mut options = BTreeMap::from([("rules".to_string(), rules)]);
        if !self.blind {
            options.insert(BLIND.into(), Value::Bool(false));
        }
        Ok(BackendOptions {
            name: DRIVER.into(),
            version: format!("{DRIVER_PROTOCOL}.{SIM_VERSION}"),
            digest: self.digest.unwrap_or_else(|| Digest::of_bytes(b"")),
            options,
            plan_around: PlanAround::Backend,
            cassette: self.cassette.clone(),
            worker: WorkerOptions {
                command: self.command.clone(),
                workers: self.processes,
                seconds: self.timeout_s,
                retries: 0,
                rollouts: None,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn a_planner_is_its_arguments_and_the_bytes_of_its_files_and_not_where_python_lies() {
        let command = |program: &str, speed: &str| vec![program.to_string(), "idm.py".into(), speed.into()];
        let file = |text: &str| [("idm.py".to_string(), Digest::of_bytes(text.as_bytes()))];
        let of = |command: &[String], text: &str| DriverOptions::identity(command, &file(text), None, true).unwrap();
        let first = of(&command("python3", "10"), "a");
        assert_eq!(first, of(&command("/opt/bin/python3.11", "10"), "a"));
        assert_ne!(first, of(&command("python3", "11"), "a"));
        assert_ne!(first, of(&command("python3", "10"), "b"));
        let ego = |digest| Policy::Command(digest).digest();
        assert_ne!(ego(first), ego(of(&command("python3", "10"), "b")), "the ego's digest is in every key");
        // A planner that is told more is another planner, and one that is told no more stays the same.
        let pinned = "ee4c82ed06488d0ea3cb39d8675881123a4b585040b40b8f8909c635b61c548c";
        assert_eq!(first.to_hex(), pinned);
        let heard =
            |observe, blind| DriverOptions::identity(&command("python3", "10"), &file("a"), observe, blind).unwrap();
        let all = [
            heard(None, true),
            heard(None, false),
            heard(Some(Setting::Metadrive1), true),
            heard(Some(Setting::Safebench1), true),
            heard(Some(Setting::Safebench1), false),
        ];
        assert_eq!((all[0], BTreeSet::from(all).len()), (first, all.len()));
    }
}
