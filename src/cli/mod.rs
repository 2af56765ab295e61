//! The command line: arguments to each room's options, one file a command.

mod args;
mod cluster;
mod evolve;
mod look;
mod records;
mod reference;
mod scenes;
mod studies;
mod terminal;

use clap::{CommandFactory, FromArgMatches};
use std::process::ExitCode;

pub use terminal::exit::{Exit, Failure};

/// Characters of a line of help in a pipe or a file.
const HELP_WIDTH: usize = 100;

/// Reads the arguments, runs one command, prints its answer.
pub fn main() -> ExitCode {
    let width = terminal::width::stdout_width().unwrap_or(HELP_WIDTH);
    let command = terminal::groups::grouped(args::Arguments::command().term_width(width), width);
    let matches = terminal::examples::with_examples(command).try_get_matches();
    let arguments = match matches.and_then(|matches| args::Arguments::from_arg_matches(&matches)) {
        Ok(arguments) => arguments,
        Err(error) => {
            // clap's own words: help and version go to stdout and are a success.
            let exit = if error.use_stderr() { Exit::BadInput } else { Exit::Success };
            let _ = error.print();
            return exit.into();
        }
    };
    let json = arguments.json;
    match arguments.command.run(arguments.jobs) {
        Ok(answer) => answer.print(json).into(),
        Err(failure) => {
            terminal::answer::complain(&failure, json);
            failure.exit.into()
        }
    }
}
