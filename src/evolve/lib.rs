//! The loop: epochs, experiment files and shards.
//!
//! Nothing here knows of arguments, terminals or clocks.

#![forbid(unsafe_code)]

pub(crate) use evodrive_core::{kernel, objects, scene, store, synth, text};
pub(crate) use evodrive_formats::formats;
pub(crate) use evodrive_generators::{compiler, families, stage};
pub(crate) use evodrive_labels::evaluation;
pub(crate) use evodrive_lang::{adapters, candidates};
#[cfg(test)]
pub(crate) use evodrive_models::scripted;
pub(crate) use evodrive_models::{agents, llm};
pub(crate) use evodrive_sim::{backend, ego, learn, sim};
pub(crate) use evodrive_stages::{archive, lineage, memory, world};

pub mod epoch;
pub mod experiment;
pub mod shard;
