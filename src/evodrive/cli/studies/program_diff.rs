//! `program diff`: what one program does otherwise than another, in words.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;
use std::path::Path;

use crate::cli::records::folder::RunFolder;
use crate::cli::studies::{packed, program_form};
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::experiment::ProgramFile;
use crate::families;
use crate::objects::program_diff;

#[derive(Debug, Args)]
pub struct Options {
    /// Program: a file (TOML or JSON), RUN:ATTEMPT, or an attempt of the latest run.
    pub first: String,
    /// The program that it is compared with, named likewise.
    pub second: String,
    /// Show the lines of both that differ, too.
    #[arg(long)]
    pub lines: bool,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let (first, second) = (named(&options.first)?, named(&options.second)?);
    if first.family != second.family {
        return Err(Failure::bad_input(format!(
            "{} is a program of family {}, {} one of family {}: they have no parts in common; name two of one family",
            options.first, first.family, options.second, second.family
        )));
    }
    let sources = families::sources_by_hand();
    let source = sources.get(&first.family).ok_or_else(|| Failure::internal("a family that was read is gone"))?;
    let changes = source.contract.changes(&first.program, &second.program);
    let conditions = conditions(&first, &second);
    let mut text = String::new();
    for change in &changes {
        let _ = writeln!(text, "{}\n    {}", change.says, change.place);
    }
    if changes.is_empty() {
        text.push_str("both programs do the same\n");
    }
    for line in &conditions {
        let _ = writeln!(text, "labelled otherwise: {line}");
    }
    let lines = program_diff(&first.program, &second.program);
    if options.lines && !lines.is_empty() {
        let _ = write!(text, "\n{lines}");
    }
    let of = |file: &ProgramFile| json!({"program": file.program.solution_id, "hash": file.program_hash, "origins": file.origins});
    let object = json!({
        "first": of(&first), "second": of(&second), "changes": changes, "conditions": conditions, "lines": lines,
    });
    Ok(Answer::new(text, object))
}

/// Returns the other differences on which their labels depend.
fn conditions(first: &ProgramFile, second: &ProgramFile) -> Vec<String> {
    let (a, b) = (&first.conditions, &second.conditions);
    let mut lines = Vec::new();
    if a.ego != b.ego {
        lines.push(format!("driver from {} to {}", a.ego, b.ego));
    }
    if a.seed != b.seed {
        lines.push(format!("seed from {} to {}", a.seed, b.seed));
    }
    for (what, differs) in [
        ("versions", a.versions != b.versions),
        ("simulator options", a.simulator != b.simulator),
        ("another simulator", a.backend != b.backend),
        ("evaluation options", a.evaluation != b.evaluation),
    ] {
        lines.extend(differs.then(|| format!("{what} differ")));
    }
    lines
}

/// The program of a file, of `RUN:ATTEMPT`, or of an attempt of the latest run.
///
/// # Errors
/// Errors of the file or the run.
fn named(name: &str) -> Result<ProgramFile, Failure> {
    if program_form::is_file(name) {
        return Ok(ProgramFile::read(Path::new(name))?);
    }
    let (run, attempt) = match name.rsplit_once(':') {
        Some((run, attempt)) => (Some(Path::new(run)), attempt),
        None => (None, name),
    };
    let folder = RunFolder::find(run)?;
    packed::packed_of(&folder, &folder.recorded()?, attempt)
}
