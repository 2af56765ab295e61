//! The audit of a recorded run: whether what the record says agrees with itself and with what every run promises. It
//! reads events only; whether stored bytes are undamaged is the store's to say, whether rollouts come out the same
//! `evodrive verify`'s.

mod continuity;
mod epochs;
mod labels;
mod monitor;

use serde::Serialize;
use std::fmt;

use super::recorded_run::RecordedRun;

/// What a finding means for the run's result.
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
    /// Where: an attempt, a program, a lineage and epoch, or the whole run.
    pub place: String,
    /// What was found, and what was expected.
    pub what: String,
}

impl Finding {
    fn breach(check: &'static str, place: impl fmt::Display, what: impl Into<String>) -> Finding {
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

/// All findings of a run, finished or not, breaches first; empty for a run that keeps every promise.
pub fn audit(run: &RecordedRun) -> Vec<Finding> {
    let mut findings = Vec::new();
    continuity::check(run, &mut findings);
    epochs::check(run, &mut findings);
    labels::check(run, &mut findings);
    findings.extend(monitor::remark(run));
    findings.sort_by_key(|finding| finding.gravity);
    findings
}
