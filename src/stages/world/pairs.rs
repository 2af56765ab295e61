//! The evaluator of pairs: a ridge line over x(c, s), its uncertainty in every scene, and what both come to for a candidate (paper,
//! section World-Conditioned Candidate Routing and appendix World Evaluator).
//!
//! Û(c, s) is the standard error of the line at the pair, σ √(1/n + xᵀ(XᵀX + λI)⁻¹x): small among pairs like many labelled ones, large
//! where nothing like it was. The paper leaves open what it is.

use std::collections::BTreeMap;

use super::groups::{group_key, group_means_of};
use super::pair_features::missed_keys;
use super::{ridge, ridge::Sure};
use crate::kernel::num;
use crate::objects::{
    FeatureSchema, GroupMean, Objectives, PairFit, PairOptions, PairRow, Regression, RidgeLine, WorldConfiguration,
    WorldFit, WorldLabel, WorldRow,
};
use crate::statistics::table::{Table, moments, standardised};

/// Expectation of a candidate over the scenes of its window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Expected {
    /// F̂(c) less the parent's labels of the same scenes; nothing where the evaluator abstains.
    pub difference: Objectives,
    /// Û(c), 1 where nothing is known.
    pub uncertainty: f64,
    /// True if the candidate's group has too few labels to calibrate by.
    pub sparse: bool,
}

/// The fit without its intervals; `None` without a labelled pair.
pub(super) fn fitted(
    schema: &FeatureSchema,
    configuration: &WorldConfiguration,
    labels: &[&WorldLabel],
) -> Option<WorldFit> {
    let known = |label: &&&WorldLabel| label.pairs.iter().any(Option::is_some);
    let known: Vec<&WorldLabel> = labels.iter().filter(known).copied().collect();
    let mut pairs: Vec<(&[f64], Objectives)> = Vec::new();
    for label in &known {
        let of = label.row.pairs.iter().zip(&label.pairs);
        pairs.extend(of.filter_map(|(pair, label)| Some((pair.features.as_slice(), (*label)?))));
    }
    let columns: Vec<usize> = (0..schema.columns.len())
        .filter(|&place| !configuration.excluded_columns.contains(&schema.columns[place].name))
        .collect();
    let raw: Vec<&[f64]> = pairs.iter().map(|(features, _)| *features).collect();
    let (column_mean, column_std): (Vec<f64>, Vec<f64>) = columns.iter().map(|&place| moments(&raw, place)).unzip();
    let rows = raw.iter().map(|row| standardised(row, &columns, &column_mean, &column_std)).collect();
    let table = Table { rows, weights: vec![1.0; pairs.len()], columns: columns.len() };
    let (attack, realism): (Vec<f64>, Vec<f64>) = pairs.iter().map(|(_, of)| (of.attack, of.realism)).unzip();
    let targets = [attack.as_slice(), realism.as_slice()];
    let (Sure { lines, inverse }, fallback) = match ridge::fit_sure(&table, &targets, configuration.ridge_lambda) {
        Ok(sure) => (sure, None),
        Err(reason) => {
            let mean = |target: &&[f64]| RidgeLine { intercept: table.mean(target), weights: Vec::new() };
            (Sure { lines: targets.iter().map(mean).collect(), inverse: Vec::new() }, Some(reason))
        }
    };
    let [attack, realism]: [RidgeLine; 2] = lines.try_into().ok()?;
    let sigma =
        Objectives { attack: residual(&table, targets[0], &attack), realism: residual(&table, targets[1], &realism) };
    let of_label = |label: &WorldLabel| label.labels;
    let groups =
        group_means_of(&known, |label| group_key(&label.row, configuration.calibration_group).to_string(), of_label);
    let global = group_means_of(&known, |_| String::new(), of_label).remove("")?;
    let missed = missed(&known);
    let pairs = PairFit { pairs: u32::try_from(pairs.len()).unwrap_or(u32::MAX), inverse, sigma, missed };
    Some(WorldFit {
        labels: known.len() as u32,
        columns,
        column_mean,
        column_std,
        attack: Regression::Ridge(attack),
        realism: Regression::Ridge(realism),
        fallback,
        global,
        groups,
        half_width: None,
        pairs: Some(pairs),
    })
}

