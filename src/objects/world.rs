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

/// The five groups of signals of x(c, s).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FeatureGroup {
    /// One indicator a family.
    Family,
    /// What the patch edits.
    Edit,
    /// The child's operator graph.
    Graph,
    /// The scene.
    Scene,
    /// The adversaries' interaction with the ego.
    Interaction,
}

/// One number of x(c, s); the unit stands last in the name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeatureColumn {
    /// Name in snapshots and reports.
    pub name: String,
    /// What the column is about.
    pub group: FeatureGroup,
}

/// Names and order of the numbers of x(c, s).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeatureSchema {
    /// One indicator each, in this order.
    pub families: Vec<FamilyName>,
    /// One entry a column, in the order of the values.
    pub columns: Vec<FeatureColumn>,
}

/// A candidate in one scene, as the evaluator sees it before any rollout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldPair {
    /// Id of the scene.
    pub scene: String,
    /// One number a column of the schema.
    pub features: Vec<f64>,
    /// The candidate's family.
    pub family: FamilyName,
    /// The scene's cluster, e.g. its tags joined.
    pub scene_cluster: String,
    /// The candidate's mechanism tags joined.
    pub mechanism_class: String,
}

/// One element (ξ, y) of the calibration set D^W: a pair and its labels from the simulator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldLabel {
    /// The attempt that was evaluated.
    pub attempt: AttemptId,
    /// Its program.
    pub solution: SolutionId,
    /// The epoch in which it was evaluated.
    pub epoch: u32,
    /// ξ: what the prediction rested on.
    pub pair: WorldPair,
    /// A and R of the rollout, each in [0, 1].
    pub labels: Objectives,
    /// Q: rollout diagnostics, 1 = satisfied.
    pub diagnostics: BTreeMap<String, f64>,
    /// The routing decision about the candidate.
    pub decision: RouteDecision,
    /// The prediction for the whole candidate.
    pub predicted: Objectives,
    /// Whether the router would have rejected it without the monitor.
    pub monitored: bool,
}

/// The group whose mean calibrates a prediction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CalibrationGroup {
    /// One group a family.
    Family,
    /// One group a scene cluster.
    SceneCluster,
    /// One group a class of mechanism.
    MechanismClass,
}

/// The configuration φ of the evaluator. It comes from the experiment file, later from the world agent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldConfiguration {
    /// Columns left out of the regression, by name.
    pub excluded_columns: Vec<String>,
    /// λ of the ridge on standardised columns, > 0.
    pub ridge_lambda: f64,
    /// β_A and β_R: weight of the raw prediction against the group's mean, in [0, 1] (eq. app-world-calibration).
    pub beta_attack: f64,
    /// β_R: the same weight for realism.
    pub beta_realism: f64,
    /// How labels are grouped for calibration.
    pub calibration_group: CalibrationGroup,
    /// A group with fewer labels is sparse: its mean is not used, the global one is.
    pub group_labels_min: u32,
    /// Lower bound of the residual standard deviation, 1, > 0.
    pub residual_floor: f64,
    /// Share of the residual variance that adds to the variance of the mean: 1 = uncertainty of a single rollout, 0 =
    /// of the expectation.
    pub residual_share: f64,
    /// Quantile over scenes that is a candidate's uncertainty, in [0.5, 1]; 1 = maximum.
    pub uncertainty_quantile: f64,
    /// Thresholds and shares of routing.
    pub routing: RoutingOptions,
}

/// Thresholds and monitoring of the router (eq. method-routing).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoutingOptions {
    /// λ_A: least predicted attack to be promising, 1.
    pub lambda_a: f64,
    /// λ_R: least predicted realism to be promising, 1.
    pub lambda_r: f64,
    /// λ_U: largest uncertainty to be certain, 1.
    pub lambda_u: f64,
    /// Share of would-be rejections that are simulated all the same, in [0, 1].
    pub audit_rate: f64,
    /// With fewer labelled pairs nothing is rejected.
    pub min_labels: u32,
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
    /// One a used column; empty where only the mean could be fitted.
    pub weights: Vec<f64>,
    /// Residual standard deviation, at least the configured floor.
    pub residual_std: f64,
}

/// What was fitted from the labels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldFit {
    /// Number of labels behind the fit.
    pub labels: u32,
    /// Places of the used columns in the schema.
    pub columns: Vec<usize>,
    /// Mean and standard deviation of each used column; a column that never varied has 0 and has no effect. `[columns]`
    pub column_mean: Vec<f64>,
    /// Standard deviation of each column. `[columns]`
    pub column_std: Vec<f64>,
    /// Lower Cholesky factor of X'X + λI, row by row; empty where only the means could be fitted.
    pub factor: Vec<f64>,
    /// The line that predicts attack.
    pub attack: RidgeLine,
    /// The line that predicts realism.
    pub realism: RidgeLine,
    /// Why only means were fitted, if so.
    pub fallback: Option<String>,
    /// Mean over all labels.
    pub global: GroupMean,
    /// Mean of each calibration group.
    pub groups: BTreeMap<String, GroupMean>,
}

/// W_φ as of an epoch's barrier; immutable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldSnapshot {
    /// What the columns of a pair's features are.
    pub schema: FeatureSchema,
    /// What may be evolved in the evaluator.
    pub configuration: WorldConfiguration,
    /// `None` before the first label.
    pub fit: Option<WorldFit>,
}

impl WorldSnapshot {
    /// The name by which routes cite it.
    pub fn digest(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/world-snapshot/1", self)
    }
}
