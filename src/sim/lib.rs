//! The plant: the seeded closed loop, the drivers under test and their training, and other simulators behind workers.
//!
//! Compiled for speed. Nothing here knows of programs, models or files of scenes.

#![forbid(unsafe_code)]

pub(crate) use evodrive_core::{kernel, scene, store};

pub mod backend;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod ego;
pub mod learn;
#[cfg_attr(not(test), warn(missing_docs))]
pub mod sim;
