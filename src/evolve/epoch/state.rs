//! State of a run that evolution changes.

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

use super::RunError;
use crate::agents::Change;
use crate::archive::Archive;
use crate::archive::search::SearchState;
use crate::epoch::briefs::counsels::Counsels;
use crate::epoch::setting::study::Study;
use crate::kernel::Digest;
use crate::lineage::{AttemptRecord, LineageStore};
use crate::memory::Memory;
use crate::objects::{
    Attempt, AttemptId, Card, LineageId, SolutionId, WorldEvolved, WorldLabel, WorldSnapshot, event::Settled,
};
use crate::world::CalibrationSet;

/// Archive, lineages, memory and world. An epoch changes it in `settle` alone; counsel is added before any program of its
/// lineage meets the scenes.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct State {
    pub archives: BTreeMap<LineageId, Archive>,
    pub lineages: LineageStore,
    pub memory: Memory,
    pub calibration: CalibrationSet,
    pub world: WorldSnapshot,
    /// The world agent's turns so far, the lineage of the evaluator's snapshots. Each is an event of the transcript.
    pub evolved: Vec<WorldEvolved>,
    /// Counsel of the attacker agent so far. Its events are in the transcript, and its digests in rollouts' keys.
    pub counsels: Counsels,
    /// Every attempt so far, as sealed in the transcript.
    pub attempts: Vec<Attempt>,
    /// Change that each simulated attempt made against its parent, for prompts and cards. It follows from labels on record.
    pub changes: BTreeMap<AttemptId, Change>,
    /// Memory of a search method other than the archive's own; empty under the archive's own.
    pub search: BTreeMap<LineageId, SearchState>,
    /// Requests of rollouts on evolution scenes so far, where a budget bounds them. They follow from labels on record.
    pub spent: BTreeMap<LineageId, BTreeSet<Digest>>,
    /// One entry per epoch and lineage.
    pub settled: Vec<Settled>,
    /// Digest of everything above: after an epoch, the digest before it with all that the epoch changed (`Settling`).
    pub digest: Digest,
}

/// Changes that one epoch of one lineage makes to the state.
#[derive(Serialize)]
pub struct Settling<'a> {
    /// Digest of the state before.
    pub before: Digest,
    pub lineage: &'a LineageId,
    pub epoch: u32,
    /// Records that the lineage keeps of the epoch's attempts, and the admitted programs' hashes.
    pub attempts: &'a [AttemptRecord],
    pub programs: Vec<Digest>,
    pub active: &'a SolutionId,
    pub realism_anchor: Option<&'a SolutionId>,
    /// The lineage's archive as it now is.
    pub archive: &'a Archive,
    pub cards: &'a [Card],
    pub labels: &'a [WorldLabel],
    /// Digest of the world's new snapshot.
    pub world: Digest,
    /// Memory of the lineage that a search method other than the archive's own now has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub search: Option<&'a SearchState>,
}

impl State {
    /// Returns the part that the epochs of one lineage can read: its own state, the cards of other lineages that it may be shown,
    /// and the labels that the evaluator will be fitted to where that decides who is simulated.
    pub fn of_lineage(&self, study: &Study, lineage: &LineageId) -> Result<State, RunError> {
        fn own<V: Clone>(all: &BTreeMap<LineageId, V>, lineage: &LineageId) -> BTreeMap<LineageId, V> {
            all.get(lineage).map(|of| (lineage.clone(), of.clone())).into_iter().collect()
        }
        let mut memory = Memory::default();
        memory.append(
            self.memory.cards().iter().filter(|card| card.lineage == *lineage || card.shareable).cloned().collect(),
        )?;
        let attempts: Vec<Attempt> = self.attempts.iter().filter(|of| of.lineage == *lineage).cloned().collect();
        let change = |attempt: &Attempt| Some((attempt.id.clone(), self.changes.get(&attempt.id)?.clone()));
        Ok(State {
            archives: own(&self.archives, lineage),
            lineages: self.lineages.only(lineage)?,
            memory,
            calibration: if study.simulates_all() { CalibrationSet::default() } else { self.calibration.clone() },
            world: self.world.clone(),
            evolved: self.evolved.clone(),
            counsels: self.counsels.of(lineage),
            changes: attempts.iter().filter_map(change).collect(),
            attempts,
            search: own(&self.search, lineage),
            spent: own(&self.spent, lineage),
            settled: self.settled.iter().filter(|of| of.lineage == *lineage).cloned().collect(),
            digest: self.digest,
        })
    }

    /// The labels as the evaluator is fitted to them. Where it decides who is simulated, the order of lineages in the file has no part in
    /// it. Where it only watches they stay as they came: nothing but the last bits of its recorded predictions rests on that.
    pub fn labels(&self, study: &Study) -> Vec<&WorldLabel> {
        if study.evaluator_decides() {
            self.calibration.by_lineage()
        } else {
            self.calibration.labels().iter().collect()
        }
    }

    /// The digest of a state that no epoch has changed yet: over everything that later epochs can depend on.
    pub fn first_digest(&self) -> Result<Digest, RunError> {
        let State { archives, lineages, memory, calibration, world, search, .. } = self;
        if !search.is_empty() {
            let all = (archives, lineages, memory, calibration, world, search);
            return Ok(Digest::of("evodrive/state/3", &all)?);
        }
        Ok(Digest::of("evodrive/state/3", &(archives, lineages, memory, calibration, world))?)
    }
}
