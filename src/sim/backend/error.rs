//! Why there is no answer to a rollout request: a scene that failed, or a reason to stop.

use super::cassette::RolloutCassetteError;
use crate::kernel::{Digest, canon::CanonError};
use crate::sim::{SimError, Undriven};
use crate::store::StoreError;

/// Why there is no outcome.
#[derive(Debug)]
pub enum NoOutcome {
    /// This scene has no label; others may have one.
    Scene(Undriven),
    /// Nothing can go on.
    Stop(BackendError),
}

impl NoOutcome {
    /// Returns the reason in words.
    pub fn reason(self) -> String {
        match self {
            NoOutcome::Scene(why) => why.to_string(),
            NoOutcome::Stop(error) => error.to_string(),
        }
    }
}

impl From<SimError> for NoOutcome {
    fn from(error: SimError) -> NoOutcome {
        NoOutcome::Scene(error.into())
    }
}

impl From<String> for NoOutcome {
    fn from(reason: String) -> NoOutcome {
        NoOutcome::Scene(reason.into())
    }
}

impl From<BackendError> for NoOutcome {
    fn from(error: BackendError) -> NoOutcome {
        NoOutcome::Stop(error)
    }
}

/// A backend that cannot be used as it is.
#[derive(Debug, thiserror::Error)]
pub enum BackendError {
    #[error(transparent)]
    Miss(#[from] Box<Miss>),
    #[error(transparent)]
    Worker(#[from] Fault),
    /// A planner that nothing can rest on as it is. Once repaired, it is another ego.
    #[error(transparent)]
    Planner(Box<Fault>),
    #[error(transparent)]
    Cassette(#[from] RolloutCassetteError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("the key of a rollout request cannot be computed: {0}")]
    Key(#[from] CanonError),
    /// A recorded rollout that nobody can have driven.
    #[error("{0}")]
    Untrue(String),
    /// A scene or a driver that only our own backend has.
    #[error("{0}")]
    Unplayable(String),
}

impl BackendError {
    /// A planner that nothing can rest on.
    pub(super) fn planner(fault: Fault) -> BackendError {
        BackendError::Planner(Box::new(fault))
    }
}

/// A rollout that was not recorded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "no recorded rollout in {cassette}: scene {scene} against the ego {ego}, {adversaries} adversaries, request {key}; \
     the cassette has {recorded} rollouts, {of_scene} of them of this scene\n  to record it: {remedy}"
)]
pub struct Miss {
    /// File in which it was looked for.
    pub cassette: String,
    pub key: Digest,
    pub scene: String,
    pub ego: String,
    pub adversaries: usize,
    /// Rollouts that the cassette has, and how many of them are of this scene.
    pub recorded: usize,
    pub of_scene: usize,
    /// The command that would record it.
    pub remedy: String,
}

/// Something that a worker did and that no worker may do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("worker `{command}`, {place}: expected {expected}, found {found}; {remedy}; none of its answers was recorded")]
pub struct Fault {
    pub command: String,
    /// Line that is wrong: the greeting, or the answer to a named request.
    pub place: String,
    pub expected: String,
    pub found: String,
    pub remedy: String,
}
