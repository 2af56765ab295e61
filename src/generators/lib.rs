//! Generator programs at work: what moves, what searches, the source families, and the compiler from a program to an intervention.
//!
//! Compiled for speed. Nothing here asks a model or keeps a record.

#![forbid(unsafe_code)]

pub(crate) use evodrive_core::{kernel, objects, scene, synth};
pub(crate) use evodrive_lang::adapters;
pub(crate) use evodrive_sim::{ego, sim};

#[cfg_attr(not(test), warn(missing_docs))]
pub mod compiler;
pub mod families;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod motion;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod search;
pub mod stage;
