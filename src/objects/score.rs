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
    /// F(c): attack over all labelled scenes, realism over those that the program acts in. A program that acts nowhere has
    /// neither: both are 0, because there is no evidence that what it does is realistic.
    pub objectives: Objectives,
    /// Realism over all labelled scenes, those that nobody touched counting 1: the paper's plain mean.
    pub realism_all: f64,
    /// Share of the labelled scenes that the program acts in, 0..=1.
    pub coverage: f64,
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
    /// a(τ), 0..=1; 0 where the program does not act, and where the ego meets whom it runs into anyway.
    pub attack: f64,
    /// r(τ), 0..=1; 1 where the program does not act, and counts into the objective only where it does.
    pub realism: f64,
    /// Whether the motion of some adversary really differs from what replay shows.
    pub acted: bool,
    /// d_j of each realism diagnostic, 1 = satisfied.
    pub diagnostics: BTreeMap<String, f64>,
    /// Whom the ego met, if anyone: the first contact, which ends the rollout.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<Met>,
    /// Whether the program asked for an intervention in this scene.
    pub intervened: bool,
    /// Key of the rollout request, and digest of the stored rollout record.
    pub request: Digest,
    /// Digest of the stored rollout record.
    pub record: Digest,
}

/// The ego's contact with somebody.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Met {
    /// Whether it is an adversary of the program, and not somebody whom it left alone.
    pub adversary: bool,
    /// Who struck whom, on which side: the name of a contact class of the simulator.
    pub class: String,
    /// Whether the ego could have avoided it; `None` where nobody assessed that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub avoidable: Option<bool>,
    /// Whether the ego runs into the same one in plain replay.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub anyway: bool,
}

/// A scene without a label, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneFailure {
    /// Id of the scene.
    pub scene: String,
    /// Why it has no label.
    pub reason: String,
}
