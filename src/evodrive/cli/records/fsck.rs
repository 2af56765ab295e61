//! `fsck`: whether the stored bytes of a run are what they were, and whether what they record agrees with itself.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;

use crate::cli::records::covered::{Coverage, coverage};
use crate::cli::records::{folder::RunFolder, run_name::OneRun};
use crate::cli::terminal::answer::Answer;
use crate::cli::terminal::exit::{Exit, Failure};
use crate::evidence::{Finding, Gravity, audit};
use crate::store::{self, FsckReport, StoreError};

#[derive(Debug, Args)]
pub struct Options {
    #[command(flatten)]
    pub run: OneRun,
    /// Read every stored byte, not only the structure.
    #[arg(long)]
    pub read: bool,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let folder = options.run.folder()?;
    let mut report = store::fsck(&folder.store(), options.read).map_err(|error| lost_pack(&folder, error))?;
    let mut damage: Vec<String> = Vec::new();
    let recording = folder.dir.join("recording");
    if recording.exists() {
        let answers = store::fsck(&recording, options.read)?;
        report.damage.extend(answers.damage);
        report.notes.extend(answers.notes);
    }
    if folder.transcript().exists() {
        report.damage.extend(store::fsck_transcript(&folder.transcript())?);
    }
    damage.extend(report.damage.iter().map(ToString::to_string));
    // A record that is damaged is not read: its meaning is nobody's any more.
    let run = if damage.is_empty() { Some(folder.recorded()?) } else { None };
    let coverage = run.as_ref().map(|run| coverage(&folder, run, Some(&report), options.read)).unwrap_or_default();
    damage.extend(coverage.damage.iter().cloned());
    let findings = run.as_ref().map(audit).unwrap_or_default();
    let clean = damage.is_empty() && findings.iter().all(|finding| finding.gravity != Gravity::Breach);
    let text = text(&folder, options, &report, &coverage, &damage, &findings);
    let object = json!({
        "folder": folder.dir, "clean": clean, "objects": report.objects, "memo_entries": report.memo_entries,
        "pack_bytes": report.pack_bytes, "read": options.read, "damage": report.damage, "other_damage": coverage.damage,
        "covered": coverage.covered, "not_covered": coverage.uncovered, "notes": coverage.notes, "findings": findings,
    });
    let exit = if clean { Exit::Success } else { Exit::Corruption };
    Ok(Answer { exit, ..Answer::new(text, object) })
}

/// A store without its pack has lost everything that it held.
fn lost_pack(folder: &RunFolder, error: StoreError) -> Failure {
    let absent = matches!(&error, StoreError::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound);
    if absent && folder.store().exists() {
        Failure::corruption(format!("{error}; or delete the store, and `evodrive resume` fills it again"))
    } else {
        error.into()
    }
}

fn text(
    folder: &RunFolder,
    options: &Options,
    report: &FsckReport,
    coverage: &Coverage,
    damage: &[String],
    findings: &[Finding],
) -> String {
    let read = if options.read { "every byte of it read" } else { "structure only (--read reads every byte)" };
    let FsckReport { objects, memo_entries, pack_bytes, .. } = report;
    let dir = folder.dir.display();
    let mut text =
        format!("{dir}: {objects} objects, {memo_entries} memo entries, {pack_bytes} bytes in the pack; {read}\n");
    for note in report.notes.iter().chain(&coverage.notes) {
        let _ = writeln!(text, "note: {note}");
    }
    for damage in damage {
        let _ = writeln!(text, "damaged: {damage}");
    }
    if !coverage.covered.is_empty() {
        let _ = writeln!(text, "as the events say: {}", coverage.covered.join(", "));
    }
    if !coverage.uncovered.is_empty() {
        let _ = writeln!(text, "not covered by the seal: {}", coverage.uncovered.join(", "));
    }
    if damage.is_empty() {
        text.push_str("no damage found\n");
    }
    if report.damage.is_empty() {
        text.push_str(if findings.is_empty() { "audit: no finding\n" } else { "audit:\n" });
    }
    for finding in findings {
        let _ = writeln!(text, "  {finding}");
    }
    text
}
