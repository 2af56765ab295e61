//! Records that somebody took out of a run by name, kept beside the run: that it was done, of what, and why. A result that still holds
//! such a record does not bring it back.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::error::{ShardError, place};
use super::file::{Lines, line};
use crate::kernel::Digest;
use crate::store::{self, MemoKind};

/// One record that was taken out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Withdrawn {
    /// Kind of request that it answered.
    pub kind: MemoKind,
    pub request: Digest,
    /// Name of its bytes.
    pub record: Digest,
    /// In the words of who did it.
    pub reason: String,
}

impl Withdrawn {
    /// All of a run, in the order in which they were taken out; none where there is no file.
    ///
    /// # Errors
    /// A line that is not what was written.
    pub fn read(path: &Path) -> Result<Vec<Withdrawn>, ShardError> {
        if !path.exists() {
            return Ok(Vec::new());
        }
        let mut lines = Lines::open(path)?;
        let mut all = Vec::new();
        while !lines.is_at_end() {
            let (at, read) = lines.next::<Withdrawn>("a record that was withdrawn");
            all.push(read.map_err(|(expected, found)| ShardError::Damaged {
                file: path.display().to_string(),
                place: place(at),
                expected,
                found,
                remedy: "restore the file; without it, results of shards may bring back what was withdrawn",
            })?);
        }
        Ok(all)
    }

    /// Notes this one behind the others.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn note(&self, path: &Path) -> Result<(), ShardError> {
        Ok(store::append(path, &line(self))?)
    }
}
