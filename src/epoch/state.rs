//! What evolution changes, and the immutable snapshot of it that an epoch's slots see.

use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;

use super::{
    RunError, briefing, labels,
    rollouts::Rollouts,
    study::{LineageSpec, Study},
};
use crate::agents::{Briefing, Context};
use crate::archive::Archive;
use crate::compiler::Situation;
use crate::kernel::Digest;
use crate::lineage::{AttemptRecord, LineageStore};
use crate::memory::{Memory, Query, retrieve};
use crate::objects::{
    Attempt, Card, LineageId, Program, SolutionId, WorldLabel, WorldSnapshot,
    event::{Frozen, Settled},
};
use crate::world::CalibrationSet;

/// Archive, lineages, memory and world. Only `acceptor::settle` changes it.
#[derive(Clone, Debug)]
pub struct State {
    pub archives: BTreeMap<LineageId, Archive>,
    pub lineages: LineageStore,
    pub memory: Memory,
    pub calibration: CalibrationSet,
    pub world: WorldSnapshot,
    /// Every attempt so far, as sealed in the transcript.
    pub attempts: Vec<Attempt>,
    /// One an epoch and lineage.
    pub settled: Vec<Settled>,
    /// Of everything above: after an epoch, the digest before it with all that the epoch changed (`Change`).
    pub digest: Digest,
}

/// What one epoch of one lineage does to the state.
#[derive(Serialize)]
pub struct Change<'a> {
    /// Digest of the state before.
    pub before: Digest,
    pub lineage: &'a LineageId,
    pub epoch: u32,
    /// What the lineage keeps of the epoch's attempts, and the admitted programs' hashes.
    pub attempts: &'a [AttemptRecord],
    pub programs: Vec<Digest>,
    pub active: &'a SolutionId,
    /// The lineage's archive as it now is.
    pub archive: &'a Archive,
    pub cards: &'a [Card],
    pub labels: &'a [WorldLabel],
    /// Digest of the world's new snapshot.
    pub world: Digest,
}

impl State {
    /// The digest of a state that no epoch has changed yet: over everything that later epochs can depend on.
    pub fn first_digest(&self) -> Result<Digest, RunError> {
        let State { archives, lineages, memory, calibration, world, .. } = self;
        Ok(Digest::of("evodrive/state/2", &(archives, lineages, memory, calibration, world))?)
    }
}

/// z_t: what the workers of one epoch get. Nothing in it can change.
pub struct Snapshot<'a> {
    pub spec: &'a LineageSpec,
    pub event: Frozen,
    pub parent: Program,
    /// Written out once for all slots and roles.
    pub briefing: Briefing,
    pub world: WorldSnapshot,
    /// Places of the window's scenes in the pool.
    pub window: Vec<usize>,
    /// Scenes on which the compile gate tries programs.
    pub probes: Vec<Probe>,
    /// Tags of the window's scenes, sorted.
    pub scene_tags: Vec<String>,
}

/// A scene of the compile gate.
pub struct Probe {
    /// In the study's scenes.
    pub place: usize,
    pub situation: Arc<Situation>,
}

impl<'a> Snapshot<'a> {
    /// Freezes the state for one epoch of one lineage. Labels the parent on the epoch's window, so that children are
    /// compared with it scene by scene.
    pub fn freeze(
        study: &Study<'_>,
        state: &State,
        epoch: u32,
        spec: &'a LineageSpec,
        rollouts: &Rollouts<'_>,
    ) -> Result<Snapshot<'a>, RunError> {
        let parent = state.lineages.active(&spec.id)?.clone();
        let parent_hash = parent.hash()?;
        let window = study.window(epoch);
        let parent_score = labels::score(study, spec, (&parent, parent_hash), &window, rollouts)?;
        let scene_tags = study.tags(&window);
        let query = Query { parent: &parent, epoch, scene_tags: &scene_tags };
        let memory: Vec<Card> =
            retrieve(&state.memory, &query, &study.memory).into_iter().map(|(card, _)| card.clone()).collect();
        let family = study.family(spec)?;
        let foreign = study.foreign_vocabulary(spec);
        let attempts: Vec<&Attempt> = state.attempts.iter().filter(|a| a.lineage == spec.id).collect();
        let outcomes = briefing::outcomes(&parent_score, &attempts);
        let clusters = briefing::clusters(study, &parent_score);
        let front = state.archives.get(&spec.id).map(briefing::front).unwrap_or_default();
        let context = Context {
            lineage: &spec.id,
            epoch,
            parent: &parent,
            parent_hash,
            contract: &family.contract,
            contract_text: study.contract_text(spec)?,
            foreign_vocabulary: &foreign,
            ego: briefing::ego_sentence(&spec.ego),
            memory: &memory,
            clusters: &clusters,
            outcomes: &outcomes,
            front: &front,
        };
        let briefing = Briefing::of(&context).map_err(crate::agents::AgentError::from)?;
        let probes = study.probes(epoch, spec)?;
        let event = Frozen {
            epoch,
            lineage: spec.id.clone(),
            parent: parent.solution_id.clone(),
            parent_hash,
            window: window.iter().map(|&place| study.scenes[place].scene.id.clone()).collect(),
            parent_score,
            world: state.world.digest()?,
            memory_shown: memory.iter().map(|card| card.id.0.clone()).collect(),
            slots: study.budget.slots,
        };
        Ok(Snapshot { spec, event, parent, briefing, world: state.world.clone(), window, probes, scene_tags })
    }
}
