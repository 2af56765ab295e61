//! The calibration set D^W and the fit for an epoch, which rests on the labels of earlier epochs alone.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{
    configuration::{ConfigurationError, validate},
    groups::{group_key, group_means_of},
    pairs,
    prediction::{OPEN_SHARE_MIN, difference, spread},
    ridge, slope,
};
use crate::kernel::Threads;
use crate::objects::{
    CalibrationGroup, FeatureSchema, GroupMean, Objectives, Regression, RidgeLine, WorldConfiguration, WorldFit,
    WorldLabel, WorldModel, WorldSnapshot,
};
use crate::statistics::boosted;
use crate::statistics::table::{Table, moments, standardised};

/// Parts into which labels are cut to predict each from the others.
const FOLDS: usize = 5;
/// Errors that an interval rests on at least.
const ERRORS_MIN: usize = 20;

/// Simulator labels in order of arrival. Grows only; labels are never changed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationSet {
    labels: Vec<WorldLabel>,
}

/// A label that cannot be used. No label of its batch was added.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LabelError {
    /// A label cannot be learned from.
    #[error("label of {attempt}: {problem}; failures are not labels and must stay out")]
    Unusable {
        /// The attempt that it came from.
        attempt: String,
        /// Fault of its label.
        problem: String,
    },
}

impl CalibrationSet {
    /// D^W_{t+1} = D^W_t ∪ the labels of selected and audited candidates. Adds all of them or none.
    pub fn append(&mut self, labels: Vec<WorldLabel>, schema: &FeatureSchema) -> Result<(), LabelError> {
        for label in &labels {
            if let Some(problem) = problem(label, schema) {
                return Err(LabelError::Unusable { attempt: label.attempt.to_string(), problem });
            }
        }
        self.labels.extend(labels);
        Ok(())
    }

    /// All labels, in the order in which they were added.
    pub fn labels(&self) -> &[WorldLabel] {
        &self.labels
    }

    /// The same by epoch and within it by the names of lineages, whatever the order in which these were settled; a lineage's slots
    /// stay in theirs.
    pub fn by_lineage(&self) -> Vec<&WorldLabel> {
        let mut labels: Vec<&WorldLabel> = self.labels.iter().collect();
        labels.sort_by(|a, b| (a.epoch, a.attempt.lineage()).cmp(&(b.epoch, b.attempt.lineage())));
        labels
    }
}

fn problem(label: &WorldLabel, schema: &FeatureSchema) -> Option<String> {
    let rate = |value: f64| (0.0..=1.0).contains(&value);
    let (row, labels) = (&label.row, &label.labels);
    if row.features.len() != schema.columns.len() {
        return Some(format!("{} features, {} columns", row.features.len(), schema.columns.len()));
    }
    if let Some(place) = row.features.iter().position(|value| !value.is_finite()) {
        return Some(format!("feature {} is not finite", schema.columns[place].name));
    }
    let widths = label.row.pairs.iter().map(|pair| pair.features.len());
    if label.pairs.len() != row.pairs.len() || widths.clone().any(|width| width != schema.columns.len()) {
        let widths = widths.max().unwrap_or(0);
        return Some(format!(
            "{} pairs of up to {widths} features, {} labels of pairs",
            row.pairs.len(),
            label.pairs.len()
        ));
    }
    if ![labels.attack, labels.realism, row.parent.attack, row.parent.realism].into_iter().all(rate) {
        return Some(format!("labels {labels:?} and the parent's {:?} are not all rates", row.parent));
    }
    (!rate(row.open_share)).then(|| format!("the share of open scenes is {}, not between 0 and 1", row.open_share))
}

/// The snapshot with which an epoch routes: fitted to the labels of earlier epochs and to nothing else, whatever the list
/// holds. The same labels in the same order give the same bits: sums run, and folds are dealt, in their order.
pub fn settle(
    schema: &FeatureSchema,
    configuration: &WorldConfiguration,
    labels: &[&WorldLabel],
    epoch: u32,
    threads: &Threads,
) -> Result<WorldSnapshot, ConfigurationError> {
    validate(configuration, schema)?;
    let earlier: Vec<&WorldLabel> = labels.iter().copied().filter(|label| label.epoch < epoch).collect();
    Ok(snapshot(schema, configuration, &earlier, threads))
}

