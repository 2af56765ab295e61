//! A worker's first step: the actor and its critics are asked for one patch of the frozen parent.

use std::cell::RefCell;

use super::admit::admission;
use super::draft::{Draft, Head, Reached, Verdict};
use crate::agents::{self, End, Findings, Task};
use crate::epoch::RunError;
use crate::epoch::acceptance::{rival, search};
use crate::epoch::briefs::target::Aims;
use crate::epoch::freeze::Snapshot;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::Study;
use crate::objects::{Objectives, ProgramPatch};

/// Asks for the proposal of one slot.
pub fn propose(study: &Study, snapshot: &Snapshot<'_>, slot: u32, tools: &Tools<'_>) -> Result<Draft, RunError> {
    let parent = snapshot.parent_of(slot);
    let front: Vec<Objectives> = snapshot.archive.front().map(|entry| entry.objectives).collect();
    let aims = Aims {
        parent: &parent.outcome,
        seen: parent.seen.as_ref(),
        inherits: parent.program.generation > 0,
        front: &front,
        realism_min: study.selector.realism_min,
        epsilon_r: study.archive.epsilon_r,
        epsilon_a: study.archive.epsilon_a,
    };
    let target = search::target(study, &aims, snapshot.event.epoch, slot);
    if study.method().draws_patches() {
        return rival::random(study, snapshot, slot, target.text);
    }
    let critics = study.critics();
    let task = Task {
        briefing: &parent.briefing,
        slot,
        target: &target,
        models: &study.models,
        critics: &critics,
        max_repair_rounds: if study.without.repair { 0 } else { study.budget.max_repair_rounds },
        gates: study.proposals.gates,
        unreadable_critic: study.proposals.unreadable_critic,
        unreadable_patch: study.proposals.unreadable_patch,
        tunes: study.tuning().is_some(),
    };
    // What the gates said of the latest patch: the next step asks the same of the one that is left.
    let latest: RefCell<Option<(ProgramPatch, Verdict)>> = RefCell::new(None);
    let check = |patch: &ProgramPatch| -> Result<Findings, RunError> {
        let verdict = admission(study, snapshot, slot, patch, tools)?;
        let Verdict { admission, trials, .. } = &verdict;
        let findings =
            Findings { gates: admission.gates.clone(), compared: trials.compared, differing: trials.differing };
        latest.replace(Some((patch.clone(), verdict)));
        Ok(findings)
    };
    let proposed = agents::propose(&task, &tools.asking(&snapshot.spec.id), &check)?;
    let reached = match proposed.end {
        End::Declined { reason } => Reached::Declined { reason },
        End::Patch(patch) => {
            let verdict = latest.into_inner().filter(|(judged, _)| *judged == patch).map(|(_, verdict)| verdict);
            Reached::Proposed { patch: Box::new(patch), verdict: verdict.map(Box::new) }
        }
    };
    Ok(Draft { head: Head::new(slot, target.text, proposed.proposal), reached })
}
