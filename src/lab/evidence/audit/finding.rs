//! One finding of the audit.

use serde::Serialize;
use std::fmt;

/// Weight of a finding for the run's result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Gravity {
    /// The record contradicts itself or breaks a promise: the result cannot be trusted.
    Breach,
    /// The record is sound and shows something that whoever uses the result should know.
    Remark,
}

/// One thing that the audit found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    pub gravity: Gravity,
    /// The check that found it: `continuity`, `epochs`, `labels`, `closed suite`, `front`, `result` or `monitor`.
    pub check: &'static str,
    /// Place of the finding: an attempt, a program, a lineage and epoch, or the whole run.
    pub place: String,
    /// Text on what was found and what was expected.
    pub what: String,
}

impl Finding {
    /// A finding that speaks against the result.
    pub fn breach(check: &'static str, place: impl fmt::Display, what: impl Into<String>) -> Finding {
        Finding { gravity: Gravity::Breach, check, place: place.to_string(), what: what.into() }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let gravity = match self.gravity {
            Gravity::Breach => "breach",
            Gravity::Remark => "remark",
        };
        write!(f, "{gravity} ({}) {}: {}", self.check, self.place, self.what)
    }
}
