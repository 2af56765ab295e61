//! What conducts a run: experiment files, epochs, shards and suites. The library `evodrive` shows these rooms under the same names.
//!
//! A crate of its own below the commands, so that these, which are many and run once, are compiled for a short wait alone, and so that
//! the compiler holds the wall: nothing here knows of arguments, terminals or clocks.

#![forbid(unsafe_code)]

pub(crate) use evodrive_engine::{
    adapters, archive, backend, candidates, compiler, ego, evaluation, families, kernel, learn, lineage, memory,
    objects, scene, sim, stage, store, synth, text, world,
};
#[cfg(test)]
pub(crate) use evodrive_io::scripted;
pub(crate) use evodrive_io::{agents, draw, evidence, formats, llm};

pub mod epoch;
pub mod experiment;
pub mod shard;
pub mod suite;
