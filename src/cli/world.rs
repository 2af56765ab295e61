//! `world`: how good the world evaluator of a run was.

use clap::Args;
use serde_json::json;
use std::path::PathBuf;

use super::answer::Answer;
use super::exit::Failure;
use super::folder::RunFolder;
use super::run_name::OneRun;
use crate::evidence::evaluator::{report, text};

#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    pub run: OneRun,
    /// A run of the same lineages with the full budget, for comparing hypervolume and rollouts.
    #[arg(long)]
    pub full: Option<PathBuf>,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let run = options.run.folder()?.story()?;
    let full = options.full.as_deref().map(|dir| RunFolder::find(Some(dir))?.story()).transpose()?;
    let found = report(&run, full.as_ref());
    Ok(Answer::new(text(&found), json!(found)))
}
