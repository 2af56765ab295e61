//! The evaluator's lineage: a turn follows on the one before it, what is active is the incumbent or a promoted challenger, and the
//! next epoch is routed by what the turn left.

use super::finding::Finding;
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::WorldEvolved;

const CHECK: &str = "evaluator";

pub fn check(run: &RecordedRun, findings: &mut Vec<Finding>) {
    let mut before: Option<&WorldEvolved> = None;
    for turn in &run.evolved {
        let mut breach = |what: &str| findings.push(Finding::breach(CHECK, turn.name(), what));
        if before.is_some_and(|before| before.active_digest != turn.incumbent || before.epoch >= turn.epoch) {
            breach("does not follow the turn before it");
        }
        if turn.active.digest().ok() != Some(turn.active_digest) {
            breach("its active configuration has another digest");
        }
        let left = if turn.verdict() == "promoted" { turn.challenger } else { Some(turn.incumbent) };
        if left != Some(turn.active_digest) {
            breach("leaves a configuration active that is neither the incumbent nor a promoted one");
        }
        if turn.audit.held_epochs.iter().any(|held| *held > turn.epoch) || turn.audit.before_epoch != turn.epoch + 1 {
            breach("was audited with labels of a later epoch");
        }
        let mut next = run.frozen.iter().filter(|frozen| frozen.epoch == turn.epoch + 1);
        if next.any(|frozen| frozen.world != turn.snapshot) {
            breach("the next epoch was routed by another snapshot");
        }
        before = Some(turn);
    }
}
