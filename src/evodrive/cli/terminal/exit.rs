//! Exit codes as a type: part of the program's interface, listed in docs/RUNS.md.

use std::process::ExitCode;

use crate::cli::terminal::outside::bounded;

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    Success = 0,
    /// A suite was driven, and a threshold does not hold, or a planner gave no drive; a draft would not pass.
    Broken = 1,
    /// A file, argument or experiment that cannot be used as it is, or a place that cannot be written to (a full disk).
    BadInput = 2,
    /// Replay met a question without a recorded answer.
    CassetteMiss = 3,
    /// Something was computed again and came out differently.
    Divergence = 4,
    /// Stored bytes are not what they were.
    Corruption = 5,
    /// This machine lacks what a shard needs: another one may have it.
    Lacking = 69,
    /// A bug, or a failure of the machine that no place or file explains (no threads).
    Internal = 70,
    /// Ctrl-C: what was done is kept, and the message says how to go on. Shells use this number for it.
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> ExitCode {
        ExitCode::from(exit as u8)
    }
}

/// A command that failed: its exit code and what to tell the user.
#[derive(Debug)]
pub struct Failure {
    pub exit: Exit,
    pub message: String,
    /// True if the program under test is to be repaired first; then it is another ego, with a run folder of its own.
    pub is_planners: bool,
}

impl Failure {
    fn of(exit: Exit, message: &dyn std::fmt::Display) -> Failure {
        Failure { exit, message: bounded(&message.to_string()).into_owned(), is_planners: false }
    }

    pub fn bad_input(message: impl std::fmt::Display) -> Failure {
        Failure::of(Exit::BadInput, &message)
    }

    pub fn miss(message: impl std::fmt::Display) -> Failure {
        Failure::of(Exit::CassetteMiss, &message)
    }

    pub fn divergence(message: impl std::fmt::Display) -> Failure {
        Failure::of(Exit::Divergence, &message)
    }

    pub fn corruption(message: impl std::fmt::Display) -> Failure {
        Failure::of(Exit::Corruption, &message)
    }

    pub fn lacking(message: impl std::fmt::Display) -> Failure {
        Failure::of(Exit::Lacking, &message)
    }

    pub fn internal(message: impl std::fmt::Display) -> Failure {
        Failure::of(Exit::Internal, &message)
    }

    pub fn interrupted(message: impl std::fmt::Display) -> Failure {
        Failure::of(Exit::Interrupted, &message)
    }
}
