//! The MetaDrive protocol: every scene once, closed loop, against one fixed ego (paper, appendix MetaDrive Protocol).

use super::super::metrics::EvaluationOptions;
use super::super::record::{CacheError, RolloutCache, RolloutRecord, request_key};
use super::super::score::{scene_score, score_of};
use crate::ego::Policy;
use crate::kernel::{Digest, Seed, canon::CanonError, par::Pool};
use crate::objects::{SceneFailure, SceneScore, Score};

/// What is labelled.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    pub program: Digest,
    pub ego: &'a Policy,
    pub seed: Seed,
}

/// A scene by what its rollout's key needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneRef<'a> {
    pub id: &'a str,
    pub digest: Digest,
}

/// Simulates the program in scene number `i` of the list: compile, then roll out. A text is the reason why there is
/// no label. Called only for scenes whose record is not at hand.
pub type Labeller<'a> = dyn Fn(usize) -> Result<RolloutRecord, String> + Sync + 'a;

/// No score.
#[derive(Debug, thiserror::Error)]
pub enum EvaluationError {
    #[error(transparent)]
    Cache(#[from] CacheError),
    #[error("no scene could be labelled; the first reason: {0}")]
    NoLabel(String),
    #[error("a rollout request has no key: {0}")]
    Key(#[from] CanonError),
}

/// Labels a program on scenes, in parallel, in scene order. Scenes without a label are listed, never scored.
pub fn evaluate(
    subject: &Subject<'_>,
    scenes: &[SceneRef<'_>],
    label: &Labeller<'_>,
    options: &EvaluationOptions,
    cache: &dyn RolloutCache,
    pool: &Pool,
) -> Result<Score, EvaluationError> {
    let labels = pool.map(scenes, |i, scene| one(subject, i, scene, label, options, cache));
    let (mut scored, mut failures) = (Vec::new(), Vec::new());
    for labelled in labels {
        match labelled? {
            Ok(scene) => scored.push(scene),
            Err(failure) => failures.push(failure),
        }
    }
    let reason = failures.first().map_or("there are no scenes".to_string(), |f| format!("{}: {}", f.scene, f.reason));
    score_of(scored, failures).ok_or(EvaluationError::NoLabel(reason))
}

fn one(
    subject: &Subject<'_>,
    i: usize,
    scene: &SceneRef<'_>,
    label: &Labeller<'_>,
    options: &EvaluationOptions,
    cache: &dyn RolloutCache,
) -> Result<Result<SceneScore, SceneFailure>, EvaluationError> {
    let key = request_key(subject.program, scene.digest, subject.ego.digest(), subject.seed)?;
    if let Some((record, stored)) = cache.recorded(&key)? {
        return Ok(Ok(scene_score(&record, key, stored, options)));
    }
    Ok(match label(i) {
        Ok(record) => {
            let stored = cache.keep(&key, &record)?;
            Ok(scene_score(&record, key, stored, options))
        }
        Err(reason) => Err(SceneFailure { scene: scene.id.to_string(), reason }),
    })
}
