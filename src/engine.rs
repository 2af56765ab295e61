//! The engine of EvoDrive: what determinism rests on, scenes and the simulator, the language of programs with its families and
//! compiler, and the stages that judge a candidate. These rooms are compiled for speed. The library `evodrive` shows them under
//! the same names beside the rooms that read, ask, conduct and print, which are compiled for a short build.
//!
//! A crate of its own, so that the compiler holds the wall: nothing here can reach a file format, a model or a command.

#![forbid(unsafe_code)]

#[doc(inline)]
pub use evodrive_text as text;

#[cfg_attr(not(test), warn(missing_docs))]
pub mod adapters;
pub mod archive;
pub mod backend;
pub mod candidates;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod compiler;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod ego;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod evaluation;
pub mod families;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod kernel;
pub mod learn;
pub mod lineage;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod memory;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod motion;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod objects;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod scene;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod search;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod sim;
pub mod stage;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod store;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod synth;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod world;
