//! Scores of SafeBench's protocol: over groups of a traffic family and a route, families counting alike.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::ids::{LineageId, SolutionId};

/// A row of SafeBench's tables. All in 0..=1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchmarkRow {
    /// CR.
    pub collision_rate: f64,
    /// OS; lower is a stronger scenario. Below 0 where rules are broken without measure.
    pub overall_score: f64,
    /// ARS.
    pub realism: f64,
    pub valid_rate: f64,
    /// CR (1 - OS).
    pub attack: f64,
}

/// Rows of a set of runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Benchmark {
    pub runs: usize,
    /// Scenes that could not be run; they count as invalid.
    pub failures: usize,
    /// By traffic family, over all its routes.
    pub families: BTreeMap<String, BenchmarkRow>,
    /// Means over the families; attack is that of the means, as in the paper's tables.
    pub mean: BenchmarkRow,
}

/// The archive of a lineage after some rounds: per group the scenes that balanced selection keeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArchiveRound {
    pub lineage: LineageId,
    /// 0: the parent's scenes alone.
    pub round: u32,
    pub benchmark: Benchmark,
    pub selected: Vec<SelectedScene>,
}

/// A labelled run that balanced selection keeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SelectedScene {
    /// `family/route`.
    pub group: String,
    /// Whose program made it.
    pub solution: SolutionId,
    /// Contribution of the run alone.
    pub attack: f64,
    pub realism: f64,
}
