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
use std::ffi::OsString;
use std::process::ExitCode;

pub use terminal::exit::{Exit, Failure};

/// Characters of a line of help in a pipe or a file.
const HELP_WIDTH: usize = 100;

/// Reads the program's arguments, runs one command, prints its answer.
pub fn main() -> ExitCode {
    // Without a handler a limit ends the program, as it does everywhere.
    let _ = terminal::interrupt::outlive_file_limits();
    called_with(std::env::args_os()).into()
}

/// The same with these arguments, the program's own name first: for whoever carries the program within another one.
pub fn called_with(words: impl IntoIterator<Item = OsString>) -> Exit {
    let words: Vec<OsString> = words.into_iter().collect();
    if let Err(failure) = terminal::typed::in_utf8(&words) {
        terminal::answer::complain(&failure, words.iter().any(|word| word == "--json"));
        return failure.exit;
    }
    let width = terminal::width::stdout_width().unwrap_or(HELP_WIDTH);
    let command = terminal::groups::grouped(args::Arguments::command().term_width(width), width);
    let matches = terminal::examples::with_examples(command).try_get_matches_from(words);
    let arguments = match matches.and_then(|matches| args::Arguments::from_arg_matches(&matches)) {
        Ok(arguments) => arguments,
        Err(error) => {
            // clap's own words: help and version go to stdout and are a success.
            let exit = if error.use_stderr() { Exit::BadInput } else { Exit::Success };
            // What was typed may be the name of somebody's file: it is shown as any other text from outside.
            let plain = error.to_string();
            let _ = match terminal::outside::escaped(&plain) {
                std::borrow::Cow::Borrowed(_) => error.print(),
                std::borrow::Cow::Owned(shown) => std::io::Write::write_all(&mut std::io::stderr(), shown.as_bytes()),
            };
            return exit;
        }
    };
    let json = arguments.json;
    match arguments.command.run(arguments.jobs) {
        Ok(answer) => answer.print(json),
        Err(failure) => {
            terminal::answer::complain(&failure, json);
            failure.exit
        }
    }
}
