//! `program new` and `program set`: a family's parent to begin with, and one value changed through the gates.

use clap::Args;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use crate::candidates::{Judging, Trials, admit};
use crate::cli::studies::program_form::bytes_for;
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::experiment::{ProgramFile, family_named, typed_value, value_span};
use crate::families;
use crate::objects::{FamilyName, Operation, OperationKind, Program, ProgramPatch, SolutionId};
use crate::store;

#[derive(Debug, Args)]
pub struct NewOptions {
    /// Generator family; `evodrive families` lists them.
    #[arg(long)]
    pub family: String,
    /// File to write, TOML or, where its name ends in .json, JSON; without it TOML goes to stdout.
    #[arg(long)]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

#[derive(Debug, Args)]
pub struct SetOptions {
    /// Program file, TOML or JSON.
    pub file: PathBuf,
    /// Place in the program, as patches and `program check` name it: /parameters/NAME, /operator_graph/NODE/settings/NAME,
    /// /mechanism_modules/NAME/expression.
    pub place: String,
    /// The value, as TOML writes it; a word needs no quotes.
    #[arg(allow_hyphen_values = true)]
    pub value: String,
}

/// Writes the published parent of a family.
pub fn new(options: &NewOptions) -> Result<Answer, Failure> {
    let family = FamilyName::new(family_named(&options.family));
    let file = ProgramFile::published(&family)?;
    let Some(path) = &options.out else {
        let text = file.to_toml().map_err(Failure::bad_input)?;
        return Ok(Answer::exact(text, json!(file)));
    };
    options.output.write(path, &bytes_for(path, &file)?)?;
    let shown = path.display();
    let text = format!(
        "the published parent of {family} in {shown}; next:\nevodrive program edit {shown}\nevodrive program check {shown}\n\
         evodrive apply {shown} --scenes my.pool\n"
    );
    Ok(Answer::new(text, json!({"file": path, "family": family, "program_hash": file.program_hash})))
}

/// Changes one value of a program file.
pub fn set(options: &SetOptions) -> Result<Answer, Failure> {
    let file = ProgramFile::read(&options.file)?;
    let value = serde_json::to_value(typed_value(&options.value)).map_err(Failure::bad_input)?;
    let changed = admitted(&file, &options.place, value)?;
    let sources = families::sources_by_hand();
    let source = sources.get(&file.family).ok_or_else(|| Failure::internal("a family that was read is gone"))?;
    let changes = source.contract.changes(&file.program, &changed);
    let written = file.rewritten(changed).map_err(Failure::bad_input)?;
    let kept = if ProgramFile::is_toml(&options.file.to_string_lossy()) { in_place(options, &written)? } else { None };
    let anew = kept.is_none();
    let bytes = kept.map_or_else(|| bytes_for(&options.file, &written), Ok)?;
    store::write_atomic(&options.file, &bytes)?;
    let mut text = String::new();
    for change in &changes {
        let _ = writeln!(text, "{}", change.says);
    }
    let _ = writeln!(text, "{}: {}", options.file.display(), provenance(&written));
    if anew && ProgramFile::is_toml(&options.file.to_string_lossy()) {
        text.push_str("the place is new, so the file was written anew; comments of your own are gone from it\n");
    }
    Ok(Answer::new(
        text,
        json!({"file": options.file, "changes": changes, "program_hash": written.program_hash, "origins": written.origins}),
    ))
}

/// The last step of a program's way here, for a line.
pub fn provenance(file: &ProgramFile) -> String {
    let last = file.origins.last().map_or_else(|| "the family's published parent".to_string(), ToString::to_string);
    format!("{last}; program {}", file.program_hash.short(16))
}

/// The program with the value, if no gate refuses it.
fn admitted(file: &ProgramFile, place: &str, value: Value) -> Result<Program, Failure> {
    let parent = &file.program;
    let there = serde_json::to_value(parent).map_err(Failure::internal)?.pointer(place).is_some();
    let op = if there { OperationKind::Replace } else { OperationKind::Add };
    let patch = ProgramPatch {
        source_baseline: parent.source_family.clone(),
        parent_solution_id: parent.solution_id.clone(),
        parent_program_hash: file.program_hash.to_hex(),
        operations: vec![Operation { op, path: place.into(), value: Some(value) }],
        hypothesis: "written by hand".into(),
        memory_refs_used: Vec::new(),
        cluster_refs_used: Vec::new(),
        repair_summary: None,
        free: Default::default(),
    };
    let registry = families::sources_by_hand().registry();
    let family = registry.get(&file.family).ok_or_else(|| Failure::internal("a family that was read is gone"))?;
    let judging = Judging::whole(&family.contract, &registry);
    let child = SolutionId::new(format!("{}/set", parent.lineage_id));
    let admission = admit(parent, &patch, child, &judging, &|_, _| Trials::default());
    let Some(candidate) = admission.candidate else {
        let refusing = admission.gates.verdicts.iter().flat_map(|verdict| {
            verdict.problems.iter().map(move |problem| format!("  {} (gate {})", problem, verdict.gate.name()))
        });
        // What cannot be applied fails in every gate; the first says why.
        let lines: Vec<String> = refusing.filter(|line| !line.contains("nothing to look at")).collect();
        return Err(Failure::bad_input(format!("{place} stays as it was:\n{}", lines.join("\n"))));
    };
    let Program { solution_id, lineage_id, generation, ancestor_chain, .. } = parent.clone();
    Ok(Program { solution_id, lineage_id, generation, ancestor_chain, ..candidate.program })
}

/// The file's own text with the value in place of the old one, where it stands there; comments stay.
fn in_place(options: &SetOptions, written: &ProgramFile) -> Result<Option<Vec<u8>>, Failure> {
    let name = options.file.to_string_lossy();
    let bytes = ProgramFile::bytes_of(&options.file)?;
    let Ok(text) = std::str::from_utf8(&bytes) else { return Ok(None) };
    let Some(span) = value_span(text, &options.place) else { return Ok(None) };
    let (before, after) = (text.get(..span.start).unwrap_or_default(), text.get(span.end..).unwrap_or_default());
    let new = format!("{before}{}{after}", typed_value(&options.value));
    let same = ProgramFile::from_toml(&name, &new).is_ok_and(|read| read.program_hash == written.program_hash);
    Ok(same.then(|| new.into_bytes()))
}

/// Returns the path of a text that is being edited.
pub fn draft_of(path: &Path) -> PathBuf {
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    path.with_file_name(format!("{name}.edit.toml"))
}
