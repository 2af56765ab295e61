//! Rollouts over scenes, and from their outcomes to scores.

pub mod metrics;
pub mod protocol;
pub mod record;

pub use metrics::attack::AttackTarget;
pub use metrics::realism::{RealismError, RealismOptions, RealismWeights};
pub use protocol::metadrive::{EvaluationError, EvaluationOptions, SceneRef, evaluate, score_of};
pub use record::{CacheError, MemoryCache, RolloutCache, RolloutRecord, RolloutRequest, RolloutResult};

/// Rises when a score can change for the same outcomes.
pub const EVAL_VERSION: u32 = 1;
