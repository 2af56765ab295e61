//! Means by which an epoch decides: the Pareto archive, lineages, memory and the world evaluator.
//!
//! Nothing here simulates, asks a model or keeps a record.

#![forbid(unsafe_code)]

pub(crate) use evodrive_core::{kernel, objects, scene, statistics};

pub mod archive;
pub mod lineage;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod memory;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod world;
