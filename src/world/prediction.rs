//! What a fit says of a candidate.

use super::{boosted, ridge, table::standardised};
use crate::objects::{CalibrationGroup, Objectives, Regression, WorldConfiguration, WorldFit, WorldRow};

/// Least share of open scenes that a row is scaled by.
pub const OPEN_SHARE_MIN: f64 = 0.05;

/// The difference from the parent: mixed from the regression and the group's mean, over the scenes that are open.
pub fn difference(configuration: &WorldConfiguration, fit: &WorldFit, row: &WorldRow) -> Objectives {
    if row.open_share <= 0.0 {
        return Objectives { attack: 0.0, realism: 0.0 };
    }
    let group = fit.groups.get(group_key(row, configuration.calibration_group));
    let mean = group.filter(|group| group.labels >= configuration.group_labels_min).unwrap_or(&fit.global).mean;
    let values = standardised(&row.features, &fit.columns, &fit.column_mean, &fit.column_std);
    let raw = |regression: &Regression| row.open_share * value_at(regression, &values);
    let mixed = |beta: f64, raw: f64, mean: f64| {
        let mixed = beta * raw + (1.0 - beta) * mean;
        if mixed.is_finite() { mixed.clamp(-1.0, 1.0) } else { 0.0 }
    };
    Objectives {
        attack: mixed(configuration.beta_attack, raw(&fit.attack), mean.attack),
        realism: mixed(configuration.beta_realism, raw(&fit.realism), mean.realism),
    }
}

fn value_at(regression: &Regression, row: &[f64]) -> f64 {
    match regression {
        Regression::Ridge(line) => ridge::value_at(line, row),
        Regression::Boosted(model) => boosted::value_at(model, row),
    }
}

/// How far the label of a candidate may lie from its prediction, in units of one that is open everywhere.
pub fn spread(row: &WorldRow) -> f64 {
    if row.open_share > 0.0 { row.open_share.max(OPEN_SHARE_MIN).sqrt() } else { 0.0 }
}

/// Which group's mean calibrates a row.
pub fn group_key(row: &WorldRow, group: CalibrationGroup) -> &str {
    match group {
        CalibrationGroup::Family => row.family.as_str(),
        CalibrationGroup::MechanismClass => &row.mechanism_class,
    }
}
