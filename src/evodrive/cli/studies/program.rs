//! `program`: programs of runs and of files: shown, taken out, written and changed by hand, checked, compared.

use clap::Subcommand;
use serde_json::json;
use std::fmt::Write as _;

use crate::cli::studies::packed::{Which, packed};
use crate::cli::studies::{program_check, program_diff, program_edit, program_export, program_hand, program_import};
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::experiment::ProgramFile;
use crate::objects::program_diff as lines_that_differ;
use crate::text::counted;

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write the published parent of a family as a program to begin with: TOML, with what its contract says as comments.
    New(program_hand::NewOptions),
    /// Make a program of a file of SafeBench or ChatScene: hand-chosen parameters, control sequences, optimised ranges.
    Import(program_import::Options),
    /// Change a program file in your editor (VISUAL or EDITOR); it is checked when the editor closes, and a text that does not
    /// fit is kept.
    Edit(program_edit::Options),
    /// Change one value of a program file, if no gate refuses it.
    Set(program_hand::SetOptions),
    /// Check a program file: every place that does not fit, with what is expected there.
    Check(program_check::Options),
    /// Show in words what one program does differently from another of its family.
    Diff(program_diff::Options),
    /// Show a program: where it came from, what it changes in its parent, and its whole content.
    Show(Which),
    /// Write a program with everything that it needs into one file, for `apply` or for `lineage[].parent_program` in
    /// an experiment; or, with --format, for SafeBench and CARLA.
    Export(program_export::Options),
}

pub fn run(command: &Command, jobs: usize) -> Result<Answer, Failure> {
    match command {
        Command::New(options) => program_hand::new(options),
        Command::Edit(options) => program_edit::run(options),
        Command::Set(options) => program_hand::set(options),
        Command::Check(options) => program_check::run(options, jobs),
        Command::Diff(options) => program_diff::run(options),
        Command::Show(which) => {
            let file = packed(which)?;
            Ok(Answer::new(described(&file)?, json!({"program": file})))
        }
        Command::Export(options) => program_export::run(options, jobs),
        Command::Import(options) => program_import::run(options),
    }
}

fn described(file: &ProgramFile) -> Result<String, Failure> {
    let mut text = format!(
        "program {}  (family {}, generation {})\nhash     {}\ncontract {}, adapter version {}\n",
        file.program.solution_id,
        file.family,
        file.program.generation,
        file.program_hash,
        file.contract.digest,
        file.contract.adapter
    );
    for origin in &file.origins {
        let _ = writeln!(text, "from     {origin}");
    }
    let _ = writeln!(text, "played   ego {}, seed {}", file.conditions.ego, file.conditions.seed);
    if let Some(backend) = &file.conditions.backend {
        let _ = writeln!(text, "labels   of {} {}, worker {}", backend.name, backend.version, backend.digest.short(16));
    }
    if !file.counsel.is_empty() {
        let _ = writeln!(text, "counsel  for {}", counted(file.counsel.len(), "scene"));
    }
    let diff = lines_that_differ(&file.parent, &file.program);
    let unchanged = diff.is_empty().then(|| "  nothing\n".to_string());
    let _ = write!(text, "\nchanged of {}:\n{}", file.parent.solution_id, unchanged.unwrap_or(diff));
    let content = serde_json::to_string_pretty(&file.program).map_err(Failure::internal)?;
    let _ = writeln!(text, "\n{content}");
    Ok(text)
}
