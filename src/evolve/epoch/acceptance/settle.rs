//! The one place that changes the state: archive, lineage, memory and world, once an epoch, behind the barrier.

use std::collections::{BTreeMap, BTreeSet};

use super::challengers::joined;
use super::consider::EpochVerdicts;
use super::rival;
use crate::agents::Change;
use crate::epoch::RunError;
use crate::epoch::briefs::encounters::near_misses;
use crate::epoch::briefs::history::change;
use crate::epoch::freeze::{Parent, Snapshot};
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::Study;
use crate::epoch::state::{Settling, State};
use crate::kernel::Digest;
use crate::lineage::Leader;
use crate::memory::{CurationContext, curate, reflect};
use crate::objects::{
    Attempt, AttemptId, Card, ChallengeVerdict,
    event::{FrontPoint, Settled},
};
use crate::world;

/// When the world evaluator is fitted to the labels so far: behind an epoch's last lineage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refit {
    Now,
    Later,
}

/// Near misses of an attempt's parent and of its child on its window, where questions speak of them.
fn near(attempt: &Attempt, parent: &Parent, tools: &Tools<'_>) -> Result<Option<[usize; 2]>, RunError> {
    let (Some(before), Some(score)) = (parent.outcome.near_misses, attempt.exit.score()) else { return Ok(None) };
    Ok(Some([before, near_misses(score, tools.rollouts)?.len()]))
}

/// Makes what was judged the state.
pub fn settle(
    study: &Study,
    state: &mut State,
    snapshot: &Snapshot<'_>,
    judged: EpochVerdicts,
    refit: Refit,
    tools: &Tools<'_>,
) -> Result<Settled, RunError> {
    let threads = tools.threads;
    let (lineage, epoch) = (&snapshot.spec.id, snapshot.event.epoch);
    let spent = rival::spent_after(snapshot, &judged.attempts, &judged.tuning);
    for attempt in &judged.attempts {
        state.lineages.attach(attempt)?;
    }
    for challenge in judged.challenges.iter().filter(|of| of.verdict == ChallengeVerdict::Accepted) {
        state.lineages.accept(lineage, &challenge.solution)?;
    }
    if let Some(leaders) = &judged.leaders {
        state.lineages.promote(lineage, Leader::Active, &leaders.active, epoch)?;
        if let Some(anchor) = &leaders.realism_anchor {
            state.lineages.promote(lineage, Leader::RealismAnchor, anchor, epoch)?;
        }
    }
    let mut changes: BTreeMap<AttemptId, Change> = BTreeMap::new();
    for attempt in &judged.attempts {
        let parent = snapshot.parent_of(attempt.slot);
        let near = near(attempt, parent, tools)?;
        let change = change(study, &snapshot.conflicts, attempt, &parent.score, near);
        changes.extend(change.map(|change| (attempt.id.clone(), change)));
    }
    let cards = cards(study, snapshot, &judged, &changes)?;
    state.memory.append(cards.clone())?;
    let labels_before = state.calibration.labels().len();
    state.calibration.append(judged.labels, &state.world.schema)?;
    if refit == Refit::Now {
        let (schema, configuration) = (&state.world.schema, &state.world.configuration);
        state.world = world::settle(schema, configuration, &state.labels(study), epoch + 1, threads)?;
    }
    let mut archive = judged.archive;
    joined(&mut archive, &judged.attempts, &study.archive);
    state.archives.insert(lineage.clone(), archive);
    if study.search.is_some() {
        state.spent.insert(lineage.clone(), spent);
    }
    state.search.extend(judged.search.map(|search| (lineage.clone(), search)));
    let world = state.world.digest()?;
    let line = state.lineages.get(lineage)?;
    let settling = Settling {
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
        search: state.search.get(lineage),
    };
    state.digest = Digest::of("evodrive/state/3", &settling)?;
    let late = judged.leaders.as_ref().filter(|led| judged.challenges.iter().any(|of| of.solution == led.active));
    let late = late.and_then(|led| state.archives[lineage].entry(&led.active)?.attempt.clone());
    let promoted = judged.attempts.iter().find(|a| a.exit.decision().is_some_and(|d| d.promoted)).map(|a| a.id.clone());
    state.attempts.extend(judged.attempts);
    state.changes.extend(changes);
    let archive = &state.archives[lineage];
    let settled = Settled {
        epoch,
        lineage: lineage.clone(),
        active: state.lineages.active(lineage)?.solution_id.clone(),
        realism_anchor: state.lineages.get(lineage)?.realism_anchor.clone(),
        promoted: promoted.or(late),
        front: archive.front().map(|e| FrontPoint { solution: e.solution.clone(), objectives: e.objectives }).collect(),
        hypervolume: archive.hypervolume(study.archive.reference),
        cards,
        world,
        world_labels: state.calibration.labels().len(),
        challenges: judged.challenges,
        state: state.digest,
    };
    state.settled.push(settled.clone());
    Ok(settled)
}

/// Returns the cards that memory keeps of the epoch: those of each attempt, then those of the lineage and its course.
fn cards(
    study: &Study,
    snapshot: &Snapshot<'_>,
    judged: &EpochVerdicts,
    changes: &BTreeMap<AttemptId, Change>,
) -> Result<Vec<Card>, RunError> {
    if !study.has_memory() {
        return Ok(Vec::new());
    }
    let contract = &study.source(snapshot.spec)?.contract;
    let plain = CurationContext {
        family: &contract.family,
        scene_tags: &[],
        private_vocabulary: &contract.private_vocabulary,
        options: &study.curation,
    };
    let mut cards: Vec<Card> = Vec::new();
    for attempt in &judged.attempts {
        let change = changes.get(&attempt.id);
        let tags = change.map(|change| tags_of_changed(study, snapshot, change)).unwrap_or_default();
        cards.extend(curate(attempt, &CurationContext { scene_tags: &tags, ..plain }));
    }
    let leads = judged.leaders.as_ref().map_or(&snapshot.parents[0].program.solution_id, |leaders| &leaders.active);
    let labels = judged.standing.get(leads).map(|standing| standing.so_far.objectives);
    let active = labels.unwrap_or(snapshot.event.parent_score.objectives);
    cards.extend(reflect(&snapshot.spec.id, snapshot.event.epoch, &judged.attempts, active, &plain));
    Ok(cards)
}

/// Telling tags of the scenes that an attempt won or lost, sorted.
fn tags_of_changed(study: &Study, snapshot: &Snapshot<'_>, change: &Change) -> Vec<String> {
    let changed = change.won.iter().chain(&change.lost).filter_map(|scene| study.scene(scene));
    let tags: BTreeSet<String> =
        changed.flat_map(|entry| entry.features().tags.iter().map(|tag| tag.to_string())).collect();
    tags.into_iter().filter(|tag| snapshot.scene_tags.contains(tag)).collect()
}