/// A configuration with its fit to these labels. The fits of the folds and of the whole do not wait for each other.
pub fn snapshot(
    schema: &FeatureSchema,
    configuration: &WorldConfiguration,
    labels: &[&WorldLabel],
    threads: &Threads,
) -> WorldSnapshot {
    let folds: Vec<Option<usize>> = (0..FOLDS).map(Some).chain([None]).collect();
    let mut made = threads.map(&folds, |_, fold| match fold {
        Some(fold) => Made::Errors(errors_of(schema, configuration, labels, *fold)),
        None => Made::Whole(fitted(schema, configuration, labels).map(Box::new)),
    });
    let whole = made.pop();
    let errors = made.into_iter().map(|made| if let Made::Errors(errors) = made { errors } else { None });
    let half_width = errors.collect::<Option<Vec<_>>>().and_then(|folds| half_width(configuration, &folds.concat()));
    let fit = match whole {
        Some(Made::Whole(fit)) => fit.map(|fit| WorldFit { half_width, ..*fit }),
        _ => None,
    };
    WorldSnapshot { schema: schema.clone(), configuration: configuration.clone(), fit }
}

/// Result of one of the fits, by its purpose.
enum Made {
    /// Errors of a fold that a fit to the others makes.
    Errors(Option<Vec<Objectives>>),
    /// The fit to all labels.
    Whole(Option<Box<WorldFit>>),
}

/// The fit without its intervals.
fn fitted(schema: &FeatureSchema, configuration: &WorldConfiguration, labels: &[&WorldLabel]) -> Option<WorldFit> {
    if configuration.pairs.is_some() {
        return pairs::fitted(schema, configuration, labels);
    }
    let global = group_mean(labels)?;
    let simulated = slope::places(schema).filter(|_| configuration.model == WorldModel::Simulator);
    let is_used = |name: &String| simulated.is_none() && !configuration.excluded_columns.contains(name);
    let used = |(place, name): (usize, &String)| is_used(name).then_some(place);
    let columns: Vec<usize> = schema.columns.iter().map(|column| &column.name).enumerate().filter_map(used).collect();
    // A candidate that does what its parent does has no difference to learn from.
    let open: Vec<&WorldLabel> = labels.iter().copied().filter(|label| label.row.open_share > 0.0).collect();
    let raw: Vec<&[f64]> = open.iter().map(|label| label.row.features.as_slice()).collect();
    let (column_mean, column_std): (Vec<f64>, Vec<f64>) = columns.iter().map(|&place| moments(&raw, place)).unzip();
    let rows = raw.iter().map(|row| standardised(row, &columns, &column_mean, &column_std)).collect();
    let shares: Vec<f64> = open.iter().map(|label| label.row.open_share.max(OPEN_SHARE_MIN)).collect();
    let table = Table { rows, weights: shares.clone(), columns: columns.len() };
    let target = |of: fn(&Objectives) -> f64| -> Vec<f64> {
        open.iter().zip(&shares).map(|(label, share)| of(&label.difference()) / share).collect()
    };
    let (attack, realism) = (target(|o| o.attack), target(|o| o.realism));
    let line = |column, target: &[f64]| slope::fit(&raw, &shares, target, column, configuration.ridge_lambda);
    let (regressions, fallback) = match simulated {
        Some([first, second]) => ([line(first, &attack), line(second, &realism)], None),
        None => regressions(&table, [&attack, &realism], configuration),
    };
    let [attack, realism] = regressions;
    let groups = group_means(labels, configuration.calibration_group);
    Some(WorldFit {
        labels: labels.len() as u32,
        columns,
        column_mean,
        column_std,
        attack,
        realism,
        fallback,
        global,
        groups,
        half_width: None,
        pairs: None,
    })
}

