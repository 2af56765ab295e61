//! The labels of a candidate: objectives, and the labels of each scene behind them.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::benchmark::Benchmark;
use crate::kernel::Digest;

/// F(c) = (A, R), both in [0, 1], larger is better (paper eq. prelim-objectives).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Objectives {
    /// A(c), 0..=1; larger is better.
    pub attack: f64,
    /// R(c), 0..=1; larger is better.
    pub realism: f64,
}

impl Objectives {
    /// RP = 100 (1 - R), percent (paper eq. app-realism-penalty).
    pub fn realism_penalty_pct(&self) -> f64 {
        100.0 * (1.0 - self.realism)
    }

    /// Pareto dominance under maximisation: not worse in either objective, better in at least one.
    pub fn dominates(&self, other: &Objectives) -> bool {
        self.attack >= other.attack
            && self.realism >= other.realism
            && (self.attack > other.attack || self.realism > other.realism)
    }
}

/// Objectives with their evidence. Scenes that failed are listed, never scored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// F(c): means over `scenes`.
    pub objectives: Objectives,
    /// Labels, in the order of the scenes.
    pub scenes: Vec<SceneScore>,
    /// Scenes without a label, and why.
    pub failures: Vec<SceneFailure>,
    /// Rows of SafeBench's protocol, from which the objectives are taken; `None` in MetaDrive's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub benchmark: Option<Box<Benchmark>>,
}

/// One labelled rollout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneScore {
    /// Id of the scene.
    pub scene: String,
    /// a(τ), 0..=1.
    pub attack: f64,
    /// r(τ), 0..=1.
    pub realism: f64,
    /// d_j of each realism diagnostic, 1 = satisfied.
    pub diagnostics: BTreeMap<String, f64>,
    /// Whether the program intervened at all in this scene.
    pub intervened: bool,
    /// Key of the rollout request, and digest of the stored rollout record.
    pub request: Digest,
    /// Digest of the stored rollout record.
    pub record: Digest,
}

/// A scene without a label, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneFailure {
    /// Id of the scene.
    pub scene: String,
    /// Why it has no label.
    pub reason: String,
}
