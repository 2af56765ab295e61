//! What a command prints: text for people, or one JSON object for programs; progress goes to stderr.

use serde_json::{Value, json};
use std::borrow::Cow;
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

    /// Prints to stdout. A reader that went away (`| head`) is not an error; a full disk is.
    pub fn print(&self, as_json: bool) -> Exit {
        if !as_json && self.text.is_empty() {
            return self.exit;
        }
        let text = if as_json { format!("{}\n", self.json) } else { ended_with_newline(&without_controls(&self.text)) };
        let mut stdout = std::io::stdout();
        match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
            Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
                let _ = writeln!(std::io::stderr(), "error: cannot write the answer to standard output: {error}");
                Exit::Internal
            }
            _ => self.exit,
        }
    }
}

/// Tells of a failure on stderr, and with `--json` as an object on stdout too.
pub fn complain(failure: &Failure, as_json: bool) {
    let _ = writeln!(std::io::stderr(), "error: {}", without_controls(&failure.message));
    if as_json {
        let object = json!({"error": failure.message, "exit": failure.exit as u8});
        let _ = writeln!(std::io::stdout(), "{object}");
    }
}

/// One line of progress on stderr.
pub fn progress(line: impl std::fmt::Display) {
    let _ = writeln!(std::io::stderr(), "{}", without_controls(&line.to_string()));
}

/// A text for a terminal: what a model or a file wrote must not move its cursor or change its title.
fn without_controls(text: &str) -> Cow<'_, str> {
    let acts = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if !text.contains(acts) {
        return Cow::Borrowed(text);
    }
    let shown = |c: char| if acts(c) { c.escape_unicode().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(shown).collect())
}

fn ended_with_newline(text: &str) -> String {
    if text.ends_with('\n') { text.to_string() } else { format!("{text}\n") }
}
