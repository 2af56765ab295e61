//! Exit codes as a type: part of the program's interface, listed in docs/RUNS.md.

use std::process::ExitCode;

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    Success = 0,
    /// A file, argument or experiment that cannot be used as it is, or a place that cannot be written to (a full disk).
    BadInput = 2,
    /// Replay met a question without a recorded answer.
    CassetteMiss = 3,
    /// Something was computed again and came out differently.
    Divergence = 4,
    /// Stored bytes are not what they were.
    Corruption = 5,
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
}

impl Failure {
    pub fn bad_input(message: impl std::fmt::Display) -> Failure {
        Failure { exit: Exit::BadInput, message: message.to_string() }
    }

    pub fn miss(message: impl std::fmt::Display) -> Failure {
        Failure { exit: Exit::CassetteMiss, message: message.to_string() }
    }

    pub fn divergence(message: impl std::fmt::Display) -> Failure {
        Failure { exit: Exit::Divergence, message: message.to_string() }
    }

    pub fn corruption(message: impl std::fmt::Display) -> Failure {
        Failure { exit: Exit::Corruption, message: message.to_string() }
    }

    pub fn internal(message: impl std::fmt::Display) -> Failure {
        Failure { exit: Exit::Internal, message: message.to_string() }
    }

    pub fn interrupted(message: impl std::fmt::Display) -> Failure {
        Failure { exit: Exit::Interrupted, message: message.to_string() }
    }
}
