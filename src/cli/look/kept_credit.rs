//! What `credit` worked out of a run stands beside its events in credit.json, so that a report shows it without a rollout.

use serde::{Deserialize, Serialize};

use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::{answer::progress, exit::Failure};
use crate::evidence::RecordedRun;
use crate::evidence::credit::Credit;
use crate::kernel::Digest;
use crate::kernel::canon::CanonError;
use crate::store;

const FORMAT: &str = "evodrive-credit/1";
const BYTES_MAX: u64 = 1 << 26;

/// The file: whole patches of reported programs, taken out one by one.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    format: String,
    /// Of the run that it was worked out of.
    root: Digest,
    /// Of what follows, so that a changed number is seen.
    digest: Digest,
    credits: Vec<Credit>,
}

fn digest(credits: &[Credit]) -> Result<Digest, CanonError> {
    Digest::of("evodrive/credit/1", &credits)
}

/// What the folder keeps of this run; nothing where it was worked out of another one, or not at all.
///
/// # Errors
/// A file whose numbers were changed. One that cannot be read is told, and done without: nothing rests on it.
pub fn kept(folder: &RunFolder, run: &RecordedRun) -> Result<Vec<Credit>, Failure> {
    let path = folder.credit();
    if !path.exists() {
        return Ok(Vec::new());
    }
    let damaged = |what: String| {
        let remedy = "remove the file; `evodrive credit` works it out again";
        Failure::corruption(format!("{}: {what}; {remedy}", path.display()))
    };
    let bytes = store::read_bounded(&path, BYTES_MAX)?;
    let kept: Kept = match serde_json::from_slice(&bytes) {
        Ok(kept) => kept,
        Err(error) => {
            progress(damaged(format!("expected credits, found {error}; it is done without them")).message);
            return Ok(Vec::new());
        }
    };
    if kept.format != FORMAT {
        return Err(damaged(format!("format: expected {FORMAT}, found {}", kept.format)));
    }
    let found = digest(&kept.credits).map_err(|error| damaged(error.to_string()))?;
    if found != kept.digest {
        return Err(damaged(format!("expected credits of digest {}, found {found}", kept.digest)));
    }
    Ok(if kept.root == run.root { kept.credits } else { Vec::new() })
}

/// Adds what was worked out; a program's earlier entry goes.
pub fn keep(folder: &RunFolder, run: &RecordedRun, credits: &[Credit]) -> Result<(), Failure> {
    // What cannot be read is written anew.
    let mut all = kept(folder, run).unwrap_or_default();
    all.retain(|of| credits.iter().all(|new| new.program != of.program));
    all.extend(credits.iter().cloned());
    all.sort_by(|a, b| a.program.cmp(&b.program));
    let digest = digest(&all).map_err(Failure::internal)?;
    let kept = Kept { format: FORMAT.into(), root: run.root, digest, credits: all };
    let text = serde_json::to_vec_pretty(&kept).map_err(Failure::internal)?;
    Ok(store::write_atomic(&folder.credit(), &text)?)
}
