//! Errors of the disk. Every text names the file and the place, what was expected, and what to do.

use std::path::{Path, PathBuf};

use super::MemoKind;
use crate::kernel::{Digest, canon::CanonError};

/// Why the disk refused a request.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The operating system refused.
    #[error("cannot {action} {}: {source}; {remedy}", path.display())]
    Io {
        /// Action that was tried.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
        /// Advice that helps.
        remedy: &'static str,
    },
    /// Stored bytes are not what was stored.
    #[error("{0}")]
    Corrupt(Box<Damage>),
    /// Another process has it open.
    #[error("{} is in use by {holder}; wait until it ends, or give this run a folder of its own", path.display())]
    Locked {
        /// The file that is locked.
        path: PathBuf,
        /// Holder of the lock.
        holder: String,
    },
    /// The disk gives no lock to anybody.
    #[error(
        "cannot lock {}: {source}; this disk has no file locks (mounts of NFS, Lustre and GPFS may have none), so nothing would keep a second \
         command from writing there at the same time: name a folder on a local disk (--out), or have the disk mounted with flock (docs/RUNS.md)",
        path.display()
    )]
    NoLocks {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Something that is not this program's has a name that the program derived.
    #[error("{}: expected {expected}, found {found}; it stays as it is: move it aside, or name another place", path.display())]
    Foreign {
        /// The file or folder.
        path: PathBuf,
        /// Kind of entry that would be ours.
        expected: &'static str,
        /// Kind of entry that is there.
        found: &'static str,
    },
    /// A reader asked for at most `max_bytes`.
    #[error("{} is larger than {max_bytes} bytes; is it the file you meant?", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The reader's limit.
        max_bytes: u64,
    },
    /// There is no object of that name.
    #[error("{} holds no object {digest}; it was never stored here", path.display())]
    Absent {
        /// The store's file.
        path: PathBuf,
        /// The name that was asked for.
        digest: Digest,
    },
    /// A memo entry exists and names another object: the same request gave two results.
    #[error(
        "{kind} request {key} is recorded with result {recorded}, now it gave {offered}: one request, two results; \
         run `evodrive verify` to see which of them this build computes"
    )]
    Conflict {
        /// Kind of request.
        kind: MemoKind,
        /// The request.
        key: Digest,
        /// The object that is recorded.
        recorded: Digest,
        /// The object that came out now.
        offered: Digest,
    },
    /// A value has no canonical bytes (NaN, infinity).
    #[error("event {kind} cannot be stored: {source}")]
    Unstorable {
        /// Kind of the event.
        kind: String,
        /// Why it has no canonical bytes.
        source: CanonError,
    },
    /// A continued run differs from the recorded one.
    #[error("{0}")]
    Divergence(Box<Divergence>),
    /// A sealed transcript takes no more events.
    #[error("{} is sealed at event {seq}: the run is over; start a new run to record more", path.display())]
    Sealed {
        /// The transcript.
        path: PathBuf,
        /// Number of its last event.
        seq: u64,
    },
}

/// One damaged place of one file.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Damage {
    /// The damaged file.
    pub file: PathBuf,
    /// Place in the file: byte offset, `line 7`, `table memo`.
    pub place: String,
    /// The object that is lost, where it is known.
    pub digest: Option<Digest>,
    /// Description of what was expected there and what was found.
    pub what: String,
    /// Memo entries that name the object, as `llm <key>`.
    pub referred_by: Vec<String>,
    /// Advice that helps.
    pub remedy: String,
}

impl std::fmt::Display for Damage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} is damaged at {}", self.file.display(), self.place)?;
        if let Some(digest) = &self.digest {
            write!(f, " (object {digest})")?;
        }
        write!(f, ": {}", self.what)?;
        if !self.referred_by.is_empty() {
            write!(f, "; referred to by {}", self.referred_by.join(", "))?;
        }
        write!(f, "; {}", self.remedy)
    }
}

/// The first place where a continued run differs from what was recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Divergence {
    /// The transcript.
    pub file: PathBuf,
    /// Place of the event in the transcript, from 0.
    pub seq: u64,
    /// Kind of the event as recorded.
    pub kind: String,
    /// JSON Pointer of the first differing field: `/kind`, or inside the body `/body/...`.
    pub field: String,
    /// Recorded value.
    pub recorded: String,
    /// Value that came out now.
    pub computed: String,
}

impl std::fmt::Display for Divergence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}: event {} ({}) differs from what was recorded at {}: recorded {}, computed {}; the experiment, the inputs or \
             the program changed since it was recorded: restore them, or start a new run",
            self.file.display(),
            self.seq,
            self.kind,
            self.field,
            self.recorded,
            self.computed
        )
    }
}

const RESTORE: &str = "restore the file from a copy, or move the folder aside and record the run anew";

impl StoreError {
    pub(super) fn io(action: &'static str, path: &Path, source: std::io::Error) -> StoreError {
        let remedy = match source.kind() {
            std::io::ErrorKind::NotFound => "check the path",
            std::io::ErrorKind::PermissionDenied => "check its permissions and owner",
            std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
                "the disk is full: make room there, or name a place on another disk, and repeat the command; what was written \
                 whole is safe"
            }
            std::io::ErrorKind::InvalidFilename => {
                "choose a shorter name: a file is written under a longer one first, and 200 bytes fit everywhere"
            }
            std::io::ErrorKind::FileTooLarge => {
                "raise the limit of a file's size (`ulimit -f`), or name a place on another disk, and repeat the command; what was \
                 written whole is safe"
            }
            std::io::ErrorKind::ReadOnlyFilesystem => "name a place that may be written to",
            std::io::ErrorKind::AlreadyExists => "choose another place, or remove it first",
            std::io::ErrorKind::IsADirectory | std::io::ErrorKind::NotADirectory => {
                "a file was expected where a folder is, or the reverse"
            }
            _ => "check the path and the disk",
        };
        StoreError::Io { action, path: path.to_path_buf(), source, remedy }
    }

    pub(super) fn corrupt(damage: Damage) -> StoreError {
        StoreError::Corrupt(Box::new(damage))
    }
}

impl Damage {
    pub(super) fn at(file: &Path, place: impl Into<String>, what: impl Into<String>) -> Damage {
        Damage {
            file: file.to_path_buf(),
            place: place.into(),
            digest: None,
            what: what.into(),
            referred_by: Vec::new(),
            remedy: RESTORE.to_string(),
        }
    }

    pub(super) fn of(mut self, digest: Digest) -> Damage {
        self.digest = Some(digest);
        self
    }
}
