//! `program`: programs of runs and of files: shown, taken out, written and changed by hand, checked, compared.

use clap::{Args, Subcommand};
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::cli::records::run_name::OneRun;
use crate::cli::studies::packed::packed_of;
use crate::cli::studies::program_form::{bytes_for, is_file};
use crate::cli::studies::{program_check, program_diff, program_edit, program_hand};
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::experiment::ProgramFile;
use crate::objects::program_diff as lines_that_differ;
use crate::text::counted;

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write the published parent of a family as a program to begin with: TOML, with what its contract says as comments.
    New(program_hand::NewOptions),
    /// Change a program file in your editor (VISUAL or EDITOR); it is checked when the editor closes, and a text that does not
    /// fit is kept.
    Edit(program_edit::Options),
    /// Change one value of a program file, if no gate refuses it.
    Set(program_hand::SetOptions),
    /// Check a program file: every place that does not fit, with what is expected there.
    Check(program_check::Options),
    /// What one program does otherwise than another of its family, in words.
    Diff(program_diff::Options),
    /// Show a program: where it came from, what it changes in its parent, and its whole content.
    Show(Which),
    /// Write a program with everything that it needs into one file, for `apply` or for `lineage[].parent_program` in
    /// an experiment.
    Export(ExportOptions),
}

#[derive(Debug, Args)]
#[command(allow_missing_positional = true)]
pub struct Which {
    #[command(flatten)]
    pub run: OneRun,
    /// Attempt that left a program, e.g. cat-idm/e2s5, a lineage's parent, e.g. cat-idm/parent, or a program file.
    pub attempt: String,
}

#[derive(Debug, Args)]
#[command(allow_missing_positional = true)]
pub struct ExportOptions {
    #[command(flatten)]
    pub which: Which,
    /// File to write: JSON, or TOML to be changed by hand where its name ends in .toml; without it JSON goes to stdout.
    #[arg(long)]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
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
        Command::Export(ExportOptions { which, out, output }) => {
            let file = packed(which)?;
            let Some(path) = out else {
                let bytes = file.to_bytes().map_err(Failure::internal)?;
                return Ok(Answer::exact(String::from_utf8_lossy(&bytes), json!(file)));
            };
            output.write(path, &bytes_for(path, &file)?)?;
            let text = format!(
                "{}, family {}, as {}\ndigest {}\n",
                file.program.solution_id,
                file.family,
                path.display(),
                file.digest
            );
            let object = json!({"file": path, "digest": file.digest, "program": file.program.solution_id});
            Ok(Answer::new(text, object))
        }
    }
}

/// The program of a file, or put together from its run folder.
fn packed(which: &Which) -> Result<ProgramFile, Failure> {
    if which.run.named().is_none() && is_file(&which.attempt) {
        return Ok(ProgramFile::read(Path::new(&which.attempt))?);
    }
    let folder = which.run.folder()?;
    packed_of(&folder, &folder.recorded()?, &which.attempt)
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
