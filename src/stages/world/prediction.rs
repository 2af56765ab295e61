//! Prediction of a candidate by a fit.

use super::{groups::group_key, pairs, ridge, slope};
use crate::objects::{FeatureSchema, Objectives, Regression, WorldConfiguration, WorldFit, WorldModel, WorldRow};
use crate::statistics::{boosted, table::standardised};

/// Least share of open scenes that a row is scaled by.
pub const OPEN_SHARE_MIN: f64 = 0.05;

/// The difference from the parent: mixed from the regression and the group's mean, over the scenes that are open. What our own
/// simulator shows is not mixed: its slope is its calibration. Before the first label it stands as it is, and everything else
/// predicts nothing.
pub fn difference(
    configuration: &WorldConfiguration,
    schema: &FeatureSchema,
    fit: Option<&WorldFit>,
    row: &WorldRow,
) -> Objectives {
    if let Some(options) = &configuration.pairs {
        return pairs::expected(configuration, options, fit, row).difference;
    }
    let nothing = Objectives { attack: 0.0, realism: 0.0 };
    if row.open_share <= 0.0 {
        return nothing;
    }
    let Some(fit) = fit else {
        let shown = slope::uncorrected(schema, row).filter(|_| configuration.model == WorldModel::Simulator);
        return shown.unwrap_or(nothing);
    };
    let group = fit.groups.get(group_key(row, configuration.calibration_group));
    let mean = group.filter(|group| group.labels >= configuration.group_labels_min).unwrap_or(&fit.global).mean;
    let values = standardised(&row.features, &fit.columns, &fit.column_mean, &fit.column_std);
    let mixed = |beta: f64, regression: &Regression, mean: f64| {
        let beside_mean = |value: f64| beta * (row.open_share * value) + (1.0 - beta) * mean;
        let difference = match regression {
            Regression::Ridge(line) => beside_mean(ridge::value_at(line, &values)),
            Regression::Boosted(model) => beside_mean(boosted::value_at(model, &values)),
            Regression::Simulated(line) => slope::value_at(line, row),
        };
        if difference.is_finite() { difference.clamp(-1.0, 1.0) } else { 0.0 }
    };
    Objectives {
        attack: mixed(configuration.beta_attack, &fit.attack, mean.attack),
        realism: mixed(configuration.beta_realism, &fit.realism, mean.realism),
    }
}

/// How far the label of a candidate may lie from its prediction, in units of one that is open everywhere; an evaluator of pairs knows
/// nothing of scenes that are not open.
pub fn spread(row: &WorldRow) -> f64 {
    if !row.pairs.is_empty() {
        return 1.0;
    }
    if row.open_share > 0.0 { row.open_share.max(OPEN_SHARE_MIN).sqrt() } else { 0.0 }
}
