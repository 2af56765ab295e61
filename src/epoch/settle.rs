//! The one place that changes the state: archive, lineage, memory and world, once an epoch, behind the barrier.

use super::{
    RunError,
    consider::Judged,
    freeze::Snapshot,
    state::{Change, State},
    study::Study,
};
use crate::kernel::Digest;
use crate::lineage::Leader;
use crate::memory::{CurationContext, curate, reflect};
use crate::objects::{
    Card,
    event::{FrontPoint, Settled},
};
use crate::world;

/// Makes what was judged the state.
pub fn settle(study: &Study, state: &mut State, snapshot: &Snapshot<'_>, judged: Judged) -> Result<Settled, RunError> {
    let (lineage, epoch) = (&snapshot.spec.id, snapshot.event.epoch);
    for attempt in &judged.attempts {
        state.lineages.attach(attempt)?;
    }
    if let Some(leaders) = &judged.leaders {
        state.lineages.promote(lineage, Leader::Active, &leaders.active, epoch)?;
        if let Some(anchor) = &leaders.realism_anchor {
            state.lineages.promote(lineage, Leader::RealismAnchor, anchor, epoch)?;
        }
    }
    let cards = cards(study, snapshot, &judged)?;
    state.memory.append(cards.clone())?;
    let labels_before = state.calibration.labels().len();
    state.calibration.append(judged.labels, &state.world.schema)?;
    state.world = world::settle(&state.world.schema, &state.world.configuration, &state.calibration)?;
    state.archives.insert(lineage.clone(), judged.archive);
    let world = state.world.digest()?;
    let line = state.lineages.get(lineage)?;
    let change = Change {
        before: state.digest,
        lineage,
        epoch,
        attempts: &line.attempts[line.attempts.len() - judged.attempts.len()..],
        programs: judged.attempts.iter().filter_map(|a| a.exit.candidate()).map(|c| c.program_hash).collect(),
        active: &line.active,
        realism_anchor: line.realism_anchor.as_ref(),
        archive: &state.archives[lineage],
        cards: &cards,
        labels: &state.calibration.labels()[labels_before..],
        world,
    };
    state.digest = Digest::of("evodrive/state/3", &change)?;
    let promoted = judged.attempts.iter().find(|a| a.exit.decision().is_some_and(|d| d.promoted)).map(|a| a.id.clone());
    state.attempts.extend(judged.attempts);
    let archive = &state.archives[lineage];
    let settled = Settled {
        epoch,
        lineage: lineage.clone(),
        active: state.lineages.active(lineage)?.solution_id.clone(),
        realism_anchor: state.lineages.get(lineage)?.realism_anchor.clone(),
        promoted,
        front: archive.front().map(|e| FrontPoint { solution: e.solution.clone(), objectives: e.objectives }).collect(),
        hypervolume: archive.hypervolume(study.archive.reference),
        cards,
        world,
        world_labels: state.calibration.labels().len(),
        state: state.digest,
    };
    state.settled.push(settled.clone());
    Ok(settled)
}

/// What memory keeps of the epoch: cards of each attempt, then of the lineage and its way.
fn cards(study: &Study, snapshot: &Snapshot<'_>, judged: &Judged) -> Result<Vec<Card>, RunError> {
    let contract = &study.source(snapshot.spec)?.contract;
    let context = CurationContext {
        family: &contract.family,
        scene_tags: &snapshot.scene_tags,
        private_vocabulary: &contract.private_vocabulary,
        options: &study.curation,
    };
    let mut cards: Vec<Card> = judged.attempts.iter().flat_map(|attempt| curate(attempt, &context)).collect();
    let leads = judged.leaders.as_ref().map_or(&snapshot.parents[0].program.solution_id, |leaders| &leaders.active);
    let labels = judged.standing.get(leads).map(|standing| standing.so_far.objectives);
    let active = labels.unwrap_or(snapshot.event.parent_score.objectives);
    cards.extend(reflect(&snapshot.spec.id, snapshot.event.epoch, &judged.attempts, active, &context));
    Ok(cards)
}
