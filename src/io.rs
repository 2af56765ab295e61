//! EvoDrive's ways in and out: what reads and writes the formats of scenes, draws, asks models and answers as the scripted one,
//! packs bundles, and makes reports and tables of recorded runs. The library `evodrive` shows these rooms under the same names.
//!
//! A crate of its own, so that a fresh clone compiles it beside the crate that conducts runs, and so that the compiler holds the
//! wall: nothing here knows of experiments, epochs or commands.

#![forbid(unsafe_code)]

pub(crate) use evodrive_engine::{
    adapters, archive, evaluation, kernel, lineage, objects, scene, sim, store, text, world,
};
#[cfg(test)]
pub(crate) use evodrive_engine::{candidates, families, synth};

#[cfg_attr(not(test), warn(missing_docs))]
pub mod agents;
pub mod bundle;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod draw;
pub mod evidence;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod formats;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod llm;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod scripted;
