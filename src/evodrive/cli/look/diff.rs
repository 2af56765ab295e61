//! `diff`: where two runs part.

use clap::Args;
use serde_json::json;

use crate::cli::records::{folder::RunFolder, run_name::TwoRuns};
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::evidence::differing::{Cause, Differing, compare};
use crate::store;
use crate::text::counted;

/// Bytes that a kept experiment file may have.
const EXPERIMENT_BYTES_MAX: u64 = 16 << 20;

#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    pub runs: TwoRuns,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let [first, second] = options.runs.named()?;
    let (first, second) = (RunFolder::find(Some(first))?, RunFolder::find(Some(second))?);
    let differences = compare(&first.transcript(), &second.transcript())?;
    let experiments = if differences.inputs.is_empty() { String::new() } else { experiments(&first, &second)? };
    Ok(Answer::new(text(&differences, &experiments), json!(differences)))
}

/// Returns the differences between the kept experiment files.
fn experiments(first: &RunFolder, second: &RunFolder) -> Result<String, Failure> {
    let read = |folder: &RunFolder| -> Result<String, Failure> {
        let bytes = store::read_bounded(&folder.experiment(), EXPERIMENT_BYTES_MAX)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    };
    let (old, new) = (read(first)?, read(second)?);
    Ok(crate::text::unified_diff(&old, &new, 0, ["first", "second"]))
}

fn text(found: &Differing, experiments: &str) -> String {
    let [one, other] = found.events;
    if found.is_nothing() {
        return format!("no difference: {}, one root", counted(one, "event"));
    }
    let mut lines = Vec::new();
    for input in &found.inputs {
        lines.push(format!("input {}: first {}, second {}", input.field, input.first, input.second));
    }
    lines.extend(experiments.lines().map(|line| format!("  {line}")));
    match &found.first {
        None => lines.push(format!("all {one} events after the inputs are the same")),
        Some(event) => {
            let kinds = event.kinds.clone().map(|kind| kind.unwrap_or_else(|| "no event".into()));
            let [a, b] = &kinds;
            let kind = if a == b { a.clone() } else { format!("{a} in the first, {b} in the second") };
            let of = if event.of.is_empty() { String::new() } else { format!(" ({})", event.of) };
            lines.push(format!("first event that differs: number {} of {one} and {other}, {kind}{of}", event.seq));
            if let Some(field) = &event.field {
                lines.push(format!("  {}: first {}, second {}", field.field, field.first, field.second));
            }
            let follows = event.cause == Cause::Code && !found.inputs.is_empty();
            lines.push(format!(
                "  {}",
                if follows { "with other inputs, other decisions follow" } else { event.cause.text() }
            ));
        }
    }
    lines.join("\n")
}
