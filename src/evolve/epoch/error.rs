//! Why a run stopped. What a model answers never stops one.

use crate::agents::AgentError;
use crate::archive::{ArchiveError, ObjectivesError};
use crate::evaluation::{CacheError, EvaluationError};
use crate::kernel::canon::CanonError;
use crate::lineage::LineageError;
use crate::memory::MemoryError;
use crate::store::StoreError;
use crate::world::{ConfigurationError, FeatureError, LabelError, RouterError};

/// A run that could not go on.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    #[error(transparent)]
    Agent(#[from] AgentError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    #[error(transparent)]
    Objectives(#[from] ObjectivesError),
    #[error(transparent)]
    Lineage(#[from] LineageError),
    #[error(transparent)]
    Memory(#[from] MemoryError),
    #[error("world evaluator: {0}")]
    World(String),
    #[error(transparent)]
    Canon(#[from] CanonError),
    /// A plan cannot see further until records are there; what is missing was gathered.
    #[error("records are missing; `evodrive shard plan` lists them")]
    Wanting,
    /// Whoever started the run wants it to stop.
    #[error("interrupted")]
    Interrupted,
    /// Scenes, families or options that do not fit together.
    #[error("{0}")]
    Study(String),
}

impl From<CacheError> for RunError {
    fn from(error: CacheError) -> RunError {
        RunError::Evaluation(error.into())
    }
}

impl From<ConfigurationError> for RunError {
    fn from(error: ConfigurationError) -> RunError {
        RunError::World(error.to_string())
    }
}

impl From<FeatureError> for RunError {
    fn from(error: FeatureError) -> RunError {
        RunError::World(error.to_string())
    }
}

impl From<LabelError> for RunError {
    fn from(error: LabelError) -> RunError {
        RunError::World(error.to_string())
    }
}

impl From<RouterError> for RunError {
    fn from(error: RouterError) -> RunError {
        RunError::World(error.to_string())
    }
}
