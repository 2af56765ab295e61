//! The manifest: the content of a bundle, with size and digest of every file, and the versions and digests behind the run.

use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

use super::{BundleError, names};
use crate::kernel::Digest;

/// The format of this build.
pub const FORMAT: &str = "evodrive-bundle/1";
/// Most bytes of a manifest.
pub const MANIFEST_BYTES_MAX: u64 = 1 << 20;

/// Versions of meaning under which a run was made: another build executes it only if it has the same.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Version {
    /// The program's release.
    pub evodrive: String,
    /// `ADAPTER_VERSION`, `SIM_VERSION`, `EVAL_VERSION`.
    pub adapter: u32,
    pub sim: u32,
    pub eval: u32,
}

/// Content of a bundle and the run that it is of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// `evodrive-bundle/1`.
    pub format: String,
    /// Name of the experiment.
    pub name: String,
    /// Root of the run.
    pub root: Digest,
    /// Digests of the experiment's content and of the scenes, as the run's first event has them.
    pub experiment: Digest,
    pub pool: Digest,
    pub versions: Version,
    /// Files, in the order of their names.
    pub files: Vec<Content>,
}

/// One file of a bundle.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Content {
    pub path: String,
    pub bytes: u64,
    /// BLAKE3 of the bytes.
    pub digest: Digest,
}

impl Manifest {
    /// Reads the manifest in these bytes. Names and sizes are checked before anything is written.
    pub fn read(file: &str, bytes: &[u8], bytes_max: u64) -> Result<Manifest, BundleError> {
        #[derive(Deserialize)]
        struct Head {
            format: String,
        }
        let damaged = |problem: String| BundleError::Damaged { file: file.into(), problem };
        let refused = |problem: String| BundleError::Refused { file: file.into(), problem };
        let head: Head = serde_json::from_slice(bytes)
            .map_err(|error| damaged(format!("{}: expected a field `format`: {error}", names::MANIFEST)))?;
        if head.format != FORMAT {
            return Err(BundleError::Version { file: file.into(), expected: FORMAT, found: head.format });
        }
        let read: Manifest =
            serde_json::from_slice(bytes).map_err(|error| damaged(format!("{}: {error}", names::MANIFEST)))?;
        let mut seen = BTreeSet::new();
        for content in &read.files {
            if let Some(problem) = names::refused(&content.path) {
                return Err(refused(problem));
            }
            if !seen.insert(&content.path) {
                return Err(refused(format!("expected {} once, found it a second time", content.path)));
            }
        }
        let sum = read.files.iter().try_fold(0u64, |sum, content| sum.checked_add(content.bytes));
        match sum {
            Some(sum) if sum <= bytes_max => Ok(read),
            _ => Err(refused(format!(
                "expected at most {bytes_max} bytes, found {}; --bytes-max allows more",
                sum.map_or("more than fits into a number".into(), |sum| sum.to_string())
            ))),
        }
    }

    /// Returns its bytes.
    pub fn text(&self) -> Vec<u8> {
        let mut text = serde_json::to_vec_pretty(self).unwrap_or_default();
        text.push(b'\n');
        text
    }
}
