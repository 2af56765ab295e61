//! Labels of a program on scenes of the study, from the store where they are recorded, from the simulator where not.

use std::sync::OnceLock;

use super::{
    RunError,
    rollouts::{Rollouts, TrialRecord},
    state::Snapshot,
    study::{LineageSpec, SceneEntry, Study},
};
use crate::compiler::{Compiled, Decision, Prepared};
use crate::evaluation::{RolloutRecord, SceneRef, Subject, evaluate, request_key};
use crate::kernel::{Digest, canon::CanonError};
use crate::objects::{Counsel, Program, Score};
use crate::sim::{Intervention, Outcome, Trace, rollout, rollout_traced};

/// Labels a program, given with its hash, on the scenes at these places.
pub fn score(
    study: &Study<'_>,
    spec: &LineageSpec,
    (program, hash): (&Program, Digest),
    places: &[usize],
    rollouts: &Rollouts<'_>,
) -> Result<Score, RunError> {
    let contract = &study.family(spec)?.contract;
    // Nothing is prepared where every rollout is on record.
    let prepared = OnceLock::new();
    let ready = || match prepared.get_or_init(|| Prepared::new(program, contract)) {
        Ok(prepared) => Ok(prepared),
        Err(failure) => Err(failure.to_string()),
    };
    let subject = Subject { program: hash, ego: &spec.ego, seed: study.seed };
    let counsels = places.iter().map(|&place| study.counsel(spec, place)).collect::<Result<Vec<_>, _>>()?;
    let scene = |(&place, counsel): (&usize, &Option<Counsel>)| -> Result<SceneRef<'_>, CanonError> {
        let entry = &study.scenes[place];
        let counsel = counsel.as_ref().map(Counsel::digest).transpose()?;
        Ok(SceneRef { id: &entry.scene.id, digest: entry.digest, group: entry.group(), counsel })
    };
    let scenes: Vec<SceneRef<'_>> = places.iter().zip(&counsels).map(scene).collect::<Result<_, _>>()?;
    let label = |i: usize| labelled_rollout(study, spec, ready()?, places[i], counsels[i].as_ref());
    Ok(evaluate(&subject, &scenes, &label, &study.evaluation, rollouts, study.pool)?)
}

/// What keeps a program from compiling on the snapshot's probe scenes; empty = it can be lowered on all of them. What
/// was tried before is not tried again, and a recorded rollout is proof that the program compiled there.
pub fn trials(
    study: &Study<'_>,
    snapshot: &Snapshot<'_>,
    program: &Program,
    hash: Digest,
    rollouts: &Rollouts<'_>,
) -> Result<Vec<String>, RunError> {
    let spec = snapshot.spec;
    let contract = &study.family(spec)?.contract;
    let mut prepared = None;
    let mut problems = Vec::new();
    for probe in &snapshot.probes {
        let entry = &study.scenes[probe.place];
        let counsel = study.counsel(spec, probe.place)?;
        let advised = counsel.as_ref().map(Counsel::digest).transpose()?;
        // The compilation and the rollout of one request have one key, each among its own kind of memo.
        let key = request_key(hash, entry.digest, spec.ego.digest(), study.seed, advised)?;
        if rollouts.has(&key) {
            continue;
        }
        let failure = match rollouts.tried(&key)? {
            Some(trial) => trial.failure.clone(),
            None => {
                if prepared.is_none() {
                    match Prepared::new(program, contract) {
                        Ok(ready) => prepared = Some(ready),
                        Err(failure) => return Ok(vec![failure.to_string()]),
                    }
                }
                let compile =
                    |ready: &Prepared<'_>| ready.compile_counselled(&probe.situation, study.seed, counsel.as_ref());
                let compiled = prepared.as_ref().map(|ready| study.meter.compile(&spec.id, || compile(ready)));
                let failure = compiled.and_then(Result::err).map(|failure| failure.to_string());
                rollouts.keep_trial(
                    &key,
                    TrialRecord {
                        program: hash,
                        scene: entry.scene.id.clone(),
                        scene_digest: entry.digest,
                        ego: spec.ego.name().to_string(),
                        failure: failure.clone(),
                    },
                )?;
                failure
            }
        };
        problems.extend(failure);
    }
    Ok(problems)
}

/// Compiles for one scene, with the counsel where the family takes it, and rolls out. A text is the reason why there is
/// no label.
pub fn labelled_rollout(
    study: &Study<'_>,
    spec: &LineageSpec,
    prepared: &Prepared<'_>,
    place: usize,
    counsel: Option<&Counsel>,
) -> Result<RolloutRecord, String> {
    let entry = &study.scenes[place];
    let situation = entry.situation(&spec.ego)?;
    let compile = || prepared.compile_counselled(&situation, study.seed, counsel);
    let compiled = study.meter.compile(&spec.id, compile).map_err(|failure| failure.to_string())?;
    let run = || rollout(&situation.plant, &compiled.intervention, spec.ego.driver().as_mut());
    let outcome: Outcome = study.meter.rollout(&spec.id, run).map_err(|error| error.to_string())?;
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
    let counsel = study.counsel(spec, place).map_err(|error| error.to_string())?;
    let Compiled { decision, intervention } =
        prepared.compile_counselled(&situation, study.seed, counsel.as_ref()).map_err(|failure| failure.to_string())?;
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
