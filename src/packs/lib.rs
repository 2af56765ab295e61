//! Files that travel: frozen suites for planners and their results, and a run as one bundle.

#![forbid(unsafe_code)]

pub(crate) use evodrive_core::{kernel, objects, scene, statistics, store};
pub(crate) use evodrive_formats::draw;
#[cfg(test)]
pub(crate) use evodrive_sim::learn;
pub(crate) use evodrive_sim::sim;

pub mod bundle;
pub mod suite;
