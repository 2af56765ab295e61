//! The MetaDrive-like protocol: one closed-loop rollout a scene, attack and realism averaged over scenes with a label.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use crate::adapters::Contract;
use crate::compiler::{Prepared, Situation, SituationError};
use crate::ego;
use crate::evaluation::metrics::attack::{AttackTarget, attack};
use crate::evaluation::metrics::realism::{RealismError, RealismOptions, diagnostics, realism};
use crate::evaluation::record::{CacheError, RolloutCache, RolloutRecord, RolloutRequest, RolloutResult};
use crate::kernel::canon::CanonError;
use crate::kernel::{Digest, Seed, num, par::Pool};
use crate::objects::{Objectives, Program, SceneFailure, SceneScore, Score};
use crate::sim;

/// From the experiment file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluationOptions {
    /// Root of the random streams of compilation.
    pub seed: Seed,
    pub attack: AttackTarget,
    pub realism: RealismOptions,
}

/// A scene by name, before it is prepared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneRef {
    pub id: String,
    pub digest: Digest,
}

/// No score could be made.
#[derive(Debug, thiserror::Error)]
pub enum EvaluationError {
    #[error(transparent)]
    Realism(#[from] RealismError),
    #[error("cannot name the rollout: {0}")]
    Canon(#[from] CanonError),
    #[error(transparent)]
    Cache(#[from] CacheError),
    #[error("none of {scenes} scenes got a label; the first failure: {first}")]
    NoLabel { scenes: usize, first: String },
}

/// A record with the names under which it is kept.
type Kept = (Digest, Digest, RolloutRecord);

/// Rolls a program out over scenes and scores it. `provide` prepares the i-th scene; it is asked only for scenes whose
/// rollout is not in the cache. Results come in scene order, whatever the number of threads.
#[allow(clippy::too_many_arguments)] // one word each for what a rollout depends on
pub fn evaluate(
    program: &Program,
    contract: &Contract,
    scenes: &[SceneRef],
    provide: &(dyn Fn(usize) -> Result<Arc<Situation>, SituationError> + Sync),
    policy: &ego::Policy,
    options: &EvaluationOptions,
    cache: &dyn RolloutCache,
    pool: &Pool,
) -> Result<Score, EvaluationError> {
    options.realism.check()?;
    let hash = program.hash()?;
    // A program that breaks its contract has no prepared form; its scenes fail with that reason.
    let prepared = Prepared::new(program, contract);
    let one = |index: usize, scene: &SceneRef| -> Result<Kept, EvaluationError> {
        let request = RolloutRequest::new(hash, &scene.id, scene.digest, policy, options.seed);
        let key = request.key()?;
        if let Some((record, digest)) = cache.get(&key)? {
            return Ok((key, digest, record));
        }
        let result = match &prepared {
            Ok(prepared) => roll_out(prepared, provide(index), policy, options.seed),
            Err(failure) => RolloutResult::Failed { reason: failure.to_string() },
        };
        let record = RolloutRecord { request, result };
        let digest = cache.put(&key, &record)?;
        Ok((key, digest, record))
    };
    let records: Vec<Kept> = pool.map(scenes, one).into_iter().collect::<Result<_, _>>()?;
    score_of(&records, options)
}

/// One scene: compile, then simulate.
fn roll_out(
    prepared: &Prepared<'_>,
    situation: Result<Arc<Situation>, SituationError>,
    policy: &ego::Policy,
    seed: Seed,
) -> RolloutResult {
    let labelled = || -> Result<RolloutResult, String> {
        let situation = situation.map_err(|e| e.to_string())?;
        let compiled = prepared.compile(&situation, seed).map_err(|e| e.to_string())?;
        let mut driver = policy.driver();
        let outcome = sim::rollout(&situation.plant, &compiled.intervention, driver.as_mut());
        let outcome = Box::new(outcome.map_err(|e| e.to_string())?);
        Ok(RolloutResult::Labelled { decision: compiled.decision, outcome })
    };
    labelled().unwrap_or_else(|reason| RolloutResult::Failed { reason })
}

/// The score that records (request key, record digest, record) amount to: A and R are means over labelled scenes.
pub fn score_of(records: &[Kept], options: &EvaluationOptions) -> Result<Score, EvaluationError> {
    let mut scenes = Vec::with_capacity(records.len());
    let mut failures = Vec::new();
    for (request, digest, record) in records {
        let scene = record.request.scene_id.clone();
        match &record.result {
            RolloutResult::Failed { reason } => failures.push(SceneFailure { scene, reason: reason.clone() }),
            RolloutResult::Labelled { decision, outcome } => {
                let diagnostics = diagnostics(outcome, &options.realism);
                scenes.push(SceneScore {
                    scene,
                    attack: attack(outcome, options.attack),
                    realism: realism(&diagnostics, &options.realism.weights),
                    diagnostics,
                    intervened: decision.applies,
                    request: *request,
                    record: *digest,
                });
            }
        }
    }
    let mean = |value: fn(&SceneScore) -> f64| num::mean(&scenes.iter().map(value).collect::<Vec<f64>>());
    match (mean(|s| s.attack), mean(|s| s.realism)) {
        (Some(attack), Some(realism)) => Ok(Score { objectives: Objectives { attack, realism }, scenes, failures }),
        _ => Err(EvaluationError::NoLabel {
            scenes: records.len(),
            first: failures.first().map_or("there are no scenes".into(), |f| format!("{}: {}", f.scene, f.reason)),
        }),
    }
}

#[cfg(test)]
mod tests;
