//! The immutable snapshot of the state that an epoch's slots see.

use super::{
    RunError, briefing,
    counsels::Counsels,
    desk::Tools,
    labels::Labelling,
    state::State,
    study::{LineageSpec, Study},
};
use crate::agents::{AgentError, Briefing, Context};
use crate::memory::{Query, retrieve};
use crate::objects::{Attempt, Card, Program, WorldSnapshot, event::Frozen};

/// z_t: what the workers of one epoch get. Nothing in it can change.
pub struct Snapshot<'a> {
    pub spec: &'a LineageSpec,
    pub event: Frozen,
    pub parent: Program,
    /// Written out once for all slots and roles.
    pub briefing: Briefing,
    pub world: WorldSnapshot,
    /// What the lineage was counselled.
    pub counsels: Counsels,
    /// Places of the window's scenes in the pool.
    pub window: Vec<usize>,
    /// Places of the scenes on which the compile gate tries programs.
    pub probes: Vec<usize>,
    /// Tags of the window's scenes, sorted.
    pub scene_tags: Vec<String>,
}

/// Freezes the state for one epoch of one lineage. Labels the parent on the epoch's window, so that children are compared
/// with it scene by scene.
pub fn freeze<'a>(
    study: &Study,
    state: &State,
    epoch: u32,
    spec: &'a LineageSpec,
    tools: &Tools<'_>,
) -> Result<Snapshot<'a>, RunError> {
    let parent = state.lineages.active(&spec.id)?.clone();
    let parent_hash = parent.hash()?;
    let window = study.window(epoch);
    let counsels = state.counsels.of(&spec.id);
    let labelling = Labelling { study, spec, counsels: &counsels, tools };
    let parent_score = labelling.score((&parent, parent_hash), &window)?;
    let scene_tags = study.tags(&window);
    let query = Query { parent: &parent, epoch, scene_tags: &scene_tags };
    let memory: Vec<Card> =
        retrieve(&state.memory, &query, &study.memory).into_iter().map(|(card, _)| card.clone()).collect();
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
        contract: &study.source(spec)?.contract,
        contract_text: study.contract_text(spec)?,
        foreign_vocabulary: &foreign,
        ego: briefing::ego_sentence(&spec.ego),
        memory: &memory,
        clusters: &clusters,
        outcomes: &outcomes,
        front: &front,
    };
    let briefing = Briefing::of(&context).map_err(AgentError::from)?;
    let event = Frozen {
        epoch,
        lineage: spec.id.clone(),
        parent: parent.solution_id.clone(),
        parent_hash,
        window: window.iter().map(|&place| study.scenes[place].scene().id.clone()).collect(),
        parent_score,
        world: state.world.digest()?,
        memory_shown: memory.iter().map(|card| card.id.0.clone()).collect(),
        slots: study.budget.slots,
    };
    let (world, probes) = (state.world.clone(), study.probes(epoch));
    Ok(Snapshot { spec, event, parent, briefing, world, counsels, window, probes, scene_tags })
}
