//! What evolution changes.

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

use super::RunError;
use crate::agents::Change;
use crate::archive::Archive;
use crate::archive::search::SearchState;
use crate::epoch::briefs::counsels::Counsels;
use crate::kernel::Digest;
use crate::lineage::{AttemptRecord, LineageStore};
use crate::memory::Memory;
use crate::objects::{
    Attempt, AttemptId, Card, LineageId, SolutionId, WorldEvolved, WorldLabel, WorldSnapshot, event::Settled,
};
use crate::world::CalibrationSet;

/// Archive, lineages, memory and world. An epoch changes it in `settle` alone; counsel is added before any program of its
/// lineage meets the scenes.
#[derive(Clone, Debug)]
pub struct State {
    pub archives: BTreeMap<LineageId, Archive>,
    pub lineages: LineageStore,
    pub memory: Memory,
    pub calibration: CalibrationSet,
    pub world: WorldSnapshot,
    /// The world agent's turns so far, the lineage of the evaluator's snapshots. Each is an event of the transcript.
    pub evolved: Vec<WorldEvolved>,
    /// What the attacker agent said so far. Its events are in the transcript, and its digests in rollouts' keys.
    pub counsels: Counsels,
    /// Every attempt so far, as sealed in the transcript.
    pub attempts: Vec<Attempt>,
    /// What each simulated attempt changed against its parent, for prompts and cards. It follows from labels on record.
    pub changes: BTreeMap<AttemptId, Change>,
    /// What a method other than the archive's own remembers; empty under that one.
    pub search: BTreeMap<LineageId, SearchState>,
    /// Requests of rollouts on evolution scenes so far, where a budget bounds them. They follow from labels on record.
    pub spent: BTreeMap<LineageId, BTreeSet<Digest>>,
    /// One an epoch and lineage.
    pub settled: Vec<Settled>,
    /// Of everything above: after an epoch, the digest before it with all that the epoch changed (`Settling`).
    pub digest: Digest,
}

/// What one epoch of one lineage does to the state.
#[derive(Serialize)]
pub struct Settling<'a> {
    /// Digest of the state before.
    pub before: Digest,
    pub lineage: &'a LineageId,
    pub epoch: u32,
    /// What the lineage keeps of the epoch's attempts, and the admitted programs' hashes.
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
    /// What another method than the archive's own now remembers of the lineage.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub search: Option<&'a SearchState>,
}

impl State {
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
