//! `worker`: our own simulator as a backend's worker, one JSON line in, one out.

use serde_json::json;
use std::io::{BufRead, Write};

use crate::backend::{hello, serve};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;

/// Serves until standard input ends.
pub fn run() -> Result<Answer, Failure> {
    say(&hello())?;
    for line in std::io::stdin().lock().split(b'\n') {
        let line = line.map_err(Failure::internal)?;
        say(&serve(&line).map_err(Failure::bad_input)?)?;
    }
    progress("no more requests");
    Ok(Answer::new("", json!({})))
}

fn say(line: &[u8]) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(line).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush()).map_err(Failure::internal)
}
