//! The record of an attempt: what was proposed, from which parent and memory, and how it ended.

use crate::epoch::freeze::Snapshot;
use crate::epoch::slots::draft::Considered;
use crate::objects::{Attempt, AttemptId, CardId};

/// Builds the record of a judged proposal. Every proposal leaves one.
pub fn seal(snapshot: &Snapshot<'_>, considered: Considered) -> Attempt {
    let Considered { head, exit } = considered;
    let parent = snapshot.parent_of(head.slot);
    Attempt {
        id: AttemptId::at(&snapshot.spec.id, snapshot.event.epoch, head.slot),
        lineage: snapshot.spec.id.clone(),
        epoch: snapshot.event.epoch,
        slot: head.slot,
        parent: parent.program.solution_id.clone(),
        parent_hash: parent.hash,
        target: head.target,
        memory_shown: parent.memory_shown.iter().map(CardId::new).collect(),
        proposal: head.proposal,
        exit,
    }
}
