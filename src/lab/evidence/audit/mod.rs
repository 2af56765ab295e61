//! The audit of a recorded run: whether what the record says agrees with itself and with what every run promises. It
//! reads events only; whether stored bytes are undamaged is the store's to say, whether rollouts come out the same
//! `evodrive verify`'s.

mod continuity;
mod epochs;
mod evaluator;
mod finding;
mod labels;
mod monitor;

pub use finding::{Finding, Gravity};

use super::recorded_run::RecordedRun;

/// All findings of a run, finished or not, breaches first; empty for a run that keeps every promise.
pub fn audit(run: &RecordedRun) -> Vec<Finding> {
    let mut findings = Vec::new();
    continuity::check(run, &mut findings);
    epochs::check(run, &mut findings);
    labels::check(run, &mut findings);
    evaluator::check(run, &mut findings);
    findings.extend(monitor::remark(run));
    findings.sort_by_key(|finding| finding.gravity);
    findings
}
