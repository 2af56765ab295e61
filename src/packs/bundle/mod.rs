//! A run as one file that can be sent or published: experiment, scenes, recorded answers, events, result, recorded rollouts. A tar archive
//! under zstd with a manifest in front, RO-Crate metadata for people who search for it, and an optional signature
//! (docs/BUNDLES.md). Equal contents give equal bytes.

mod crate_metadata;
mod error;
mod manifest;
mod names;
mod read;
mod signature;
mod write;

pub use error::BundleError;
pub use manifest::{Content, Manifest, Version};
pub use read::{Opened, open};
pub use signature::{Signer, key_name, verified};
pub use write::{About, Part, Source, create};
