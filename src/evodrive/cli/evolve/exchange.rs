//! `exchange`: what waits for a reply in the folders of a run's exchanges.

use clap::{Args, Subcommand};
use serde_json::json;
use std::path::PathBuf;

use crate::cli::records::{folder::RunFolder, run_name::OneRun};
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::llm::exchange::{Entry, status};
use crate::store;

#[derive(Debug, Subcommand)]
pub enum Command {
    /// List the questions that wait for a reply, and count those that were answered.
    Status(Options),
}

#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    pub run: OneRun,
}

pub fn run(command: &Command) -> Result<Answer, Failure> {
    let Command::Status(options) = command;
    // A user who asks this while a recording waits means that recording, not the latest run that ended.
    let folder = options.run.unfinished_or_latest()?;
    let mut entries: Vec<Entry> = Vec::new();
    for dir in folders(&folder)? {
        entries.extend(status(&dir).map_err(Failure::bad_input)?);
    }
    let open: Vec<&Entry> = entries.iter().filter(|entry| !entry.answered).collect();
    let answered = entries.len() - open.len();
    let mut text =
        format!("{} questions wait, {answered} are answered: {}\n", open.len(), folder.exchanges().display());
    for entry in &open {
        let slot = &entry.slot;
        text.push_str(&format!(
            "  {}/e{}s{} {} round {}: read {}, answer in {}\n",
            slot.lineage,
            slot.epoch,
            slot.slot,
            slot.role,
            slot.round,
            entry.request.display(),
            entry.reply.display()
        ));
    }
    Ok(Answer::new(text, json!({"open": open, "answered": answered})))
}

/// Folders that hold questions, by name.
fn folders(folder: &RunFolder) -> Result<Vec<PathBuf>, Failure> {
    let home = folder.exchanges();
    if !store::is_taken(&home) {
        return Ok(Vec::new());
    }
    store::create_plain_dir(&home).map_err(Failure::bad_input)?;
    Ok(store::list_dirs(&home)?)
}
