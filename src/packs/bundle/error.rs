//! Why a bundle cannot be written or read.

use crate::store::StoreError;

/// Every text names the file, what was expected there and what was found.
#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    /// Not a bundle, or one that names what no bundle may hold.
    #[error("{file}: {problem}; nothing was written")]
    Refused {
        /// The bundle.
        file: String,
        /// What was expected and found.
        problem: String,
    },
    /// Bytes are not those that the manifest speaks of.
    #[error("{file} is damaged: {problem}; get another copy of it")]
    Damaged {
        /// The bundle.
        file: String,
        /// The place, what was expected and found.
        problem: String,
    },
    /// Another version of the format.
    #[error("{file}: format: expected {expected}, found {found:?}; use the version of evodrive that made it")]
    Version {
        /// The bundle.
        file: String,
        /// The format of this build.
        expected: &'static str,
        /// What the manifest says.
        found: String,
    },
    /// A file that is not a key, or a signature that does not hold.
    #[error("{file}: {problem}")]
    Signature {
        /// The key's file or the bundle.
        file: String,
        /// What was expected and found.
        problem: String,
        /// Whether it is the key that cannot be used, and not the signature.
        key: bool,
    },
    /// The disk did not do what was asked.
    #[error(transparent)]
    Store(#[from] StoreError),
}
