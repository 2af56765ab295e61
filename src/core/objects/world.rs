//! The world evaluator as an object: configuration φ, which may evolve, and what was fitted from labels
//! (paper, World-Conditioned Candidate Routing; appendix World Evaluator and Evaluator Evolution).

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{
    attempt::RouteDecision,
    ids::{AttemptId, FamilyName, SolutionId},
    score::Objectives,
};
use crate::kernel::{Digest, canon::CanonError};

/// The groups of signals: the paper's five, the parent's outcome, probe compilations, and rollouts in our own simulator where
/// another one makes the labels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FeatureGroup {
    /// One indicator per family.
    Family,
    /// Parts of the program that the patch edits.
    Edit,
    /// The child's operator graph.
    Graph,
    /// The scene.
    Scene,
    /// The adversaries' interaction with the ego.
    Interaction,
    /// Outcome of the parent.
    Parent,
    /// Probes of the compiled interventions, without a rollout.
    Probe,
    /// Rollouts in our own simulator, where another one makes the labels.
    Simulated,
    /// The policy under test (`[world.pairs]`).
    Ego,
    /// The child's mechanism tags (`[world.pairs]`).
    Mechanism,
    /// Realism diagnostics that need no rollout of the child (`[world.pairs]`).
    Realism,
    /// Errors of earlier predictions of similar candidates (`[world.pairs]`).
    Calibration,
}

impl FeatureGroup {
    /// All groups, in the schema's order.
    pub const ALL: [FeatureGroup; 12] = [
        FeatureGroup::Family,
        FeatureGroup::Edit,
        FeatureGroup::Graph,
        FeatureGroup::Scene,
        FeatureGroup::Interaction,
        FeatureGroup::Parent,
        FeatureGroup::Probe,
        FeatureGroup::Simulated,
        FeatureGroup::Ego,
        FeatureGroup::Mechanism,
        FeatureGroup::Realism,
        FeatureGroup::Calibration,
    ];

    /// The word in patches, audits and reports.
    pub fn name(self) -> &'static str {
        match self {
            FeatureGroup::Family => "family",
            FeatureGroup::Edit => "edit",
            FeatureGroup::Graph => "graph",
            FeatureGroup::Scene => "scene",
            FeatureGroup::Interaction => "interaction",
            FeatureGroup::Parent => "parent",
            FeatureGroup::Probe => "probe",
            FeatureGroup::Simulated => "simulated",
            FeatureGroup::Ego => "ego",
            FeatureGroup::Mechanism => "mechanism",
            FeatureGroup::Realism => "realism",
            FeatureGroup::Calibration => "calibration",
        }
    }
}

/// One number of x(c, s); the name ends with the unit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeatureColumn {
    /// Name in snapshots and reports.
    pub name: String,
    /// Group that the column belongs to.
    pub group: FeatureGroup,
}

/// Names and order of the numbers of x(c, s).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeatureSchema {
    /// One indicator each, in this order.
    pub families: Vec<FamilyName>,
    /// One entry per column, in the order of the values.
    pub columns: Vec<FeatureColumn>,
}

impl FeatureSchema {
    /// Place of the first column of a group; `None` where the schema has none of it.
    pub fn place_of(&self, group: FeatureGroup) -> Option<usize> {
        self.columns.iter().position(|column| column.group == group)
    }
}

/// Counterfactual probe: measures of a compiled intervention without a rollout. Over several adversaries it holds the
/// nearest, the earliest and the largest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// Smallest distance of an adversary's box to the ego's in the ego's undisturbed rollout, metres, at most 100.
    pub ego_distance_m_min: f64,
    /// When the boxes first come within 2 m of each other, seconds from the first step that a program may change; 20 if never.
    pub conflict_s: f64,
    /// When the first adversary departs from its recording, seconds from the same step; 20 if nobody does.
    pub begins_s: f64,
    /// Farthest off the drivable area, metres.
    pub off_road_m: f64,
    /// Level of the acceleration, m/s².
    pub acceleration_mps2: f64,
    /// Level of the jerk, m/s³.
    pub jerk_mps3: f64,
    /// Adversaries.
    pub actors: f64,
}

impl Probe {
    /// Probe of a scene where nobody does anything.
    pub const NOTHING: Probe = Probe {
        ego_distance_m_min: 100.0,
        conflict_s: 20.0,
        begins_s: 20.0,
        off_road_m: 0.0,
        acceleration_mps2: 0.0,
        jerk_mps3: 0.0,
        actors: 0.0,
    };

    /// Returns its numbers, in the order of the fields.
    pub fn values(&self) -> [f64; 7] {
        [
            self.ego_distance_m_min,
            self.conflict_s,
            self.begins_s,
            self.off_road_m,
            self.acceleration_mps2,
            self.jerk_mps3,
            self.actors,
        ]
    }
}

/// A child and its parent, compiled for one scene without a rollout.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProbePair {
    /// Probe of the child.
    pub child: Probe,
    /// Probe of its parent.
    pub parent: Probe,
    /// True if the interventions are the same, bit for bit.
    pub same: bool,
}