/// Fits the regressions of attack and realism, and says why these are the mean alone, if so.
fn regressions(
    table: &Table,
    targets: [&[f64]; 2],
    configuration: &WorldConfiguration,
) -> ([Regression; 2], Option<String>) {
    let mean = |target: &[f64]| Regression::Ridge(RidgeLine { intercept: table.mean(target), weights: Vec::new() });
    match configuration.model {
        WorldModel::Boosted => {
            let fit = |target: &[f64]| boosted::fit(table, target, configuration.trees, configuration.learning_rate);
            (targets.map(|target| Regression::Boosted(fit(target))), None)
        }
        // Without columns of a simulator there is nothing to scale; no configuration asks for that.
        WorldModel::Simulator => (targets.map(mean), Some("the schema has no columns of a simulator".into())),
        WorldModel::Ridge => match ridge::fit(table, &targets, configuration.ridge_lambda) {
            Ok(lines) => {
                let mut lines = lines.into_iter().map(Regression::Ridge);
                match (lines.next(), lines.next()) {
                    (Some(attack), Some(realism)) => ([attack, realism], None),
                    _ => (targets.map(mean), Some("there is nothing to fit".into())),
                }
            }
            Err(reason) => (targets.map(mean), Some(reason)),
        },
    }
}

/// Conformal prediction over candidates by cross-fitting (Vovk; Barber et al.): every candidate is predicted by a fit to those of
/// the other folds. Errors are scaled by the root of the open share: scenes err on their own, and closed ones not at all.
fn errors_of(
    schema: &FeatureSchema,
    configuration: &WorldConfiguration,
    labels: &[&WorldLabel],
    fold: usize,
) -> Option<Vec<Objectives>> {
    let is_held = |place: usize| place % FOLDS == fold;
    let parted = |held: bool| labels.iter().enumerate().filter(move |(place, _)| is_held(*place) == held);
    let others: Vec<&WorldLabel> = parted(false).map(|(_, label)| *label).collect();
    let fit = fitted(schema, configuration, &others)?;
    let open = parted(true).filter(|(_, label)| label.row.open_share > 0.0 || configuration.pairs.is_some());
    let error = |(_, label): (usize, &&WorldLabel)| {
        let error = label.difference().less(&difference(configuration, schema, Some(&fit), &label.row));
        error.times(1.0 / spread(&label.row))
    };
    Some(open.map(error).collect())
}

/// The half width is the quantile of |label - prediction| at the level, corrected for the number of errors.
fn half_width(configuration: &WorldConfiguration, errors: &[Objectives]) -> Option<Objectives> {
    let quantile = |of: fn(&Objectives) -> f64| {
        let mut sizes: Vec<f64> = errors.iter().map(|error| of(error).abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let place = ((sizes.len() + 1) as f64 * configuration.interval_level).ceil() as usize;
        (sizes.len() >= ERRORS_MIN).then(|| sizes.get(place.saturating_sub(1)).or(sizes.last()).copied()).flatten()
    };
    Some(Objectives { attack: quantile(|o| o.attack)?, realism: quantile(|o| o.realism)? })
}

fn group_means(labels: &[&WorldLabel], group: CalibrationGroup) -> BTreeMap<String, GroupMean> {
    group_means_of(labels, |label| group_key(&label.row, group).to_string(), WorldLabel::difference)
}

/// Mean difference from the parent; `None` without a label.
fn group_mean(labels: &[&WorldLabel]) -> Option<GroupMean> {
    group_means_of(labels, |_| String::new(), WorldLabel::difference).remove("")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::WorldModel;

    #[test]
    fn a_half_width_is_the_quantile_of_the_errors_as_if_one_more_were_there() {
        let configuration = super::super::tests::configuration(WorldModel::Ridge);
        let errors = |count: u32| -> Vec<Objectives> {
            let one = |k: u32| Objectives { attack: -f64::from((7 * k) % count + 1), realism: f64::from(k + 1) };
            (0..count).map(one).collect()
        };
        // 0.8 of 21 is 16.8: the 17th of twenty.
        let found = half_width(&configuration, &errors(20)).unwrap();
        assert_eq!((found.attack, found.realism), (17.0, 17.0));
        assert_eq!(half_width(&configuration, &errors(19)), None, "too few errors to say");
        let sure = WorldConfiguration { interval_level: 0.99, ..configuration };
        assert_eq!(
            half_width(&sure, &errors(20)).unwrap().attack,
            20.0,
            "the largest, where there are too few for the level"
        );
    }
}
