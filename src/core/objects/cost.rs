//! The cost of a run, by lineage. It is kept beside the run, never in it: no event and no digest contains a time.

use serde::{Deserialize, Serialize};

use super::ids::{FamilyName, LineageId};

/// Version of the file that holds a [`RunCost`].
pub const FORMAT: &str = "evodrive-cost/1";

/// Work done for one lineage. Results that were read from the store are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Work {
    /// Time from one lineage's end to the next one's, seconds: the lineages of a run take turns.
    pub wall_s: f64,
    /// Scenes for which a program was compiled, and the time that it took, summed over threads.
    pub compiled: usize,
    /// Compiling, seconds.
    pub compile_s: f64,
    /// Rollouts that were simulated, and the time that it took, summed over threads.
    pub rollouts: usize,
    /// Rollouts, seconds.
    pub rollout_s: f64,
    /// Answers of models, from a cassette too, and the time that they took, summed over threads.
    pub answers: usize,
    /// Waiting for models, seconds.
    pub model_s: f64,
    /// Tokens of the questions as the providers counted them; 0 where they said nothing, as the scripted model does.
    pub input_tokens: u64,
    /// Tokens of the answers, where a provider reported them.
    pub output_tokens: u64,
    /// Tokens of the questions that providers read from their caches.
    #[serde(default)]
    pub cached_input_tokens: u64,
    /// Questions of which a server read only a part, by the tokens that it counted.
    #[serde(default)]
    pub cut_prompts: usize,
}

/// A lineage's work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineageCost {
    /// Whose cost.
    pub lineage: LineageId,
    /// Its family.
    pub family: FamilyName,
    /// Its ego.
    pub ego: String,
    /// Work done for the lineage.
    #[serde(flatten)]
    pub work: Work,
}

/// The cost of carrying a run out once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunCost {
    /// Name and version of this format.
    pub format: String,
    /// Worker threads of the run.
    pub threads: usize,
    /// Distinct rollouts simulated, and read from the store.
    pub simulated: usize,
    /// Distinct rollouts read from the store.
    pub reused: usize,
    /// One entry per lineage.
    pub lineages: Vec<LineageCost>,
}

impl RunCost {
    /// Time of all lineages, seconds.
    pub fn wall_s(&self) -> f64 {
        self.lineages.iter().map(|lineage| lineage.work.wall_s).sum()
    }
}
