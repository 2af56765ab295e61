//! Sources of a run's rollouts when its experiment names another simulator: its rollout cassette, or the workers.

use std::path::{Path, PathBuf};

use crate::backend::{Answers, Backend, BackendOptions, DriverOptions, Header, Planners, Replay, RolloutCassette};
use crate::cli::cluster::worker_process::Processes;
use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::exit::Failure;
use crate::ego::Policy;
use crate::experiment::{Experiment, named_driver};
use crate::sim::SimulatorOptions;

/// Rollouts for a run: of our own simulator, or of another one by its answers.
pub fn backend<'a>(experiment: &'a Experiment, answers: Option<&'a dyn Answers>) -> Backend<'a> {
    match (&experiment.simulator.backend, answers) {
        (Some(options), Some(answers)) => Backend::Other { options, answers },
        _ => Backend::Own,
    }
}

/// A planner that is asked now, and whose answers are not recorded.
pub struct Asked {
    driver: DriverOptions,
    options: BackendOptions,
    processes: Processes,
}

impl Asked {
    /// A program, or the one that a TOML file's table `[driver]` names.
    pub fn named(path: &Path, simulator: &SimulatorOptions) -> Result<Asked, Failure> {
        let driver = named_driver(path)?;
        let options = driver.backend(simulator).map_err(Failure::internal)?;
        Ok(Asked { driver, options, processes: Processes::default() })
    }

    /// The same with another time limit for a decision, seconds, where one is given.
    pub fn within(mut self, limit_s: Option<f64>) -> Result<Asked, Failure> {
        if let Some(limit_s) = limit_s {
            if !(0.001..=3600.0).contains(&limit_s) {
                return Err(Failure::bad_input(format!(
                    "--time-limit is {limit_s}, expected a number of seconds from 0.001 to 3600"
                )));
            }
            self.driver.timeout_s = limit_s;
        }
        Ok(self)
    }

    pub fn ego(&self) -> Result<Policy, Failure> {
        self.driver.policy().ok_or_else(|| Failure::internal("a program whose digest cannot be computed"))
    }

    /// Its processes; none is started yet.
    pub fn planners(&self) -> Planners<'_> {
        Planners::new(&self.driver, &self.processes)
    }
}

/// Returns the backend that simulates, with a planner that is asked now or without one.
pub fn asked<'a>(asked: Option<&'a Asked>, planners: Option<&'a Planners<'a>>) -> Backend<'a> {
    match (asked, planners) {
        (Some(asked), Some(planners)) => Backend::Other { options: &asked.options, answers: planners },
        _ => Backend::Own,
    }
}

/// Returns the path of an experiment's rollout cassette.
pub fn path(experiment: &Experiment) -> Option<PathBuf> {
    experiment.simulator.backend.as_ref().map(|backend| experiment.beside(&backend.cassette))
}

/// The recorded rollouts of an experiment; `remedy` is the command that would record them.
pub fn replay(experiment: &Experiment, remedy: &str) -> Result<Option<Replay>, Failure> {
    let (Some(options), Some(path)) = (&experiment.simulator.backend, path(experiment)) else { return Ok(None) };
    Ok(Some(Replay::new(load(options, &path, remedy)?, remedy)))
}

/// The recorded rollouts in a run folder.
pub fn replay_of(experiment: &Experiment, folder: &RunFolder) -> Result<Option<Replay>, Failure> {
    let Some(options) = &experiment.simulator.backend else { return Ok(None) };
    let remedy = format!("evodrive record with the experiment of {}", folder.dir.display());
    Ok(Some(Replay::new(load(options, &folder.rollouts(), &remedy)?, remedy)))
}

/// Reads what was recorded before at a place; nothing if there is no file, or if everything is asked anew.
pub fn recorded(options: &BackendOptions, path: &Path, fresh: bool) -> Result<RolloutCassette, Failure> {
    if fresh || !path.exists() {
        return Ok(RolloutCassette::new(path.display().to_string(), Header::of(options)));
    }
    let cassette = RolloutCassette::load(path)?;
    cassette.check(options)?;
    Ok(cassette)
}

fn load(options: &BackendOptions, path: &Path, remedy: &str) -> Result<RolloutCassette, Failure> {
    let cassette = RolloutCassette::load(path).map_err(|error| {
        let failure = Failure::from(error);
        Failure { message: format!("{}\n  to record it: {remedy}", failure.message), ..failure }
    })?;
    cassette.check(options)?;
    Ok(cassette)
}
