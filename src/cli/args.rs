//! All arguments. Their help texts are goldens: change them on purpose.

use clap::{Parser, Subcommand};

use super::{answer::Answer, exit::Failure};

/// Deterministic, replay-first evolution of driving-scenario generators by LLM agents.
///
/// Exit codes: 0 success, 2 bad input, 3 no recorded answer, 4 something came out differently, 5 stored bytes are damaged, 70 internal.
#[derive(Debug, Parser)]
#[command(name = "evodrive", version, max_term_width = 100)]
pub struct Arguments {
    /// Print one JSON object on stdout instead of text.
    #[arg(long, global = true)]
    pub json: bool,
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {}

impl Command {
    pub fn run(self) -> Result<Answer, Failure> {
        match self {}
    }
}
