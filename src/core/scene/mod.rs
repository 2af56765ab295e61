//! Parts of a scenario: road, tracks, lights, ego and route, their origin, and pools of scenarios.

pub mod beside;
pub mod binary;
pub mod consistency;
pub mod features;
#[cfg(any(test, feature = "fixtures"))]
pub mod fixture;
pub mod lanes;
pub mod pieces;
pub mod pool;
pub mod prepared;
pub mod remainder;
pub mod route;
pub mod safebench;
pub mod stats;
pub mod types;
pub mod usable;
pub mod validate;

pub use features::SceneFeatures;
pub use lanes::{LaneGraph, LanePlace, Reached};
pub use pool::{EvolutionSize, LeftOut, Pool, PoolError, Split, SplitScene};
pub use prepared::PreparedScene;
pub use types::*;
pub use usable::{Unusable, usable};
pub use validate::Violation;
