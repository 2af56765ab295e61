//! Keeps what was worked out of a sealed run in a file beside its events, so that it is worked out once. The file names
//! the root of its run, and a digest shows a changed number.

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::path::PathBuf;

use crate::cli::terminal::{answer::progress, exit::Failure};
use crate::kernel::Digest;
use crate::kernel::canon::CanonError;
use crate::store;

const BYTES_MAX: u64 = 1 << 28;

/// A file of that sort.
pub struct KeptFile {
    pub path: PathBuf,
    /// Its word in format and digest.
    pub word: &'static str,
    /// Command that works it out again.
    pub again: &'static str,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept<T> {
    format: String,
    /// Root of the run that it was worked out of.
    root: Digest,
    /// Digest of what follows.
    digest: Digest,
    #[serde(alias = "credits")]
    kept: T,
}

impl KeptFile {
    fn format(&self) -> String {
        format!("evodrive-{}/1", self.word)
    }

    fn digest<T: Serialize>(&self, kept: &T) -> Result<Digest, CanonError> {
        Digest::of(&format!("evodrive/{}/1", self.word), kept)
    }

    /// Reads what it keeps of the run with this root; `None` if it was worked out of another run, or not at all.
    ///
    /// # Errors
    /// A file whose numbers were changed. A file that cannot be read is reported and then ignored: nothing rests on it.
    pub fn read<T: Serialize + DeserializeOwned>(&self, root: Digest) -> Result<Option<T>, Failure> {
        if !self.path.exists() {
            return Ok(None);
        }
        let damaged = |what: String| {
            let remedy = format!("remove the file; `{}` works it out again", self.again);
            Failure::corruption(format!("{}: {what}; {remedy}", self.path.display()))
        };
        let bytes = store::read_bounded(&self.path, BYTES_MAX)?;
        let kept: Kept<T> = match serde_json::from_slice(&bytes) {
            Ok(kept) => kept,
            Err(error) => {
                progress(damaged(format!("expected what was kept, found {error}; it is done without that")).message);
                return Ok(None);
            }
        };
        if kept.format != self.format() {
            return Err(damaged(format!("format: expected {}, found {}", self.format(), kept.format)));
        }
        let found = self.digest(&kept.kept).map_err(|error| damaged(error.to_string()))?;
        if found != kept.digest {
            return Err(damaged(format!("expected contents of digest {}, found {found}", kept.digest)));
        }
        Ok((kept.root == root).then_some(kept.kept))
    }

    /// Writes it anew.
    pub fn write<T: Serialize>(&self, root: Digest, kept: T) -> Result<(), Failure> {
        let digest = self.digest(&kept).map_err(Failure::internal)?;
        let kept = Kept { format: self.format(), root, digest, kept };
        let text = serde_json::to_vec_pretty(&kept).map_err(Failure::internal)?;
        Ok(store::write_atomic(&self.path, &text)?)
    }
}
