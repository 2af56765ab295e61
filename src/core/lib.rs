//! Basis of determinism and records, and the nouns: float functions, random streams and canonical bytes, all disk access, scenes
//! recorded or generated, and the types that travel between the rooms above.

#![forbid(unsafe_code)]

#[cfg_attr(not(test), warn(missing_docs))]
pub mod kernel;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod objects;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod scene;
pub mod statistics;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod store;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod synth;
pub mod text;
