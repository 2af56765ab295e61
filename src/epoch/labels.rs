//! Labels of a program on scenes of the study, from the store where they are recorded, from the simulator where not.

use std::sync::OnceLock;

use super::{
    RunError,
    counsels::Counsels,
    desk::Tools,
    rollouts::TrialRecord,
    study::{LineageSpec, SceneEntry, Study},
};
use crate::compiler::{Decision, Prepared};
use crate::evaluation::{RolloutRecord, SceneRef, Subject, evaluate, request_key};
use crate::kernel::{Digest, canon::CanonError};
use crate::objects::{Counsel, Program, Score};
use crate::sim::{Outcome, rollout};

/// What labels of one lineage's programs rest on.
#[derive(Clone, Copy)]
pub struct Labelling<'a> {
    pub study: &'a Study,
    pub spec: &'a LineageSpec,
    pub counsels: &'a Counsels,
    pub tools: &'a Tools<'a>,
}

impl Labelling<'_> {
    /// Labels a program, given with its hash, on the scenes at these places.
    pub fn score(&self, (program, hash): (&Program, Digest), places: &[usize]) -> Result<Score, RunError> {
        let Labelling { study, spec, counsels, tools } = *self;
        let source = study.source(spec)?;
        // Nothing is prepared where every rollout is on record.
        let prepared = OnceLock::new();
        let ready = || match prepared.get_or_init(|| Prepared::new(program, source)) {
            Ok(prepared) => Ok(prepared),
            Err(failure) => Err(failure.to_string()),
        };
        let subject = Subject { program: hash, ego: &spec.ego, seed: study.seed };
        let counsels = places.iter().map(|&place| counsels.at(study, spec, place)).collect::<Result<Vec<_>, _>>()?;
        let scene = |(&place, counsel): (&usize, &Option<&Counsel>)| -> Result<SceneRef<'_>, CanonError> {
            let entry = &study.scenes[place];
            let counsel = counsel.map(Counsel::digest).transpose()?;
            Ok(SceneRef { id: &entry.scene().id, digest: entry.digest, group: entry.group(), counsel })
        };
        let scenes: Vec<SceneRef<'_>> = places.iter().zip(&counsels).map(scene).collect::<Result<_, _>>()?;
        let label = |i: usize| self.rollout(ready()?, places[i], counsels[i]);
        Ok(evaluate(&subject, &scenes, &label, &study.evaluation, tools.rollouts, tools.threads)?)
    }

    /// What keeps a program from compiling on probe scenes; empty = it can be lowered on all of them. What was tried before
    /// is not tried again, and a recorded rollout is proof that the program compiled there.
    pub fn trials(&self, probes: &[usize], program: &Program, hash: Digest) -> Result<Vec<String>, RunError> {
        let Labelling { study, spec, counsels, tools } = *self;
        let source = study.source(spec)?;
        let mut prepared = None;
        let mut problems = Vec::new();
        for &place in probes {
            let entry = &study.scenes[place];
            let counsel = counsels.at(study, spec, place)?;
            let advised = counsel.map(Counsel::digest).transpose()?;
            // The compilation and the rollout of one request have one key, each among its own kind of memo.
            let key = request_key(hash, entry.digest, spec.ego.digest(), study.seed, advised)?;
            if tools.rollouts.has(&key) {
                continue;
            }
            if let Some(trial) = tools.rollouts.tried(&key)? {
                problems.extend(trial.failure.clone());
                continue;
            }
            let ready = match &prepared {
                Some(ready) => ready,
                None => match Prepared::new(program, source) {
                    Ok(ready) => prepared.insert(ready),
                    Err(failure) => return Ok(vec![failure.to_string()]),
                },
            };
            let situation = tools.situations.at(place, &spec.ego).map_err(RunError::Study)?;
            let compile = || ready.compile_counselled(&situation, study.seed, counsel);
            let failure = tools.meter.compile(&spec.id, compile).err().map(|failure| failure.to_string());
            let (program, scene, scene_digest) = (hash, entry.scene().id.clone(), entry.digest);
            let ego = spec.ego.name().to_string();
            let trial = TrialRecord { program, scene, scene_digest, ego, failure: failure.clone() };
            tools.rollouts.keep_trial(&key, trial)?;
            problems.extend(failure);
        }
        Ok(problems)
    }

    /// Compiles for one scene, with the counsel where the family takes it, and rolls out. A text is the reason why there is
    /// no label.
    pub fn rollout(
        &self,
        prepared: &Prepared<'_>,
        place: usize,
        counsel: Option<&Counsel>,
    ) -> Result<RolloutRecord, String> {
        let Labelling { study, spec, tools, .. } = *self;
        let situation = tools.situations.at(place, &spec.ego)?;
        let compile = || prepared.compile_counselled(&situation, study.seed, counsel);
        let compiled = tools.meter.compile(&spec.id, compile).map_err(|failure| failure.to_string())?;
        let run = || rollout(&situation.plant, &compiled.intervention, spec.ego.driver().as_mut());
        let outcome: Outcome = tools.meter.rollout(&spec.id, run).map_err(|error| error.to_string())?;
        record(&study.scenes[place], spec, prepared, &compiled.decision, outcome)
    }
}

/// The record of a rollout.
pub fn record(
    entry: &SceneEntry,
    spec: &LineageSpec,
    prepared: &Prepared<'_>,
    decision: &Decision,
    outcome: Outcome,
) -> Result<RolloutRecord, String> {
    Ok(RolloutRecord {
        scene: entry.scene().id.clone(),
        scene_digest: entry.digest,
        program: prepared.hash(),
        ego: spec.ego.name().to_string(),
        intervened: decision.applies,
        decision: serde_json::to_value(decision).map_err(|error| error.to_string())?,
        outcome,
    })
}
