//! File formats of scenarios, import and export, and pictures of scenes and figures.

#![forbid(unsafe_code)]

#[cfg(test)]
pub(crate) use evodrive_core::synth;
pub(crate) use evodrive_core::{kernel, scene};
pub(crate) use evodrive_sim::sim;

#[cfg_attr(not(test), warn(missing_docs))]
pub mod draw;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod formats;
