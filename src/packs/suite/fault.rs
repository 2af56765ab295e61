//! Faults of a planner in place of a drive. None is a pass, and none is a crash on the road.

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
    /// Returns the name in tables.
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

    /// Returns the kind that a scene without an outcome shows; `None` where the planner is not to blame.
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
