//! From rollouts to labels: metrics, protocols and their records.
//!
//! Nothing here knows of patches, archives or experiments.

#![forbid(unsafe_code)]

#[cfg(test)]
pub(crate) use evodrive_core::synth;
pub(crate) use evodrive_core::{kernel, objects, scene};
#[cfg(test)]
pub(crate) use evodrive_generators::motion;
pub(crate) use evodrive_lang::adapters;
pub(crate) use evodrive_sim::{backend, ego, sim};
#[cfg(test)]
pub(crate) use evodrive_stages::archive;

#[cfg_attr(not(test), warn(missing_docs))]
pub mod evaluation;
