//! `world`: how good the world evaluator of a run was.

use clap::Args;
use serde_json::json;
use std::path::PathBuf;

use crate::cli::records::{folder::RunFolder, run_name::OneRun};
use crate::cli::terminal::{answer::Answer, exit::Failure, width::stdout_width};
use crate::evidence::RecordedRun;
use crate::evidence::evaluator::{beside, report, text};

#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    pub run: OneRun,
    /// A run of the same lineages with the full budget, for comparing hypervolume and rollouts.
    #[arg(long)]
    pub full: Option<PathBuf>,
    /// A run of the same proposals with another evaluator, all simulated in both: compares the evaluators.
    #[arg(long, conflicts_with = "full")]
    pub beside: Option<PathBuf>,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let folder = options.run.folder()?;
    let run = folder.recorded()?;
    if let Some(other) = &options.beside {
        let other = RunFolder::find(Some(other))?.recorded()?;
        let reference = folder.read_experiment()?.archive.reference;
        let compared = beside([&run, &other], reference).map_err(Failure::bad_input)?;
        return Ok(Answer::new(compared.text(stdout_width().unwrap_or(usize::MAX)), json!(compared)));
    }
    let full = options.full.as_deref().map(|dir| RunFolder::find(Some(dir))).transpose()?;
    let with_reference = |folder: RunFolder| -> Result<(RecordedRun, [f64; 2]), Failure> {
        Ok((folder.recorded()?, folder.read_experiment()?.archive.reference))
    };
    let full = full.map(with_reference).transpose()?;
    let quality = report(&run, full.as_ref().map(|(full, reference)| (full, *reference)));
    Ok(Answer::new(text(&quality, stdout_width().unwrap_or(usize::MAX)), json!(quality)))
}
