//! The language that is evolved: contracts of families, and from a patch to an admitted candidate.
//!
//! Nothing here knows how a program is carried out.

#![forbid(unsafe_code)]

#[cfg(test)]
pub(crate) use evodrive_core::scene;
pub(crate) use evodrive_core::{kernel, objects, text};
#[cfg(test)]
pub(crate) use evodrive_generators::families;

#[cfg_attr(not(test), warn(missing_docs))]
pub mod adapters;
pub mod candidates;
