//! Epochs and exits: every slot left one attempt, every attempt edited what its epoch froze, and each went out by the
//! exit that its own evidence names.

use super::finding::Finding;
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::event::{ExitCounts, Frozen, Settled};
use crate::objects::{Attempt, AttemptId, Exit, RouteDecision};

const CHECK: &str = "epochs";

pub fn check(run: &RecordedRun, findings: &mut Vec<Finding>) {
    for frozen in &run.frozen {
        epoch(run, frozen, findings);
    }
    for attempt in &run.attempts {
        if attempt.id != AttemptId::at(&attempt.lineage, attempt.epoch, attempt.slot) {
            findings.push(Finding::breach(CHECK, &attempt.id, "its id is not that of its lineage, epoch and slot"));
        }
        if !run.frozen.iter().any(|frozen| belongs(frozen, attempt)) {
            findings.push(Finding::breach(CHECK, &attempt.id, "no epoch was frozen for it"));
        }
        if let Some(what) = exit_fault(&attempt.exit) {
            findings.push(Finding::breach(CHECK, &attempt.id, what));
        }
    }
    for settled in &run.settled {
        promoted(run, settled, findings);
    }
    if let Some(result) = &run.result {
        let mut exits = ExitCounts::default();
        run.attempts.iter().for_each(|attempt| exits.count(attempt));
        if exits != result.exits {
            let what = format!("counts the exits {:?}, the attempts are {exits:?}", result.exits);
            findings.push(Finding::breach("result", "result", what));
        }
    }
}

fn belongs(frozen: &Frozen, attempt: &Attempt) -> bool {
    frozen.lineage == attempt.lineage && frozen.epoch == attempt.epoch
}

/// Slots 0, 1, ... in order, as many as were frozen where the epoch is settled, all of the frozen parent.
fn epoch(run: &RecordedRun, frozen: &Frozen, findings: &mut Vec<Finding>) {
    let place = format!("{} epoch {}", frozen.lineage, frozen.epoch);
    let attempts: Vec<&Attempt> = run.attempts.iter().filter(|attempt| belongs(frozen, attempt)).collect();
    let is_settled = run.settled.iter().any(|s| s.lineage == frozen.lineage && s.epoch == frozen.epoch);
    if !attempts.iter().map(|attempt| attempt.slot).eq(0..attempts.len() as u32)
        || (is_settled && attempts.len() != frozen.slots as usize)
    {
        let slots: Vec<String> = attempts.iter().map(|attempt| attempt.slot.to_string()).collect();
        let what = format!("{} slots were frozen, the attempts are of slots {}", frozen.slots, slots.join(", "));
        findings.push(Finding::breach(CHECK, place, what));
    }
    for attempt in attempts {
        let (parent, hash) = match frozen.second_parent(attempt.slot) {
            Some(second) => (&second.parent, second.parent_hash),
            None => (&frozen.parent, frozen.parent_hash),
        };
        if (&attempt.parent, attempt.parent_hash) != (parent, hash) {
            let what = format!("edited {}, frozen was {parent}", attempt.parent);
            findings.push(Finding::breach(CHECK, &attempt.id, what));
        }
    }
}

/// Returns what speaks against the exit that an attempt took.
fn exit_fault(exit: &Exit) -> Option<String> {
    let (gates, route) = (exit.gates(), exit.route());
    match exit {
        Exit::Declined { .. } => None,
        Exit::Invalid { .. } => gates.filter(|g| g.passed()).map(|_| "is invalid, but all gates passed".to_string()),
        Exit::Rejected { .. } | Exit::Evaluated { .. } => {
            if let Some(gates) = gates.filter(|gates| !gates.passed()) {
                let failed: Vec<String> = gates.failed().map(|v| format!("{:?}", v.gate).to_lowercase()).collect();
                return Some(format!("went on after the gates, but did not pass: {}", failed.join(", ")));
            }
            let rejected = route.is_some_and(|route| route.decision == RouteDecision::Reject);
            let expected = matches!(exit, Exit::Rejected { .. });
            (rejected != expected).then(|| format!("is {}, but the router decided something else", exit.name()))
        }
    }
}

/// Checks that at most one attempt of an epoch says that it was promoted, two under the rule of two anchors: the epoch names the first.
fn promoted(run: &RecordedRun, settled: &Settled, findings: &mut Vec<Finding>) {
    let of_epoch = run.attempts.iter().filter(|a| a.lineage == settled.lineage && a.epoch == settled.epoch);
    let promoted: Vec<&AttemptId> =
        of_epoch.filter(|a| a.exit.decision().is_some_and(|decision| decision.promoted)).map(|a| &a.id).collect();
    let most = if settled.realism_anchor.is_some() { 2 } else { 1 };
    if promoted.len() > most || promoted.first().copied() != settled.promoted.as_ref() {
        let place = format!("{} epoch {}", settled.lineage, settled.epoch);
        let named = settled.promoted.as_ref().map_or("nobody".to_string(), |id| id.to_string());
        let what = format!("promoted {named}, the attempts that say they were promoted: {promoted:?}");
        findings.push(Finding::breach(CHECK, place, what));
    }
}
