//! What a planner may do in place of driving. None of it is a pass, and none of it a crash on the road.

use serde::{Deserialize, Serialize};

/// Why a planner gave no drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// It could not be started, or did not greet.
    NotStarted,
    /// Its process ended.
    Ended,
    /// An answer took longer than its limit.
    TooSlow,
    /// It answered something that is no decision.
    Junk,
    /// It did not want to drive.
    Abandoned,
    /// Another process of it answered the same question differently.
    Inconsistent,
}

impl FaultKind {
    /// In tables.
    pub fn name(self) -> &'static str {
        match self {
            FaultKind::NotStarted => "not started",
            FaultKind::Ended => "ended",
            FaultKind::TooSlow => "too slow",
            FaultKind::Junk => "junk",
            FaultKind::Abandoned => "abandoned",
            FaultKind::Inconsistent => "inconsistent",
        }
    }

    /// The kind that a recorded reason names; none where the planner is not to blame.
    pub fn of(reason: &str) -> Option<FaultKind> {
        if reason.contains("which is not finite; this is a fault of the driver") {
            return Some(FaultKind::Junk);
        }
        // Who is late is named first.
        if reason.starts_with("too slow: ") {
            return Some(FaultKind::TooSlow);
        }
        if reason.starts_with("abandoned: planner `") {
            return Some(FaultKind::Abandoned);
        }
        if !reason.starts_with("planner `") {
            return None;
        }
        Some(match reason {
            _ if reason.contains(": the process ended") => FaultKind::Ended,
            _ if reason.contains(": no answer within ") => FaultKind::TooSlow,
            _ => FaultKind::Junk,
        })
    }
}
