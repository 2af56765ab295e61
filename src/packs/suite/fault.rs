//! What a planner may do in place of driving. None of it is a pass, and none of it a crash on the road.

use serde::{Deserialize, Serialize};

use crate::sim::Undriven;

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

    /// The kind that a scene without an outcome shows; none where the planner is not to blame.
    pub fn of(why: &Undriven) -> Option<FaultKind> {
        match why {
            Undriven::TooSlow(_) => Some(FaultKind::TooSlow),
            Undriven::Abandoned(_) => Some(FaultKind::Abandoned),
            Undriven::Ended(_) => Some(FaultKind::Ended),
            Undriven::Junk(_) => Some(FaultKind::Junk),
            Undriven::Other(_) => None,
        }
    }
}
