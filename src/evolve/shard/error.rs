//! Why a shard or a result cannot be used.

use crate::backend::RolloutCassetteError;
use crate::kernel::{Digest, canon::CanonError};
use crate::store::StoreError;

#[derive(Debug, thiserror::Error)]
pub enum ShardError {
    /// Bytes that are not what was written.
    #[error("{file} {place}: expected {expected}, found {found}; {remedy}")]
    Damaged { file: String, place: String, expected: String, found: String, remedy: &'static str },
    /// Of another run, or of another version of the program.
    #[error("{file} belongs to another study: {field} is {found}, expected {expected}; {remedy}")]
    Foreign { file: String, field: &'static str, expected: String, found: String, remedy: &'static str },
    #[error(transparent)]
    Untrue(#[from] Box<Untrue>),
    #[error(transparent)]
    Withdrawn(#[from] Box<WithdrawnRecord>),
    #[error(transparent)]
    Diverged(#[from] Box<Conflict>),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Cassette(#[from] RolloutCassetteError),
    #[error("a digest cannot be computed: {0}")]
    Canon(#[from] CanonError),
}

/// One request, two records.
#[derive(Debug, thiserror::Error)]
#[error(
    "two results of one {what}: {key} of scene {scene} is {first} in {first_from} and {second} in {second_from}; \
     nothing was merged. One machine is faulty or has another program: do the shard again on a third machine, \
     and remove the result that it does not confirm"
)]
pub struct Conflict {
    /// Kind of the record, and its key.
    pub what: &'static str,
    pub key: Digest,
    pub scene: String,
    /// The digests of both, and where each was met.
    pub first: Digest,
    pub first_from: String,
    pub second: Digest,
    pub second_from: String,
}

/// A record that this machine computes otherwise.
#[derive(Debug, thiserror::Error)]
#[error(
    "{file}: task {task} of scene {scene}: {field}: found {found}, computed here {expected}; nothing of this result was merged. The \
     machine that did the shard is faulty, has another program or made it up: remove the result, and do its shard on another one"
)]
pub struct Untrue {
    /// The result that holds it, and for which task.
    pub file: String,
    pub task: Digest,
    pub scene: String,
    /// Field in which the two records part, and both values.
    pub field: String,
    pub expected: String,
    pub found: String,
}

/// A record that somebody took out of the run.
#[derive(Debug, thiserror::Error)]
#[error(
    "{file}: task {task} of scene {scene}: its record {record} was withdrawn from this run ({reason}); nothing of this result was \
     merged: remove it and do its shard again"
)]
pub struct WithdrawnRecord {
    /// The result that holds it, and for which task.
    pub file: String,
    pub task: Digest,
    pub scene: String,
    /// Record that was withdrawn, and why.
    pub record: Digest,
    pub reason: String,
}

/// Remedy for a damaged shard, and for a damaged result.
pub(super) const COPY_AGAIN: &str = "copy the shard again from where it was planned";
pub(super) const WORK_AGAIN: &str = "remove the file and do its shard again; nothing of it was merged";

/// Names a place in a file: a line from 1, or the whole of it.
pub(super) fn place(line: usize) -> String {
    if line == 0 { "as a whole".into() } else { format!("line {line}") }
}
