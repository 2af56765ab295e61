//! The scene-level decision ω = (u, i, ι, ϑ, χ): mode, actors, windows, motion, guards (paper eq.
//! app-scene-level-omega), as it is recorded beside the rollout's outcome.

use serde::{Deserialize, Serialize};

use crate::motion::Window;
use crate::scene::{AgentKind, TrackIx};
use crate::sim::Intervention;

/// A program made concrete for one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Compiled {
    /// The decision, as it is recorded.
    pub decision: Decision,
    /// Empty where the program does not apply: plain replay.
    pub intervention: Intervention,
}

/// Decision of a program in one scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Decision {
    /// True if the program does anything in this scene.
    pub applies: bool,
    /// Why it does not apply; empty where it does.
    pub reason: String,
    /// u: names of the policy rules that held.
    pub mode: Vec<String>,
    /// i, ι, ϑ: one entry an adversary.
    pub actors: Vec<ActorDecision>,
    /// Way that was taken where two meet: `node: input`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub branches: Vec<String>,
    /// χ: what every filter on the ways walked removed, in their order.
    pub filters: Vec<FilterReport>,
    /// Scenarios that the program simulated against the ego before it chose one: samples of its grid or template, queries of its search.
    /// Recorded only for SafeBench's scripts as they run (`simulator.scripts`), so that every older record stays as it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search_rollouts: Option<usize>,
}

/// One adversary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActorDecision {
    /// Index in the scene; beyond its tracks for an inserted road user.
    pub track: TrackIx,
    /// Kind of the inserted road user; `None` for a track of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inserted: Option<AgentKind>,
    /// The steps of the scene in which it follows its chosen motion.
    pub window: Window,
    /// Number of candidates left to choose from.
    pub candidates: usize,
    /// Place of the chosen one among them, from 0.
    pub chosen: usize,
    /// Score that the choice gave it; its unit is that of the program's expression.
    pub score: f64,
    /// Logarithm of its probability under the motion prior.
    pub prior_log_probability: f64,
    /// Length of the chosen path, metres.
    pub path_m: f64,
    /// Speed at the path's end, m/s.
    pub end_speed_mps: f64,
    /// True if it obeys a law.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lawful: bool,
    /// Scene step from which the adversary is reactive and no longer follows the path.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub handover_step: Option<usize>,
}

/// Effect of a filter node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilterReport {
    /// The filter's name in the program.
    pub node: String,
    /// Number of candidates that came to it.
    pub before: usize,
    /// Number of candidates that it let through.
    pub after: usize,
    /// If it refused every candidate: by how much the one that it handed back violates it, 1 = once the bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub violation: Option<f64>,
}
