//! The run that work is planned for or merged into.

use clap::Args;
use std::path::PathBuf;

use crate::cli::evolve::job_args::JobArgs;
use crate::cli::evolve::{behind, held::Held, run::Job};
use crate::cli::records::{folder::RunFolder, run_name::OneRun};
use crate::cli::terminal::exit::Failure;

/// Which run work is planned for or merged into.
#[derive(Debug, Args)]
pub struct TargetOptions {
    /// Experiment file (.toml), or run: its folder, its name below runs/, or the beginning of either; without it the run that is
    /// not finished, or else the latest.
    #[arg(value_name = "EXPERIMENT|RUN")]
    pub run: Option<PathBuf>,
    /// The run as an option.
    #[arg(id = "run_option", long = "run", value_name = "RUN", conflicts_with = "run")]
    pub option: Option<PathBuf>,
    /// Folder for run folders, with an experiment file.
    #[arg(long, default_value = "runs")]
    pub out: PathBuf,
    /// Scenario files, folders or a pool, instead of the experiment's scenes.
    #[arg(long, num_args = 1..)]
    pub scenes: Vec<PathBuf>,
}

/// A run with the files that it starts from.
pub struct Target {
    pub job: Job,
    pub folder: RunFolder,
    /// Recorded answers of models.
    pub cassette: PathBuf,
    /// File for recorded rollouts of another simulator.
    pub rollouts: Option<PathBuf>,
    /// Path by which people name it.
    pub named: PathBuf,
    /// The folder's lock and store.
    pub held: Held,
}

impl Target {
    /// A run folder, or the one of an experiment, which is made.
    pub fn of(options: &TargetOptions, jobs: usize) -> Result<Target, Failure> {
        let experiment = options.run.clone().filter(|path| path.extension().is_some_and(|ending| ending == "toml"));
        let Some(experiment) = experiment else {
            let run = options.run.as_ref().or(options.option.as_ref());
            let folder = run.map(|dir| OneRun::of(dir)).unwrap_or_default().unfinished_or_latest()?;
            let named = folder.dir.clone();
            let job = Job::of_folder(&folder, jobs)?;
            let rollouts = job.experiment.simulator.backend.as_ref().map(|_| folder.rollouts());
            let held = Held::of(folder.clone())?;
            return Ok(Target { job, cassette: folder.cassette(), rollouts, folder, named, held });
        };
        let (named, out, scenes) = (experiment.clone(), options.out.clone(), options.scenes.clone());
        let job = Job::new(&JobArgs { experiment, out, cassette: None, scenes, set: vec![] }, jobs)?;
        let held = job.open_folder(None)?;
        let folder = held.folder.clone();
        let (cassette, rollouts) = (job.experiment.beside(&job.experiment.cassette), behind::path(&job.experiment));
        Ok(Target { job, folder, cassette, rollouts, named, held })
    }
}