/// ξ: a candidate over the scenes of a window, as the evaluator sees it before any rollout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldRow {
    /// One number per column of the schema.
    pub features: Vec<f64>,
    /// Share of the scenes in which the child may differ from its parent, in [0, 1]. In the others both compile to the same, so
    /// that the difference there is known to be zero.
    pub open_share: f64,
    /// The parent's labels on the same scenes.
    pub parent: Objectives,
    /// The candidate's family.
    pub family: FamilyName,
    /// The candidate's mechanism tags joined.
    pub mechanism_class: String,
    /// x(c, s) for each scene of the window, where the evaluator predicts pairs; the features above are then their means.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pairs: Vec<PairRow>,
}

/// x(c, s): a candidate in one scene, as the evaluator sees it before any rollout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairRow {
    /// One number per column of the schema.
    pub features: Vec<f64>,
    /// The parent's label in the scene, or its label on the window where the scene has none.
    pub parent: Objectives,
}

/// One element (ξ, y) of the calibration set D^W: a candidate and its labels from the simulator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldLabel {
    /// The attempt that was evaluated.
    pub attempt: AttemptId,
    /// Its program.
    pub solution: SolutionId,
    /// The epoch in which it was evaluated.
    pub epoch: u32,
    /// ξ: the basis of the prediction.
    pub row: WorldRow,
    /// A and R on the window, each in [0, 1].
    pub labels: Objectives,
    /// Q: rollout diagnostics, means over the scenes, 1 = satisfied.
    pub diagnostics: BTreeMap<String, f64>,
    /// The routing decision about the candidate.
    pub decision: RouteDecision,
    /// Prediction made before there were labels.
    pub predicted: Objectives,
    /// True if the archive accepted it.
    pub accepted: bool,
    /// Its label in each scene of `row.pairs`, each in [0, 1]; `None` where a rollout failed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pairs: Vec<Option<Objectives>>,
}

impl WorldLabel {
    /// Returns the child's labels less its parent's.
    pub fn difference(&self) -> Objectives {
        self.labels.less(&self.row.parent)
    }
}

/// The group whose mean calibrates a prediction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CalibrationGroup {
    /// One group per family.
    Family,
    /// One group per class of mechanism.
    MechanismClass,
}

/// Which regression predicts the difference from the parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WorldModel {
    /// Ridge regression on standardised columns.
    Ridge,
    /// Boosted regression trees of depth 3.
    Boosted,
    /// Rollouts in our own simulator, scaled, where another one makes the labels.
    Simulator,
}

/// Rule that picks the candidates for the rollouts of an epoch's budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoutingChoice {
    /// The candidates that the evaluator ranks first, and a random draw of the others.
    Ranked,
    /// A random draw: the baseline for the evaluator.
    Random,
}

/// The configuration φ of the evaluator. It comes from the experiment file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldConfiguration {
    /// Columns left out of the regression, by name.
    pub excluded_columns: Vec<String>,
    /// Which regression predicts.
    pub model: WorldModel,
    /// λ of the ridge on standardised columns, > 0; for the simulator, the labels that a slope of 1 counts for.
    pub ridge_lambda: f64,
    /// Trees of the boosted model.
    pub trees: u32,
    /// Share of its prediction that each tree adds, in (0, 1].
    pub learning_rate: f64,
    /// β_A and β_R: weight of the raw prediction against the group's mean difference, in [0, 1] (eq. app-world-calibration).
    pub beta_attack: f64,
    /// β_R: the same weight for realism.
    pub beta_realism: f64,
    /// How labels are grouped for calibration.
    pub calibration_group: CalibrationGroup,
    /// A group with fewer labels is sparse: its mean is not used, the global one is.
    pub group_labels_min: u32,
    /// Share of candidates whose labels an interval is to hold, in [0.5, 0.99].
    pub interval_level: f64,
    /// Weight of a difference of realism against one of attack in the rank, >= 0.
    pub realism_weight: f64,
    /// Weight of the uncertainty in the rank, >= 0, so that little-known candidates are tried first.
    pub explore: f64,
    /// Thresholds and shares of routing.
    pub routing: RoutingOptions,
    /// The evaluator as the method's paper has it; absent, it predicts candidates and goes by rank.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pairs: Option<PairOptions>,
}

/// `[world.pairs]`: one row per pair of candidate and scene, uncertainties aggregated conservatively, routing by value and uncertainty
/// (paper, section World-Conditioned Candidate Routing and its appendix). The regression is the ridge line: its uncertainty is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairOptions {
    /// Agg: the quantile of the scenes' uncertainties that is taken for the candidate's, in [0.5, 1]; 1 is their maximum.
    pub aggregate: f64,
    /// Uncertainty above which the evaluator abstains: it expects what the parent does, and leaves the candidate to the audits. In (0, 1].
    pub abstain_above: f64,
}

impl WorldConfiguration {
    /// The name by which turns of a world agent cite it.
    pub fn digest(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/world-configuration/1", self)
    }
}

