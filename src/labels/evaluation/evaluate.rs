//! Labels of a program: every scene once, closed loop, against one fixed ego, scored as the experiment's protocol says
//! (paper, appendices MetaDrive Protocol and CARLA/SafeBench Protocol).

use super::metrics::EvaluationOptions;
use super::protocol::safebench::Group;
use super::record::{CacheError, RolloutCache, RolloutRecord, request_key};
use super::score::{Grouped, benchmark_score, scene_score, score_of, staged_scene_score};
use std::sync::Arc;

use crate::backend::{BackendError, NoOutcome};
use crate::ego::Policy;
use crate::kernel::{Digest, Seed, Threads, canon::CanonError};
use crate::objects::{SceneFailure, SceneScore, Score, benchmark::SafebenchRun};
use crate::sim::Undriven;

/// Program, ego and simulator of a label.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The program's hash.
    pub program: Digest,
    /// The driver under test.
    pub ego: &'a Policy,
    /// Digest of the simulator's options, and of the backend where that is another simulator.
    pub simulator: Digest,
    /// Seed of every random draw of compiler and simulator.
    pub seed: Seed,
}

/// The parts of a scene that its rollout's key needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneRef<'a> {
    /// The scene's name.
    pub id: &'a str,
    /// Digest of the scene's content.
    pub digest: Digest,
    /// Its group in SafeBench's protocol; `None` for a scene that is staged for no traffic family.
    pub group: Option<Group>,
    /// Digest of the counsel that was taken for it; `None` in families that take none.
    pub counsel: Option<Digest>,
}

/// Simulates the program in scene number `i` of the list: compile, then roll out. Called only for scenes whose record is
/// not at hand.
pub type Labeller<'a> = dyn Fn(usize) -> Result<RolloutRecord, NoOutcome> + Sync + 'a;

/// No score.
#[derive(Debug, thiserror::Error)]
pub enum EvaluationError {
    /// The records of rollouts cannot be used.
    #[error(transparent)]
    Cache(#[from] CacheError),
    /// Not one scene has a label; the text is the reason of the first.
    #[error("no scene could be labelled; the first reason: {0}")]
    NoLabel(String),
    /// A scene, by its name, belongs to no group of SafeBench's protocol.
    #[error("scene {0} belongs to no traffic family of SafeBench; its protocol needs [scenes] source = \"safebench\"")]
    Unstaged(String),
    /// The simulating backend cannot go on.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// A request has no canonical bytes, and so no key.
    #[error("the key of a rollout request cannot be computed: {0}")]
    Key(#[from] CanonError),
}

/// Labels a program on scenes, in parallel, in scene order. Scenes without a label are listed, never scored.
pub fn evaluate(
    subject: &Subject<'_>,
    scenes: &[SceneRef<'_>],
    label: &Labeller<'_>,
    options: &EvaluationOptions,
    cache: &dyn RolloutCache,
    pool: &Threads,
) -> Result<Score, EvaluationError> {
    let records = pool.map(scenes, |i, scene| label_one(subject, i, scene, label, cache));
    let (mut labelled, mut failed) = (Vec::new(), Vec::new());
    for (scene, record) in scenes.iter().zip(records) {
        match record? {
            Ok(record) => labelled.push((scene, record)),
            Err(failure) => failed.push((scene, failure)),
        }
    }
    let said = |(_, f): &(&SceneRef<'_>, SceneFailure)| format!("{}: {}", f.scene, f.reason);
    let reason = failed.first().map_or("there are no scenes".to_string(), said);
    let score = match options {
        EvaluationOptions::Metadrive(options) => {
            let score = |(_, r): &(&SceneRef<'_>, Recorded)| scene_score(&r.record, r.key, r.stored, options);
            score_of(
                labelled.iter().map(score).collect(),
                failed.into_iter().map(|(_, f)| f).collect(),
                options.rules(),
            )
        }
        EvaluationOptions::Safebench { safebench } => {
            let mut runs: Vec<Grouped<(SceneScore, SafebenchRun)>> = Vec::with_capacity(labelled.len());
            for (scene, r) in &labelled {
                let unstaged = || EvaluationError::Unstaged(scene.id.to_string());
                let label = staged_scene_score(&r.record, r.key, r.stored, safebench).ok_or_else(unstaged)?;
                runs.push((scene.group.ok_or_else(unstaged)?, label));
            }
            benchmark_score(runs, failed.into_iter().filter_map(|(s, f)| Some((s.group?, f))).collect())
        }
    };
    score.ok_or(EvaluationError::NoLabel(reason))
}

/// A record that is at hand.
pub struct Recorded {
    record: Arc<RolloutRecord>,
    key: Digest,
    stored: Digest,
}

/// Returns one scene's label: its record, where there is one, or the result of `label` for scene number `i`, kept from then on.
pub fn label_one(
    subject: &Subject<'_>,
    i: usize,
    scene: &SceneRef<'_>,
    label: &Labeller<'_>,
    cache: &dyn RolloutCache,
) -> Result<Result<Recorded, SceneFailure>, EvaluationError> {
    let key = {
        let (ego, simulator) = (subject.ego.digest(), subject.simulator);
        request_key(subject.program, scene.digest, ego, simulator, subject.seed, scene.counsel)?
    };
    if let Some((record, stored)) = cache.recorded(&key)? {
        return Ok(Ok(Recorded { record, key, stored }));
    }
    Ok(match label(i) {
        Ok(record) => {
            let stored = cache.keep(&key, &record)?;
            Ok(Recorded { record: Arc::new(record), key, stored })
        }
        Err(NoOutcome::Scene(reason)) => Err(failure(scene.id, reason)),
        Err(NoOutcome::Stop(error)) => return Err(error.into()),
    })
}

/// A scene without a label.
pub(super) fn failure(scene: &str, why: Undriven) -> SceneFailure {
    let (too_slow, abandoned) = (matches!(why, Undriven::TooSlow(_)), matches!(why, Undriven::Abandoned(_)));
    SceneFailure { scene: scene.to_string(), reason: why.to_string(), too_slow, abandoned }
}
