//! Keeps what `credit` worked out of a run in credit.json, beside the run's events, so that a report shows it without a rollout.

use crate::cli::records::folder::RunFolder;
use crate::cli::records::kept::KeptFile;
use crate::cli::terminal::exit::Failure;
use crate::evidence::RecordedRun;
use crate::evidence::credit::Credit;

/// The file: whole patches of reported programs, taken out one by one.
fn file(folder: &RunFolder) -> KeptFile {
    KeptFile { path: folder.credit(), word: "credit", again: "evodrive credit" }
}

/// Reads what the folder keeps of this run; nothing if it was worked out of another run, or not at all.
///
/// # Errors
/// A file whose numbers were changed. A file that cannot be read is reported and then ignored: nothing rests on it.
pub fn kept(folder: &RunFolder, run: &RecordedRun) -> Result<Vec<Credit>, Failure> {
    Ok(file(folder).read(run.root)?.unwrap_or_default())
}

/// Adds what was worked out; a program's earlier entry goes.
pub fn keep(folder: &RunFolder, run: &RecordedRun, credits: &[Credit]) -> Result<(), Failure> {
    // A file that cannot be read is written anew.
    let mut all = kept(folder, run).unwrap_or_default();
    all.retain(|of| credits.iter().all(|new| new.program != of.program));
    all.extend(credits.iter().cloned());
    all.sort_by(|a, b| a.program.cmp(&b.program));
    file(folder).write(run.root, all)
}
