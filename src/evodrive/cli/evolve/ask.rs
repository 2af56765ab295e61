//! `ask`: what reader, gates and compiler would say of a draft, before it is the answer to a question of an exchange.

use clap::Args;
use serde_json::json;
use std::path::PathBuf;
use std::time::Duration;

use crate::cli::terminal::answer::{Answer, progress};
use crate::cli::terminal::exit::{Exit, Failure};
use crate::llm::exchange::{said_of, try_draft};
use crate::llm::{Tried, reply};
use crate::store;

/// Between two looks for what was said.
const LOOK: Duration = Duration::from_millis(50);
/// Looks after which a user may wonder whether anybody judges: 5 s.
const LOOKS_BEFORE_A_WORD: u32 = 100;

#[derive(Debug, Args)]
pub struct Options {
    /// A question that waits for a patch, e.g. runs/mine-1/exchange/agent/7.request.md; `evodrive exchange status` lists them.
    pub question: PathBuf,
    /// The draft: a file that holds the reply as you would give it.
    pub draft: PathBuf,
}

/// Waits until the recording has judged the draft; Ctrl-C leaves it there.
pub fn run(options: &Options) -> Result<Answer, Failure> {
    let draft = store::read_bounded(&options.draft, reply::MAX_BYTES as u64).map_err(Failure::bad_input)?;
    let said = try_draft(&options.question, &draft).map_err(Failure::bad_input)?;
    let mut looks = 0;
    loop {
        if let Some(Tried { passes, says }) = said_of(&said).map_err(Failure::bad_input)? {
            let verdict = if passes { "it would pass the gates" } else { "it would not pass" };
            let findings = serde_json::from_str(&says).unwrap_or_else(|_| json!(says));
            let text = serde_json::to_string_pretty(&findings).unwrap_or(says);
            let exit = if passes { Exit::Success } else { Exit::Broken };
            let object = json!({"passes": passes, "says": findings, "file": said});
            return Ok(Answer { exit, ..Answer::exact(format!("{verdict}\n{text}\n"), object) });
        }
        looks += 1;
        if looks == LOOKS_BEFORE_A_WORD {
            progress(
                "the recording judges drafts while it waits for the reply: does it still run? (Ctrl-C leaves the draft where it is)",
            );
        }
        std::thread::sleep(LOOK);
    }
}
