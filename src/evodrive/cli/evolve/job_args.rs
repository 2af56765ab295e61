//! Arguments that `run`, `plan` and `record` share: the experiment, and from which answers it is carried out.

use clap::Args;
use std::path::PathBuf;

use crate::cli::records::{folder::RUNS, run_name::OneRun};

/// Experiment to carry out, and the answers to use.
#[derive(Debug, Args)]
pub struct JobArgs {
    /// Experiment file, e.g. experiments/quickstart.toml.
    pub experiment: PathBuf,
    /// Folder for run folders.
    #[arg(long, default_value = RUNS)]
    pub out: PathBuf,
    /// Cassette to replay from, instead of the experiment's.
    #[arg(long)]
    pub cassette: Option<PathBuf>,
    /// Scenario files, folders or a pool, instead of the experiment's scenes.
    #[arg(long, num_args = 1..)]
    pub scenes: Vec<PathBuf>,
    /// A value above the file's, e.g. budget.slots=8; it is kept in the run's experiment. May be given again.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

#[derive(Debug, Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub job: JobArgs,
    /// Do not write report.html.
    #[arg(long)]
    pub no_report: bool,
}

#[derive(Debug, Args)]
pub struct RecordArgs {
    #[command(flatten)]
    pub run: RunArgs,
    /// Ask everything anew, also what the cassette holds already.
    #[arg(long)]
    pub fresh: bool,
    /// Write over cassettes though they hold answers or rollouts that this recording does not ask for.
    #[arg(long)]
    pub overwrite: bool,
    /// Questions to models that are open together, of all lineages of an epoch [default: 256 where a model is asked through files
    /// (`exchange`), else as many as there are threads].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    pub open: Option<u16>,
}

#[derive(Debug, Args)]
pub struct ResumeArgs {
    #[command(flatten)]
    pub run: OneRun,
    /// Cassette for the recording, instead of the one that it was begun for.
    #[arg(long, value_name = "FILE")]
    pub cassette: Option<PathBuf>,
    /// Number of questions of a recording that are open together, as in `record`.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=4096))]
    pub open: Option<u16>,
}
