//! The beginning of a run: its inputs by digest, and the parents with which its lineages start.

use std::collections::BTreeMap;

use super::RunError;
use super::freeze::freeze;
use super::state::State;
use crate::adapters::ADAPTER_VERSION;
use crate::archive::Archive;
use crate::epoch::acceptance::consider::parent_entry;
use crate::epoch::acceptance::{groups, rival};
use crate::epoch::briefs::counsels::Counsels;
use crate::epoch::briefs::{composition, counsel};
use crate::epoch::planning::walk::LineageJob;
use crate::epoch::setting::desk::Desk;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::evaluation::{EVAL_VERSION, EvaluationOptions};
use crate::kernel::Digest;
use crate::lineage::LineageStore;
use crate::memory::Memory;
use crate::objects::{
    FamilyName,
    event::{Opened, ParentAdopted, Searched, Versions, kind},
};
use crate::sim::SIM_VERSION;
use crate::world::{self, CalibrationSet};

/// Returns the first event: everything that the run is a function of.
pub fn opened(study: &Study) -> Result<Opened, RunError> {
    let mut contracts = BTreeMap::new();
    for spec in &study.lineages {
        let contract = &study.source(spec)?.contract;
        contracts.insert(contract.family.clone(), contract.digest()?);
    }
    let id = |&place: &usize| study.scenes[place].scene().id.clone();
    Ok(Opened {
        name: study.name.clone(),
        experiment: study.experiment,
        pool: study.pool_digest,
        provenance: study.provenance,
        evolution_scenes: study.evolution.iter().map(id).collect(),
        selection_scenes: study.selection.iter().map(id).collect(),
        held_out_scenes: study.held_out.iter().map(id).collect(),
        versions: Versions { adapter: ADAPTER_VERSION, sim: SIM_VERSION, eval: EVAL_VERSION },
        contracts,
        models: study.models.iter().map(|(role, model)| (role.name().to_string(), model.label())).collect(),
        search: study.search.as_ref().map(|of| Searched { method: of.method.name().into(), rollouts: of.rollouts }),
        without: study.without.names().into_iter().map(String::from).collect(),
        attack: match &study.evaluation {
            EvaluationOptions::Metadrive(options) => options.attack.when.as_ref().map(|when| when.text().to_string()),
            EvaluationOptions::Safebench { .. } => None,
        },
    })
}

/// The state before the first epoch: every lineage with its family's parent, labelled on the first window.
pub fn adopt_parents(study: &Study, desk: &mut Desk<'_>) -> Result<State, RunError> {
    let mut state = nothing_yet(study, desk)?;
    let mut wanting = false;
    for spec in &study.lineages {
        match adopt(study, spec, &mut state, desk) {
            // A plan hears of all lineages: none of them depends on another one yet.
            Err(error) if desk.tools.is_wanting(&error) => {
                wanting = true;
                if let Some(wanted) = desk.tools.wanted.filter(|wanted| wanted.is_by_lineage()) {
                    wanted.ask_whole(LineageJob { lineage: spec.id.clone(), epoch: 0, state: None });
                }
            }
            adopted => adopted?,
        }
        desk.tools.meter.turn(&spec.id);
    }
    if wanting {
        return Err(RunError::Wanting);
    }
    state.digest = state.first_digest()?;
    Ok(state)
}

/// The state in which no lineage has begun.
pub fn nothing_yet(study: &Study, desk: &Desk<'_>) -> Result<State, RunError> {
    let families: Vec<FamilyName> = study.lineages.iter().map(|spec| spec.family.clone()).collect();
    let calibration = CalibrationSet::default();
    let egos: Vec<String> = study.lineages.iter().map(|spec| spec.ego.name().to_string()).collect();
    let schema = world::schema_of(&study.world, &families, &egos);
    let snapshot = world::settle(&schema, &study.world, &[], 0, desk.tools.threads)?;
    Ok(State {
        archives: BTreeMap::new(),
        lineages: LineageStore::default(),
        memory: Memory::default(),
        calibration,
        world: snapshot,
        evolved: Vec::new(),
        counsels: Counsels::default(),
        attempts: Vec::new(),
        changes: BTreeMap::new(),
        search: BTreeMap::new(),
        spent: BTreeMap::new(),
        settled: Vec::new(),
        digest: Digest::of_bytes(&[]),
    })
}

/// A lineage begins with its parent, counselled and labelled.
pub fn adopt(study: &Study, spec: &LineageSpec, state: &mut State, desk: &mut Desk<'_>) -> Result<(), RunError> {
    let parent = composition::parent(study, spec, desk)?;
    let program_hash = parent.hash()?;
    state.lineages.adopt(spec.id.clone(), parent.clone())?;
    let ego = spec.ego_label();
    let origins = spec.start.as_ref().map_or(Vec::new(), |start| start.origins.clone());
    let adopted = ParentAdopted { lineage: spec.id.clone(), ego, program: parent, program_hash, origins };
    desk.log.append(kind::PARENT, &adopted)?;
    counsel::take(study, spec, &study.evolution, &mut state.counsels, desk)?;
    let first = freeze(study, state, 0, spec, &desk.tools)?;
    let archive = state.archives.entry(spec.id.clone()).or_insert_with(|| Archive::with(study.archive.ties));
    archive.insert(parent_entry(study, &first)?)?;
    groups::begin(study, archive, &first.parents[0].program.solution_id);
    state.search.extend(rival::begin(study, &first).map(|begun| (spec.id.clone(), begun)));
    Ok(())
}
