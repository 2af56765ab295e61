//! `fsck`: whether the stored bytes of a run are what they were, and whether what they record agrees with itself.

use clap::Args;
use serde_json::json;
use std::fmt::Write as _;
use std::path::PathBuf;

use super::answer::Answer;
use super::exit::{Exit, Failure};
use super::folder::RunFolder;
use crate::evidence::{Gravity, audit};
use crate::experiment;
use crate::llm::Cassette;
use crate::store;

#[derive(Debug, Args)]
pub struct Options {
    /// Run folder; without it the latest one below runs/.
    pub run: Option<PathBuf>,
    /// Read every stored byte, not only the structure.
    #[arg(long)]
    pub read: bool,
}

pub fn run(options: &Options) -> Result<Answer, Failure> {
    let folder = RunFolder::find(options.run.as_deref())?;
    let report = store::fsck(&folder.store(), options.read)?;
    let mut damages = report.damage.clone();
    damages.extend(store::fsck_transcript(&folder.transcript())?);
    let mut text = format!(
        "{}: {} objects, {} memo entries, {} bytes in the pack; {}\n",
        folder.dir.display(),
        report.objects,
        report.memo_entries,
        report.pack_bytes,
        if options.read { "every byte read" } else { "structure only (--read reads every byte)" }
    );
    let mut others: Vec<String> = Vec::new();
    if options.read {
        if let Err(error) = Cassette::load(&folder.cassette()) {
            others.push(error.to_string());
        }
        if let Err(error) = experiment::read_pool(&folder.pool()) {
            others.push(error.to_string());
        }
    }
    for damage in &damages {
        let _ = writeln!(text, "damaged: {damage}");
    }
    for other in &others {
        let _ = writeln!(text, "damaged: {other}");
    }
    let mut clean = damages.is_empty() && others.is_empty();
    // A record that is damaged is not read: its meaning is nobody's any more.
    let findings = if clean { audit(&folder.story()?) } else { Vec::new() };
    if clean {
        text.push_str("no damage found\n");
        text.push_str(if findings.is_empty() { "audit: no finding\n" } else { "audit:\n" });
    }
    for finding in &findings {
        let _ = writeln!(text, "  {finding}");
    }
    clean &= findings.iter().all(|finding| finding.gravity != Gravity::Breach);
    let object = json!({
        "folder": folder.dir, "clean": clean, "objects": report.objects, "memo_entries": report.memo_entries,
        "pack_bytes": report.pack_bytes, "read": options.read, "damage": damages, "other_damage": others, "findings": findings,
    });
    let exit = if clean { Exit::Success } else { Exit::Corruption };
    Ok(Answer { exit, ..Answer::new(text, object) })
}
