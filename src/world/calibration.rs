//! The calibration set D^W and the refit after an epoch's barrier.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{
    configuration::{ConfigurationError, validate},
    ridge::fit_ridge,
};
use crate::kernel::num;
use crate::objects::{
    CalibrationGroup, FeatureSchema, GroupMean, Objectives, WorldConfiguration, WorldLabel, WorldPair, WorldSnapshot,
};

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
    #[error("label of {attempt} in scene {scene}: {problem}; failures are not labels and must stay out")]
    Unusable {
        /// The attempt that it came from.
        attempt: String,
        /// Id of the scene.
        scene: String,
        /// What is wrong with it.
        problem: String,
    },
}

impl CalibrationSet {
    /// D^W_{t+1} = D^W_t ∪ the labels of selected and audited candidates. Adds all of them or none.
    pub fn append(&mut self, labels: Vec<WorldLabel>, schema: &FeatureSchema) -> Result<(), LabelError> {
        for label in &labels {
            if let Some(problem) = problem(label, schema) {
                let (attempt, scene) = (label.attempt.to_string(), label.pair.scene.clone());
                return Err(LabelError::Unusable { attempt, scene, problem });
            }
        }
        self.labels.extend(labels);
        Ok(())
    }

    /// All labels, in the order in which they were added.
    pub fn labels(&self) -> &[WorldLabel] {
        &self.labels
    }
}

fn problem(label: &WorldLabel, schema: &FeatureSchema) -> Option<String> {
    let rate = |value: f64| (0.0..=1.0).contains(&value);
    if label.pair.features.len() != schema.columns.len() {
        return Some(format!("{} features, {} columns", label.pair.features.len(), schema.columns.len()));
    }
    if let Some(place) = label.pair.features.iter().position(|value| !value.is_finite()) {
        return Some(format!("feature {} is not finite", schema.columns[place].name));
    }
    if !rate(label.labels.attack) || !rate(label.labels.realism) {
        return Some(format!("attack {}, realism {} are no rates", label.labels.attack, label.labels.realism));
    }
    None
}

/// Fits a snapshot to the labels; the same labels give the same bits. Called once an epoch, after its barrier.
pub fn settle(
    schema: &FeatureSchema,
    configuration: &WorldConfiguration,
    set: &CalibrationSet,
) -> Result<WorldSnapshot, ConfigurationError> {
    validate(configuration, schema)?;
    let used = |(place, name): (usize, &String)| (!configuration.excluded_columns.contains(name)).then_some(place);
    let columns = schema.columns.iter().map(|column| &column.name).enumerate().filter_map(used).collect();
    let rows: Vec<&[f64]> = set.labels.iter().map(|label| label.pair.features.as_slice()).collect();
    let labels: Vec<Objectives> = set.labels.iter().map(|label| label.labels).collect();
    let fit = fit_ridge(&rows, &labels, columns, configuration).map(|mut fit| {
        fit.groups = group_means(set, configuration.calibration_group);
        fit
    });
    Ok(WorldSnapshot { schema: schema.clone(), configuration: configuration.clone(), fit })
}

/// Which group's mean calibrates a pair.
pub fn group_key(pair: &WorldPair, group: CalibrationGroup) -> &str {
    match group {
        CalibrationGroup::Family => pair.family.as_str(),
        CalibrationGroup::SceneCluster => &pair.scene_cluster,
        CalibrationGroup::MechanismClass => &pair.mechanism_class,
    }
}

fn group_means(set: &CalibrationSet, group: CalibrationGroup) -> BTreeMap<String, GroupMean> {
    let mut members: BTreeMap<&str, Vec<Objectives>> = BTreeMap::new();
    for label in &set.labels {
        members.entry(group_key(&label.pair, group)).or_default().push(label.labels);
    }
    let mean = |all: &[Objectives]| Objectives {
        attack: num::sum(all.iter().map(|o| o.attack)) / all.len() as f64,
        realism: num::sum(all.iter().map(|o| o.realism)) / all.len() as f64,
    };
    let one = |(key, all): (&str, Vec<Objectives>)| {
        (key.to_string(), GroupMean { labels: all.len() as u32, mean: mean(&all) })
    };
    members.into_iter().map(one).collect()
}
