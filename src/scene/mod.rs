//! What a scenario is: road, tracks, lights, ego and route, where they come from and how they are pooled.

pub mod synth;
pub mod types;

pub use types::*;
