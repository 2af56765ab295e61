//! The archive's record of one evaluated candidate (paper, appendix Archive, Memory, and Retrieval).

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{
    attempt::AcceptanceGates,
    ids::{AttemptId, FamilyName, LineageId, SolutionId},
    score::{Objectives, Score},
};
use crate::kernel::{Digest, num};

/// One point of the attack-realism plane, with references to everything that it is based on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Which program.
    pub solution: SolutionId,
    /// `None` for the parent with which a lineage starts: nobody proposed it.
    pub attempt: Option<AttemptId>,
    /// Hash of its content.
    pub program_hash: Digest,
    /// Its family.
    pub family: FamilyName,
    /// The fixed driver against which it was evaluated, e.g. `idm`.
    pub ego: String,
    /// Its lineage.
    pub lineage: LineageId,
    /// Epoch in which it was evaluated.
    pub epoch: u32,
    /// F(c) as measured.
    pub objectives: Objectives,
    /// Mean of each realism diagnostic over the scenes that the program acts in, 1 = satisfied.
    pub diagnostics: BTreeMap<String, f64>,
    /// Digest of the ordered list of scene ids of the evaluation subset. Points of different subsets are samples of
    /// the same quantity, not repetitions of one measurement.
    pub scenes: Digest,
    /// Version of the simulator that measured it.
    pub sim_version: u32,
    /// Operator kinds of the compiled graph, in slot order.
    pub operators: Vec<String>,
    /// Sorted, without repeats.
    pub mechanism_tags: Vec<String>,
    /// The gates that accepted it; `None` for the parent with which a lineage starts.
    pub gates: Option<AcceptanceGates>,
}

/// Mean of each diagnostic over the scenes that the program acts in and that report it, in scene order.
pub fn diagnostics_mean(score: &Score) -> BTreeMap<String, f64> {
    let mut values: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for scene in score.scenes.iter().filter(|scene| scene.acted) {
        for (name, value) in &scene.diagnostics {
            values.entry(name.clone()).or_default().push(*value);
        }
    }
    values.into_iter().filter_map(|(name, all)| num::mean(&all).map(|mean| (name, mean))).collect()
}
