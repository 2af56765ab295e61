//! From rollout records to a candidate's score: means over scenes, in scene order.

use super::metrics::{EvaluationOptions, attack, realism};
use super::record::RolloutRecord;
use crate::kernel::{Digest, num};
use crate::objects::{Objectives, SceneFailure, SceneScore, Score};

/// One scene's labels.
pub fn scene_score(record: &RolloutRecord, request: Digest, stored: Digest, options: &EvaluationOptions) -> SceneScore {
    let diagnostics = realism::diagnostics(&record.outcome, &options.realism);
    SceneScore {
        scene: record.scene.clone(),
        attack: attack::attack(&record.outcome, &options.attack),
        realism: realism::realism(&diagnostics, &options.realism),
        diagnostics,
        intervened: record.intervened,
        request,
        record: stored,
    }
}

/// F(c) = (A, R) as empirical means (paper eq. prelim-objectives). `None` if no scene has a label: there is no score
/// without evidence.
pub fn score_of(scenes: Vec<SceneScore>, failures: Vec<SceneFailure>) -> Option<Score> {
    let mean = |value: fn(&SceneScore) -> f64| num::mean(&scenes.iter().map(value).collect::<Vec<f64>>());
    let objectives = Objectives { attack: mean(|s| s.attack)?, realism: mean(|s| s.realism)? };
    Some(Score { objectives, scenes, failures })
}