/// Budget, thresholds and monitoring of the router (eq. method-routing).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoutingOptions {
    /// Number of candidates that are simulated per epoch, audits included.
    pub rollout_budget: u32,
    /// Rule that picks these candidates.
    pub choice: RoutingChoice,
    /// λ_A: attack that a candidate may lose against its parent, as predicted, 1.
    pub lambda_a: f64,
    /// λ_R: realism that it may lose, 1.
    pub lambda_r: f64,
    /// λ_U: largest uncertainty at which a candidate is turned away for a predicted loss beyond these, 1.
    pub lambda_u: f64,
    /// Share of the budget that is drawn at random among those that the rank leaves out, in [0, 1].
    pub audit_share: f64,
    /// With fewer labelled candidates none is ranked: the budget is drawn at random.
    pub min_labels: u32,
    /// Rollouts in a few scenes before candidates are ranked; absent where predictions alone rank.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pilot: Option<PilotOptions>,
}

/// A pilot: every admitted candidate is simulated in a few scenes, and the results there correct its prediction before
/// candidates are ranked (successive halving with two rungs).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PilotOptions {
    /// Scenes of a pilot, at most: of those of the window in which the candidate may differ from its parent.
    pub scenes: u32,
    /// Number of scenes that the prediction counts for beside those that were seen.
    pub prior_scenes: f64,
}

/// Count and means of the labels of a group.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroupMean {
    /// Number of labels behind the mean.
    pub labels: u32,
    /// Their mean.
    pub mean: Objectives,
}

/// One target's regression on standardised columns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RidgeLine {
    /// Mean of the target.
    pub intercept: f64,
    /// One weight per used column; empty where only the mean could be fitted.
    pub weights: Vec<f64>,
}

/// A regression tree of depth at most 3: nodes in order, the root first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tree {
    /// Nodes; children stand after their parent.
    pub nodes: Vec<TreeNode>,
}

/// A question or an answer of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TreeNode {
    /// Values of the column up to the bound go to `low`, the others to `high`.
    Split {
        /// Place of the column among the used ones.
        column: usize,
        /// Bound, in units of the standardised column.
        bound: f64,
        /// Place of the first child.
        low: usize,
        /// Place of the second child.
        high: usize,
    },
    /// Answer of the tree.
    Leaf {
        /// Value added to the prediction, in units of the target.
        value: f64,
    },
}

/// One target's boosted trees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Boosted {
    /// Mean of the target.
    pub intercept: f64,
    /// Trees, whose values add up.
    pub trees: Vec<Tree>,
}

/// One target's line through the origin: what our own simulator shows, times a slope.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatedSlope {
    /// Place in the schema of the difference that our own simulator shows, as in an open scene; it is not standardised.
    pub column: usize,
    /// Change of the label per unit of our own difference.
    pub slope: f64,
}

/// Predictor of one target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Regression {
    /// A line.
    Ridge(RidgeLine),
    /// Trees.
    Boosted(Boosted),
    /// A line through what our own simulator shows.
    Simulated(SimulatedSlope),
}

/// Result of fitting the labels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldFit {
    /// Number of labelled candidates behind the fit.
    pub labels: u32,
    /// Places of the used columns in the schema.
    pub columns: Vec<usize>,
    /// Mean and standard deviation of each used column; a column that never varied has 0 and has no effect. `[columns]`
    pub column_mean: Vec<f64>,
    /// Standard deviation of each column. `[columns]`
    pub column_std: Vec<f64>,
    /// Predicts the difference of attack in an open scene.
    pub attack: Regression,
    /// Predicts the difference of realism in an open scene.
    pub realism: Regression,
    /// Why only means were fitted, if so.
    pub fallback: Option<String>,
    /// Mean difference from the parent over all labels.
    pub global: GroupMean,
    /// Mean difference of each calibration group.
    pub groups: BTreeMap<String, GroupMean>,
    /// Half width of an interval for a candidate that is open everywhere: the conformal quantile of past errors, each made
    /// before its label was there. `None` where there are too few.
    pub half_width: Option<Objectives>,
    /// Further basis for predicting pairs; the groups' means are then of labels, not of differences.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pairs: Option<PairFit>,
}

/// Uncertainty of a line over pairs, and errors of earlier predictions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairFit {
    /// Labelled pairs behind the line.
    pub pairs: u32,
    /// (X'X + λI)⁻¹ of the standardised columns, row by row; empty where only means were fitted. `[columns * columns]`
    pub inverse: Vec<f64>,
    /// Root mean squared residual of the line.
    pub sigma: Objectives,
    /// Label less prediction, by family (`family cat`) and by mechanism class (`mechanism brake`): mean and count.
    pub missed: BTreeMap<String, GroupMean>,
}

/// W_φ as of an epoch's barrier; immutable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldSnapshot {
    /// Columns of a row's features.
    pub schema: FeatureSchema,
    /// Part of the evaluator that may evolve.
    pub configuration: WorldConfiguration,
    /// `None` before the first label.
    pub fit: Option<WorldFit>,
}

impl WorldSnapshot {
    /// Returns the name by which routes cite it.
    pub fn digest(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/world-snapshot/2", self)
    }
}
