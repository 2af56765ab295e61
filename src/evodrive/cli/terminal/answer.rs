//! Output of a command: text for people, or one JSON object for programs; progress goes to stderr.

use serde_json::{Value, json};
use std::io::Write;

use crate::cli::terminal::exit::{Exit, Failure};
use crate::cli::terminal::outside::{bounded, escaped, json_escaped};
use crate::cli::terminal::width::{stderr_width, stdout_width, wrapped};

/// The result of a command.
#[derive(Debug)]
pub struct Answer {
    pub text: String,
    pub json: Value,
    /// Most answers are successes; `fsck` and `verify` may have found something.
    pub exit: Exit,
    /// True if the text is a file's: its lines stay as they are on a terminal too.
    pub exact: bool,
}

impl Answer {
    pub fn new(text: impl Into<String>, json: Value) -> Answer {
        Answer { text: text.into(), json, exit: Exit::Success, exact: false }
    }

    /// An answer that is the text of a file, such as CSV or a program.
    pub fn exact(text: impl Into<String>, json: Value) -> Answer {
        Answer { exact: true, ..Answer::new(text, json) }
    }

    /// Prints to stdout. A reader that went away (`| head`) is not an error; a full disk is, of the place that was chosen.
    pub fn print(&self, as_json: bool) -> Exit {
        if !as_json && self.text.is_empty() {
            return self.exit;
        }
        let text = match stdout_width() {
            _ if as_json => format!("{}\n", json_escaped(&self.json.to_string())),
            Some(width) if !self.exact => ended_with_newline(&wrapped(&escaped(&self.text), width)),
            _ => ended_with_newline(&escaped(&self.text)),
        };
        let mut stdout = std::io::stdout();
        match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
            Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
                let remedy = "make room where it goes, and repeat the command";
                let _ =
                    writeln!(std::io::stderr(), "error: cannot write the answer to standard output: {error}; {remedy}");
                Exit::BadInput
            }
            _ => self.exit,
        }
    }
}

/// Tells of a failure on stderr, and with `--json` as an object on stdout too.
pub fn complain(failure: &Failure, as_json: bool) {
    progress(format_args!("error: {}", failure.message));
    if as_json {
        let object = json!({"error": failure.message, "exit": failure.exit as u8}).to_string();
        let _ = writeln!(std::io::stdout(), "{}", json_escaped(&object));
    }
}

/// One line of progress on stderr, in several where a terminal is narrower.
pub fn progress(line: impl std::fmt::Display) {
    let text = line.to_string();
    let text = escaped(&bounded(&text)).into_owned();
    let text = stderr_width().map_or_else(|| text.clone(), |width| wrapped(&text, width));
    let _ = writeln!(std::io::stderr(), "{text}");
}

fn ended_with_newline(text: &str) -> String {
    if text.ends_with('\n') { text.to_string() } else { format!("{text}\n") }
}
