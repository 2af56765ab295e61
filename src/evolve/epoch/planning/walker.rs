//! Goes a lineage's way on whatever machine it came to, to its end where nothing is in the way: the epoch that the run has come to, then
//! those whose answers are there. It is the loop of `epoch::run` for one lineage; what was compiled and simulated on the way is what
//! the run needs there, and is kept by keys. A step that the run takes otherwise (another lineage's card, another route) costs time.

use std::collections::BTreeSet;

use super::carried::CarriedAnswers;
use super::walk::LineageJob;
use crate::agents::AgentError;
use crate::epoch::acceptance::settle::{Refit, settle};
use crate::epoch::acceptance::{finale, search};
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::open;
use crate::epoch::run::judge;
use crate::epoch::setting::desk::Desk;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::epoch::state::State;
use crate::epoch::{RunError, setting::desk::Tools};
use crate::kernel::Digest;
use crate::llm::AskError;
use crate::objects::{Program, SolutionId};
use crate::store::MemoKind;

/// Goes on from where a lineage stands. Labels and trials are in the store of the desk's tools afterwards.
///
/// # Errors
/// A lineage that the study does not have; what keeps this machine from compiling or simulating. A missing answer is the end of the
/// way and no error.
pub fn go(study: &Study, walk: &LineageJob, carried: &CarriedAnswers<'_>, desk: &mut Desk<'_>) -> Result<(), RunError> {
    match gone(study, walk, carried, desk) {
        Err(RunError::Agent(AgentError::Ask(AskError::Miss(_)))) => Ok(()),
        ended => ended,
    }
}

fn gone(study: &Study, walk: &LineageJob, carried: &CarriedAnswers<'_>, desk: &mut Desk<'_>) -> Result<(), RunError> {
    let spec = study.lineages.iter().find(|spec| spec.id == walk.lineage);
    let spec = spec.ok_or_else(|| RunError::Study(format!("the study has no lineage {}", walk.lineage)))?;
    let mut state = match &walk.state {
        Some(state) => State::clone(state),
        None => {
            let mut state = open::nothing_yet(study, desk)?;
            open::adopt(study, spec, &mut state, desk)?;
            state
        }
    };
    for epoch in walk.epoch..study.budget.epochs {
        if search::is_over(study, &state, spec) {
            break;
        }
        if epoch > walk.epoch {
            match (carried.asks(), study.lineages_stand_alone()) {
                // A model is asked nothing that the run may ask otherwise.
                (true, false) => return Ok(()),
                (true, true) => {}
                (false, _) if !carried.knows(epoch) => return Ok(()),
                (false, _) => carried.guess(),
            }
        }
        let (snapshot, judged) = judge(study, &state, epoch, spec, &desk.tools)?;
        settle(study, &mut state, &snapshot, judged, Refit::Now, &desk.tools)?;
    }
    finale::one_lineage(study, &mut state, spec, desk).map(drop)
}

/// Keys of labels and trials that a lineage's next epoch reads: those of the programs that lead or are on its front.
pub fn known(study: &Study, walk: &LineageJob, tools: &Tools<'_>) -> Result<Vec<(MemoKind, Digest)>, RunError> {
    let (Some(state), Some(spec)) = (&walk.state, study.lineages.iter().find(|spec| spec.id == walk.lineage)) else {
        return Ok(Vec::new());
    };
    let counsels = state.counsels.of(&spec.id);
    let labelling = Labelling { study, spec, counsels: &counsels, tools };
    let mut keys = Vec::new();
    for program in live(state, spec)? {
        let hash = program.hash()?;
        for &place in &study.evolution {
            let Ok(counsel) = counsels.at(study, spec, place) else { continue };
            for labelling in labelling.by_ego() {
                keys.push((MemoKind::Rollout, labelling.label_key(hash, place, counsel)?));
                keys.push((MemoKind::Compile, labelling.trial_key(place, hash)?));
            }
        }
    }
    keys.retain(|(kind, key)| tools.rollouts.has(*kind, key));
    Ok(keys)
}

fn live<'s>(state: &'s State, spec: &LineageSpec) -> Result<Vec<&'s Program>, RunError> {
    let lineage = state.lineages.get(&spec.id)?;
    let front = state.archives.get(&spec.id).into_iter().flat_map(|archive| archive.front());
    let heads = [&lineage.parent, &lineage.active].into_iter().chain(lineage.realism_anchor.as_ref());
    let all: BTreeSet<&SolutionId> = heads.chain(front.map(|entry| &entry.solution)).collect();
    Ok(all.into_iter().map(|solution| state.lineages.program(&spec.id, solution)).collect::<Result<Vec<_>, _>>()?)
}