fn residual(table: &Table, target: &[f64], line: &RidgeLine) -> f64 {
    let square = |(row, label): (&Vec<f64>, &f64)| {
        let error = label - ridge::value_at(line, row);
        error * error
    };
    (num::sum(table.rows.iter().zip(target).map(square)) / target.len().max(1) as f64).sqrt()
}

/// Returns the mean miss of recorded predictions, by family and by mechanism class.
fn missed(labels: &[&WorldLabel]) -> BTreeMap<String, GroupMean> {
    let key =
        |k: usize| move |label: &WorldLabel| missed_keys(&label.row.family, &label.row.mechanism_class)[k].clone();
    let error = |label: &WorldLabel| label.labels.less(&label.predicted);
    let mut groups = group_means_of(labels, key(0), error);
    groups.extend(group_means_of(labels, key(1), error));
    groups
}

/// W_φ(c): the means of the pairs' calibrated predictions, their uncertainties aggregated.
pub(super) fn expected(
    configuration: &WorldConfiguration,
    options: &PairOptions,
    fit: Option<&WorldFit>,
    row: &WorldRow,
) -> Expected {
    let unknown = Expected { difference: Objectives { attack: 0.0, realism: 0.0 }, uncertainty: 1.0, sparse: true };
    let Some((fit, of_pairs)) = fit.and_then(|fit| Some((fit, fit.pairs.as_ref()?))) else { return unknown };
    let group = fit.groups.get(group_key(row, configuration.calibration_group));
    let group = group.filter(|group| group.labels >= configuration.group_labels_min);
    let mean = group.unwrap_or(&fit.global).mean;
    let of = |pair: &PairRow| -> (Objectives, f64) {
        let values = standardised(&pair.features, &fit.columns, &fit.column_mean, &fit.column_std);
        let mixed = |beta: f64, regression: &Regression, mean: f64| match regression {
            Regression::Ridge(line) => (beta * ridge::value_at(line, &values) + (1.0 - beta) * mean).clamp(0.0, 1.0),
            Regression::Boosted(_) | Regression::Simulated(_) => mean,
        };
        let predicted = Objectives {
            attack: mixed(configuration.beta_attack, &fit.attack, mean.attack),
            realism: mixed(configuration.beta_realism, &fit.realism, mean.realism),
        };
        (predicted.less(&pair.parent), standard_error(of_pairs, &values))
    };
    let all: Vec<(Objectives, f64)> = row.pairs.iter().map(of).collect();
    let over = |read: fn(&Objectives) -> f64| num::mean(&all.iter().map(|(of, _)| read(of)).collect::<Vec<f64>>());
    let (Some(attack), Some(realism)) = (over(|of| of.attack), over(|of| of.realism)) else { return unknown };
    let uncertainty = quantile(all.iter().map(|(_, u)| *u).collect(), options.aggregate);
    let expected = Expected { difference: Objectives { attack, realism }, uncertainty, sparse: group.is_none() };
    if uncertainty > options.abstain_above { Expected { difference: unknown.difference, ..expected } } else { expected }
}

/// Û(c, s): of attack and realism the larger one, at most 1.
fn standard_error(fit: &PairFit, values: &[f64]) -> f64 {
    let p = values.len();
    let leverage = if fit.inverse.len() == p * p {
        num::sum(values.iter().enumerate().map(|(i, x)| {
            x * num::sum(fit.inverse[i * p..(i + 1) * p].iter().zip(values).map(|(inverse, y)| inverse * y))
        }))
    } else {
        1.0
    };
    let sigma = fit.sigma.attack.max(fit.sigma.realism);
    (sigma * (1.0 / f64::from(fit.pairs.max(1)) + leverage.max(0.0)).sqrt()).min(1.0)
}

/// The value below which a share of the list lies, the upper one of two.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let place = (values.len() as f64 * share).ceil() as usize;
    values.get(place.saturating_sub(1)).or(values.last()).copied().unwrap_or(1.0)
}
