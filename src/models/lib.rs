//! Proposals and who makes them: requests to models, their keys and cassettes, the agents and their questions, and the scripted stand-in.
//!
//! Nothing here knows what became of a proposal.

#![forbid(unsafe_code)]

pub(crate) use evodrive_core::{kernel, objects, store, text};
#[cfg(test)]
pub(crate) use evodrive_generators::families;
pub(crate) use evodrive_lang::adapters;
#[cfg(test)]
pub(crate) use evodrive_lang::candidates;
#[cfg(test)]
pub(crate) use evodrive_sim::sim;

#[cfg_attr(not(test), warn(missing_docs))]
pub mod agents;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod llm;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod scripted;
