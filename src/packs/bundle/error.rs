//! Why a bundle cannot be written or read.

use crate::store::StoreError;

/// Every text names the file, what was expected there and what was found.
#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    /// Not a bundle, or one with entries that no bundle may hold.
    #[error("{file}: {problem}; nothing was written")]
    Refused {
        /// The bundle.
        file: String,
        /// Description of what was expected and found.
        problem: String,
    },
    /// Bytes differ from those of the manifest.
    #[error("{file} is damaged: {problem}; get another copy of it")]
    Damaged {
        /// The bundle.
        file: String,
        /// The place, and a description of what was expected and found.
        problem: String,
    },
    /// Another version of the format.
    #[error("{file}: format: expected {expected}, found {found:?}; use the version of evodrive that made it")]
    Version {
        /// The bundle.
        file: String,
        /// The format of this build.
        expected: &'static str,
        /// Format that the manifest names.
        found: String,
    },
    /// A file that is not a key, or a signature that does not hold.
    #[error("{file}: {problem}")]
    Signature {
        /// The key's file or the bundle.
        file: String,
        /// Description of what was expected and found.
        problem: String,
        /// True if the key cannot be used, false if the signature is at fault.
        key: bool,
    },
    /// A fault of the disk.
    #[error(transparent)]
    Store(#[from] StoreError),
}
