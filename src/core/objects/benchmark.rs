//! Scores of SafeBench's protocol over groups (a traffic family and a route). All families have the same weight.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::ids::{LineageId, SolutionId};

/// The quantities of one run that the overall score uses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// True if the ego collided with a road user that the program staged.
    pub collision: bool,
    /// Red lights that the ego ran.
    pub red_lights: f64,
    /// Stop signs that the ego ran.
    pub stop_signs: f64,
    /// Metres that the ego drove off the road.
    pub off_road_m: f64,
    /// Mean over time of the distance to the route, m.
    pub route_distance_m: f64,
    /// 0..=1; a completed route counts as 1.
    pub completion: f64,
    /// Duration of a completed run, s.
    pub completed_s: Option<f64>,
    /// Mean over time of the norm of the acceleration, m/s².
    pub acceleration_mps2: f64,
    /// Sum of absolute heading changes over the duration, rad/s.
    pub yaw_rate_radps: f64,
    /// Lanes that the ego invaded.
    pub lane_invasions: f64,
}

/// Sub-scores and validity of one run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRealism {
    /// True if a road user that the program staged was set off or met the ego.
    pub acted: bool,
    /// False for every run in which the program did not act, unless such runs are judged as well.
    pub valid: bool,
    /// S_kin, S_map, S_int, S_dist, each 0..=1; all 0 of a run that is not judged. Of a judged idle run S_int is at least 1/3.
    pub sub_scores: [f64; 4],
}

impl RunRealism {
    /// Returns `true` if the run counts for ARS.
    pub fn is_judged(&self) -> bool {
        self.acted || self.sub_scores != [0.0; 4]
    }
}

/// One labelled run of a staged scene. SafeBench's scores of a set of runs are computed from these alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SafebenchRun {
    /// Quantities for the overall score.
    pub run: Run,
    /// How realistic the adversaries were, and whether the program acts at all.
    pub realism: RunRealism,
    /// Scenarios that the program simulated against the ego before it chose this one; `None` of records that do not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search_rollouts: Option<u32>,
}

/// A row of SafeBench's tables. Rates are in 0..=1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchmarkRow {
    /// CR.
    pub collision_rate: f64,
    /// OS; a lower value means a stronger scenario. It can fall below 0 if rules are broken very often.
    pub overall_score: f64,
    /// ARS of the runs that the program acts in.
    pub realism: f64,
    /// Share of the runs that are valid, 0..=1.
    pub valid_rate: f64,
    /// CR (1 - OS).
    pub attack: f64,
    /// Mean number of scenarios that the programs simulated against the ego before they chose a run's; `None` where no run tells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search_rollouts: Option<f64>,
}

/// Rows of a set of runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Benchmark {
    /// Number of runs behind the figures.
    pub runs: usize,
    /// Scenes that could not be run; they count as invalid.
    pub failures: usize,
    /// Rows by traffic family, over all its routes.
    pub families: BTreeMap<String, BenchmarkRow>,
    /// Means over the families. Attack is computed from the mean CR and OS, as in the paper's tables.
    pub mean: BenchmarkRow,
}

/// Result of a held-out scene in SafeBench's protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOutRun {
    /// `family/route`.
    pub group: String,
    /// Id of the scene; a group may hold several.
    pub scene: String,
    /// The run, to compute the score of any set of runs; `None` for a scene that could not be run.
    pub run: Option<SafebenchRun>,
}

/// The archive of a lineage after some rounds: per group the scenes that balanced selection keeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArchiveRound {
    /// Whose archive.
    pub lineage: LineageId,
    /// 0: the parent's scenes alone.
    pub round: u32,
    /// The benchmark's figures of the round.
    pub benchmark: Benchmark,
    /// The scenes that were selected.
    pub selected: Vec<SelectedScene>,
}

/// A labelled run that balanced selection keeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SelectedScene {
    /// `family/route`.
    pub group: String,
    /// Id of the scene; a group may hold several.
    pub scene: String,
    /// Whose program made it.
    pub solution: SolutionId,
    /// Contribution of the run alone.
    pub attack: f64,
    /// Realism of the selected run, 0..=1.
    pub realism: f64,
    /// The run itself, to compute the score of any set of runs.
    pub run: SafebenchRun,
}

/// The control of a lineage's archive: the same search with the parent, drawn anew, in the place of every program that was labelled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Redrawn {
    /// Whose archive it is set beside.
    pub lineage: LineageId,
    /// Programs whose place the parent took.
    pub programs: usize,
    /// Scenes that balanced selection keeps after every round, from the parent's own scenes alone on. A redrawn scene ends in `/redrawNN`.
    pub rounds: Vec<ArchiveRound>,
    /// PF-Area@3 of each group, percent.
    pub pf_area_at_3_pct_by_group: BTreeMap<String, f64>,
}
