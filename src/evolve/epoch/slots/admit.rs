//! A worker's second step: the patch is applied, the gates judge it, and the compiler tries the child on probe scenes.

use std::sync::{Mutex, PoisonError};

use super::draft::{Admitted, Draft, Reached, Verdict};
use super::nothing;
use super::probes::probes;
use crate::candidates::{self, Trials};
use crate::epoch::RunError;
use crate::epoch::briefs::in_effect::{InScene, in_effect};
use crate::epoch::freeze::Snapshot;
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::Study;
use crate::kernel::Digest;
use crate::objects::{AttemptId, Gate, GateVerdict, HashedProgram, Program, ProgramPatch, SolutionId};

/// Judges a proposed patch, if its proposer did not learn the verdict already.
pub fn admit(study: &Study, snapshot: &Snapshot<'_>, draft: Draft, tools: &Tools<'_>) -> Result<Draft, RunError> {
    draft.next(|slot, reached| match reached {
        Reached::Proposed { patch, verdict } => {
            let judge = || admission(study, snapshot, slot, &patch, tools);
            let verdict = verdict.map_or_else(judge, |verdict| Ok(*verdict))?;
            Ok(judged(patch, verdict))
        }
        ended => Ok(ended),
    })
}

/// How far a patch came that was judged so.
pub fn judged(patch: Box<ProgramPatch>, Verdict { admission, trials, in_effect }: Verdict) -> Reached {
    match admission.candidate {
        None => Reached::Invalid { gates: admission.gates },
        Some(candidate) => {
            let admitted = Box::new(Admitted { candidate, patch, probes: trials.probes, in_effect });
            Reached::Admitted { gates: admission.gates, admitted }
        }
    }
}

/// Result of trying a child on the probe scenes.
#[derive(Default)]
struct Tried {
    trials: Trials,
    in_effect: Vec<InScene>,
    /// Why the edit did nothing, where it did nothing and questions are detailed.
    why: Vec<String>,
}

/// Judges a patch for the parent of a slot. The agents are told the verdict before their critics speak; a draft carries it on, so
/// that nothing is judged twice.
pub fn admission(
    study: &Study,
    snapshot: &Snapshot<'_>,
    slot: u32,
    patch: &ProgramPatch,
    tools: &Tools<'_>,
) -> Result<Verdict, RunError> {
    let contract = &study.source(snapshot.spec)?.contract;
    let child = SolutionId::new(AttemptId::at(&snapshot.spec.id, snapshot.event.epoch, slot).0);
    let labelling = Labelling { study, spec: snapshot.spec, counsels: &snapshot.counsels, tools };
    // The gates know no error of the store: it waits here until they are done.
    let outcome: Mutex<Result<Tried, RunError>> = Mutex::new(Ok(Tried::default()));
    let parent = snapshot.parent_of(slot);
    let tried = |program: &Program, hash: Digest| {
        let own = in_effect(study, snapshot.spec, program, &snapshot.window)?;
        let probes = probes(
            &snapshot.window,
            study.budget.probe_scenes,
            program,
            own.as_ref().ok(),
            &parent.program,
            &parent.in_effect,
        );
        let trials = labelling.trials(&probes, HashedProgram { program, hash }, parent.hashed())?;
        let nothing = trials.problems.is_empty() && trials.compared > 0 && trials.differing == 0;
        let why = if nothing && !study.questions.is_plain() {
            nothing::why(&labelling, &parent.program, program, patch, &probes)?
        } else {
            Vec::new()
        };
        Ok(Tried { trials, in_effect: own.unwrap_or_default(), why })
    };
    let compiles = |program: &Program, hash: Digest| {
        let trial = tried(program, hash);
        let trials = trial.as_ref().map(|tried| tried.trials.clone()).unwrap_or_default();
        *outcome.lock().unwrap_or_else(PoisonError::into_inner) = trial;
        trials
    };
    let mut admission = candidates::admit(&parent.program, patch, child, &study.judging(contract), &compiles);
    let Tried { trials, in_effect, why } = outcome.into_inner().unwrap_or_else(PoisonError::into_inner)?;
    let refused = |verdict: &&mut GateVerdict| verdict.gate == Gate::Effect && !verdict.problems.is_empty();
    if let Some(verdict) = admission.gates.verdicts.iter_mut().find(refused) {
        verdict.problems.extend(why);
    }
    Ok(Verdict { admission, trials, in_effect })
}
