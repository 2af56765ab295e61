//! A worker's second step: the patch is applied, the gates judge it, and the compiler tries the child on probe scenes.

use std::sync::{Mutex, PoisonError};

use super::{
    RunError,
    desk::Tools,
    draft::{Draft, Reached},
    freeze::Snapshot,
    labels::Labelling,
    probes::probes,
    study::Study,
};
use crate::candidates::{self, Admission, Trials};
use crate::kernel::Digest;
use crate::objects::{AttemptId, Program, ProgramPatch, SolutionId};

/// Judges a proposed patch.
pub fn admit(study: &Study, snapshot: &Snapshot<'_>, draft: Draft, tools: &Tools<'_>) -> Result<Draft, RunError> {
    draft.next(|slot, reached| match reached {
        Reached::Proposed { patch } => judged(study, snapshot, slot, patch, tools),
        ended => Ok(ended),
    })
}

fn judged(
    study: &Study,
    snapshot: &Snapshot<'_>,
    slot: u32,
    patch: Box<ProgramPatch>,
    tools: &Tools<'_>,
) -> Result<Reached, RunError> {
    let (admission, trials) = admission(study, snapshot, slot, &patch, tools)?;
    Ok(match admission.candidate {
        None => Reached::Invalid { gates: admission.gates },
        Some(candidate) => {
            let (gates, candidate) = (admission.gates, Box::new(candidate));
            Reached::Admitted { gates, candidate, patch, probes: trials.probes }
        }
    })
}

/// What the gates say of a patch for the parent of a slot, and what came of compiling its child. The agents are told the
/// same before their critics speak; what was compiled then is not compiled again.
pub fn admission(
    study: &Study,
    snapshot: &Snapshot<'_>,
    slot: u32,
    patch: &ProgramPatch,
    tools: &Tools<'_>,
) -> Result<(Admission, Trials), RunError> {
    let contract = &study.source(snapshot.spec)?.contract;
    let child = SolutionId::new(AttemptId::at(&snapshot.spec.id, snapshot.event.epoch, slot).0);
    let labelling = Labelling { study, spec: snapshot.spec, counsels: &snapshot.counsels, tools };
    // The gates know no error of the store: it waits here until they are done.
    let outcome: Mutex<Result<Trials, RunError>> = Mutex::new(Ok(Trials::default()));
    let parent = snapshot.parent_of(slot);
    let tried = |program: &Program, hash: Digest| {
        let probes = probes(study, snapshot.spec, &snapshot.window, program, &parent.program)?;
        labelling.trials(&probes, (program, hash), (&parent.program, parent.hash))
    };
    let compiles = |program: &Program, hash: Digest| {
        let found = tried(program, hash);
        let trials = found.as_ref().map(Trials::clone).unwrap_or_default();
        *outcome.lock().unwrap_or_else(PoisonError::into_inner) = found;
        trials
    };
    let admission = candidates::admit(&parent.program, patch, child, contract, &study.registry, &compiles);
    let trials = outcome.into_inner().unwrap_or_else(PoisonError::into_inner)?;
    Ok((admission, trials))
}
