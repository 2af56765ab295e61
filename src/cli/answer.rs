//! What a command prints: text for people, or one JSON object for programs; progress goes to stderr.

use serde_json::{Value, json};
use std::io::Write;

use super::exit::{Exit, Failure};

/// The result of a command.
#[derive(Debug)]
pub struct Answer {
    pub text: String,
    pub json: Value,
    /// Most answers are successes; `fsck` and `verify` may have found something.
    pub exit: Exit,
}

impl Answer {
    pub fn new(text: impl Into<String>, json: Value) -> Answer {
        Answer { text: text.into(), json, exit: Exit::Success }
    }

    /// Prints to stdout. A reader that went away (`| head`) is not an error.
    pub fn print(&self, as_json: bool) -> Exit {
        if !as_json && self.text.is_empty() {
            return self.exit;
        }
        let text = if as_json { format!("{}\n", self.json) } else { ended_with_newline(&self.text) };
        let _ = std::io::stdout().write_all(text.as_bytes());
        self.exit
    }
}

/// Tells of a failure on stderr, and with `--json` as an object on stdout too.
pub fn complain(failure: &Failure, as_json: bool) {
    let _ = writeln!(std::io::stderr(), "error: {}", failure.message);
    if as_json {
        let object = json!({"error": failure.message, "exit": failure.exit as u8});
        let _ = writeln!(std::io::stdout(), "{object}");
    }
}

/// One line of progress on stderr.
pub fn progress(line: impl std::fmt::Display) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

fn ended_with_newline(text: &str) -> String {
    if text.ends_with('\n') { text.to_string() } else { format!("{text}\n") }
}
