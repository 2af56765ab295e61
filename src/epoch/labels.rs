//! Labels of a program on scenes of the study, from the store where they are recorded, from the simulator where not.

use super::{
    RunError,
    rollouts::Rollouts,
    study::{LineageSpec, SceneEntry, Study},
};
use crate::compiler::{Compiled, Decision, Prepared};
use crate::evaluation::{RolloutRecord, SceneRef, Subject, evaluate, request_key};
use crate::objects::{Program, Score};
use crate::sim::{Intervention, Outcome, Trace, rollout, rollout_traced};

/// Labels a program on the scenes at these places.
pub fn score(
    study: &Study<'_>,
    spec: &LineageSpec,
    program: &Program,
    places: &[usize],
    rollouts: &Rollouts<'_>,
) -> Result<Score, RunError> {
    let contract = &study.family(spec)?.contract;
    let prepared = Prepared::new(program, contract).map_err(|failure| RunError::Study(failure.to_string()))?;
    let subject = Subject { program: prepared.hash(), ego: &spec.ego, seed: study.seed };
    let scene = |&place: &usize| {
        let entry = &study.scenes[place];
        SceneRef { id: &entry.scene.id, digest: entry.digest }
    };
    let scenes: Vec<SceneRef<'_>> = places.iter().map(scene).collect();
    let label = |i: usize| labelled_rollout(study, spec, &prepared, places[i]);
    Ok(evaluate(&subject, &scenes, &label, &study.evaluation, rollouts, study.pool)?)
}

/// Whether the rollout of a program in a scene is on record.
pub fn is_recorded(
    study: &Study<'_>,
    spec: &LineageSpec,
    program: &Program,
    place: usize,
    rollouts: &Rollouts<'_>,
) -> bool {
    let key =
        program.hash().and_then(|hash| request_key(hash, study.scenes[place].digest, spec.ego.digest(), study.seed));
    key.is_ok_and(|key| rollouts.has(&key))
}

/// Compiles for one scene and rolls out. A text is the reason why there is no label.
pub fn labelled_rollout(
    study: &Study<'_>,
    spec: &LineageSpec,
    prepared: &Prepared<'_>,
    place: usize,
) -> Result<RolloutRecord, String> {
    let entry = &study.scenes[place];
    let situation = entry.situation(&spec.ego)?;
    let compiled = prepared.compile(&situation, study.seed).map_err(|failure| failure.to_string())?;
    let outcome: Outcome = rollout(&situation.plant, &compiled.intervention, spec.ego.driver().as_mut())
        .map_err(|error| error.to_string())?;
    record(entry, spec, prepared, &compiled.decision, outcome)
}

/// A rollout simulated again with the motion behind its label.
#[derive(Clone, Debug)]
pub struct Traced {
    /// Equal to what the store holds of this rollout.
    pub record: RolloutRecord,
    pub decision: Decision,
    pub intervention: Intervention,
    pub motion: Trace,
}

/// Simulates the rollout of a program in a scene again, with its motion: for players and exporters.
pub fn trace(study: &Study<'_>, spec: &LineageSpec, program: &Program, place: usize) -> Result<Traced, String> {
    let contract = &study.family(spec).map_err(|error| error.to_string())?.contract;
    let prepared = Prepared::new(program, contract).map_err(|failure| failure.to_string())?;
    let entry = &study.scenes[place];
    let situation = entry.situation(&spec.ego)?;
    let Compiled { decision, intervention } =
        prepared.compile(&situation, study.seed).map_err(|failure| failure.to_string())?;
    let (outcome, motion) = rollout_traced(&situation.plant, &intervention, spec.ego.driver().as_mut())
        .map_err(|error| error.to_string())?;
    let record = record(entry, spec, &prepared, &decision, outcome)?;
    Ok(Traced { record, decision, intervention, motion })
}

fn record(
    entry: &SceneEntry,
    spec: &LineageSpec,
    prepared: &Prepared<'_>,
    decision: &Decision,
    outcome: Outcome,
) -> Result<RolloutRecord, String> {
    Ok(RolloutRecord {
        scene: entry.scene.id.clone(),
        scene_digest: entry.digest,
        program: prepared.hash(),
        ego: spec.ego.name().to_string(),
        intervened: decision.applies,
        decision: serde_json::to_value(decision).map_err(|error| error.to_string())?,
        outcome,
    })
}
