//! The command line: arguments and experiment files to each room's options, one file a command.

mod answer;
mod args;
mod bench;
mod cost;
mod exit;
mod exit_from;
pub mod experiment;
mod folder;
mod fsck;
pub mod inputs;
mod lineage;
mod models;
mod playables;
mod report;
mod result_text;
mod rollout;
mod run;
mod scene_export;
mod scene_show;
mod scenes;
mod show;
mod table;

use clap::Parser;
use std::process::ExitCode;

pub use exit::{Exit, Failure};

/// Reads the arguments, runs one command, prints its answer.
pub fn main() -> ExitCode {
    let arguments = match args::Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // clap's own words: help and version go to stdout and are a success.
            let exit = if error.use_stderr() { Exit::BadInput } else { Exit::Success };
            let _ = error.print();
            return exit.into();
        }
    };
    let json = arguments.json;
    match arguments.command.run() {
        Ok(answer) => answer.print(json).into(),
        Err(failure) => {
            answer::complain(&failure, json);
            failure.exit.into()
        }
    }
}
