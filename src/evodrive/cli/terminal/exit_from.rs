//! Which exit code each room's errors mean.

use crate::agents::AgentError;
use crate::backend::{BackendError, RolloutCassetteError};
use crate::cli::records::redacted::redacted;
use crate::cli::terminal::exit::Failure;
use crate::epoch::RunError;
use crate::evaluation::{CacheError, EvaluationError};
use crate::experiment::{ExperimentError, ProgramFileError};
use crate::kernel::threads::ThreadsError;
use crate::llm::{AskError, CassetteError};
use crate::shard::ShardError;
use crate::store::StoreError;

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Failure {
        of_store(&error)
    }
}

fn of_store(error: &StoreError) -> Failure {
    match error {
        StoreError::Corrupt(_) => Failure::corruption(error),
        StoreError::Divergence(_) | StoreError::Conflict { .. } => Failure::divergence(error),
        // Whatever the disk refuses it refuses at a place that somebody chose, and it is named.
        StoreError::Io { .. }
        | StoreError::TooLarge { .. }
        | StoreError::Locked { .. }
        | StoreError::NoLocks { .. }
        | StoreError::Foreign { .. }
        | StoreError::Sealed { .. } => Failure::bad_input(error),
        StoreError::Absent { .. } => Failure::corruption(error),
        StoreError::Unstorable { .. } => Failure::internal(error),
    }
}

impl From<ThreadsError> for Failure {
    fn from(error: ThreadsError) -> Failure {
        match error {
            ThreadsError::TooMany(_) => Failure::bad_input(error),
            ThreadsError::Unstarted { .. } => Failure::internal(error),
        }
    }
}

impl From<CassetteError> for Failure {
    fn from(error: CassetteError) -> Failure {
        match &error {
            CassetteError::Damaged { .. } => Failure::corruption(error),
            _ => Failure::bad_input(error),
        }
    }
}

impl From<ExperimentError> for Failure {
    fn from(error: ExperimentError) -> Failure {
        match &error {
            ExperimentError::Store(store) => of_store(store),
            _ => Failure::bad_input(error),
        }
    }
}

impl From<ProgramFileError> for Failure {
    fn from(error: ProgramFileError) -> Failure {
        match &error {
            ProgramFileError::Store(store) => of_store(store),
            ProgramFileError::Digest { .. } | ProgramFileError::Truncated { .. } => Failure::corruption(error),
            _ => Failure::bad_input(error),
        }
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Failure {
        match &error {
            RunError::Agent(AgentError::Ask(AskError::Miss(_))) => Failure::miss(error),
            RunError::Agent(AgentError::Ask(AskError::Disk(store))) => of_store(store),
            RunError::Agent(AgentError::Ask(AskError::Store(_))) => Failure::internal(error),
            RunError::Interrupted | RunError::Agent(AgentError::Ask(AskError::Stopped)) => Failure::interrupted(error),
            RunError::Agent(_) | RunError::Study(_) | RunError::World(_) => Failure::bad_input(error),
            RunError::Evaluation(EvaluationError::NoLabel(_)) => Failure::bad_input(error),
            RunError::Evaluation(EvaluationError::Cache(cache)) => of_cache(cache),
            RunError::Evaluation(EvaluationError::Backend(backend)) => of_backend(backend),
            RunError::Store(store) => of_store(store),
            _ => Failure::internal(error),
        }
    }
}

impl From<BackendError> for Failure {
    fn from(error: BackendError) -> Failure {
        of_backend(&error)
    }
}

impl From<RolloutCassetteError> for Failure {
    fn from(error: RolloutCassetteError) -> Failure {
        of_rollouts(&error)
    }
}

impl From<ShardError> for Failure {
    fn from(error: ShardError) -> Failure {
        match &error {
            ShardError::Damaged { .. } => Failure::corruption(error),
            ShardError::Foreign { .. } | ShardError::Withdrawn(_) => Failure::bad_input(error),
            ShardError::Diverged(_) | ShardError::Untrue(_) => Failure::divergence(error),
            ShardError::Store(store) => of_store(store),
            ShardError::Cassette(cassette) => of_rollouts(cassette),
            ShardError::Canon(_) => Failure::internal(error),
        }
    }
}

fn of_backend(error: &BackendError) -> Failure {
    match error {
        BackendError::Miss(_) => Failure::miss(error),
        BackendError::Unplayable(_) => Failure::bad_input(error),
        BackendError::Untrue(_) => Failure::divergence(error),
        // A process may have said anything in place of what was expected.
        BackendError::Worker(_) => Failure::bad_input(redacted(&error.to_string())),
        BackendError::Planner(_) => Failure { is_planners: true, ..Failure::bad_input(redacted(&error.to_string())) },
        BackendError::Cassette(cassette) => of_rollouts(cassette),
        BackendError::Store(store) => of_store(store),
        BackendError::Key(_) => Failure::internal(error),
    }
}

fn of_rollouts(error: &RolloutCassetteError) -> Failure {
    match error {
        RolloutCassetteError::Damaged { .. } => Failure::corruption(error),
        RolloutCassetteError::Store(store) => of_store(store),
        RolloutCassetteError::Version { .. }
        | RolloutCassetteError::Backend { .. }
        | RolloutCassetteError::Planner { .. } => Failure::bad_input(error),
    }
}

fn of_cache(error: &CacheError) -> Failure {
    match error {
        CacheError::Diverged { .. } => Failure::divergence(error),
        CacheError::Damaged { .. } => Failure::corruption(error),
        CacheError::Store(inner) => match inner.downcast_ref::<StoreError>() {
            Some(store) => of_store(store),
            None => Failure::internal(error),
        },
    }
}
