//! `worker`: our own simulator as a backend's worker, one JSON line in, one out.

use serde_json::json;
use std::io::Write;

use crate::backend::{hello, serve};
use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::Failure;
use crate::store;

/// Serves until standard input ends.
pub fn run() -> Result<Answer, Failure> {
    say(&hello())?;
    let mut requests = std::io::stdin().lock();
    let unread = |error| Failure::bad_input(format!("standard input: cannot read a request: {error}"));
    while let Some(line) = store::next_line(&mut requests).map_err(unread)? {
        if let Some((expected, found)) = store::too_large(&line.bytes) {
            return Err(Failure::bad_input(format!("standard input: a request: expected {expected}, found {found}")));
        }
        say(&serve(&line.bytes).map_err(Failure::bad_input)?)?;
    }
    progress("no more requests");
    Ok(Answer::new("", json!({})))
}

fn say(line: &[u8]) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(line).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush()).map_err(|error| {
        Failure::bad_input(format!("standard output: cannot write an answer: {error}; is whoever asked gone?"))
    })
}
