//! A worker's first step: the actor and its critics are asked for one patch of the frozen parent.

use super::{
    RunError, briefing,
    desk::Tools,
    draft::{Draft, Head, Reached},
    freeze::Snapshot,
    study::Study,
};
use crate::agents::{self, End, Task};

/// Asks for the proposal of one slot.
pub fn propose(study: &Study, snapshot: &Snapshot<'_>, slot: u32, tools: &Tools<'_>) -> Result<Draft, RunError> {
    let parent = snapshot.parent_of(slot);
    let target = briefing::target(study, slot, &parent.score);
    let task = Task {
        briefing: &parent.briefing,
        slot,
        target: &target,
        models: &study.models,
        max_repair_rounds: study.budget.max_repair_rounds,
    };
    let proposed = agents::propose(&task, &tools.meter.asking(tools.ask, &snapshot.spec.id))?;
    let reached = match proposed.end {
        End::Declined { reason } => Reached::Declined { reason },
        End::Patch(patch) => Reached::Proposed { patch: Box::new(patch) },
    };
    Ok(Draft { head: Head { slot, target: target.text, proposal: proposed.proposal }, reached })
}
