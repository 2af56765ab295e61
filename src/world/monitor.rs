//! The quality of the world evaluator, measured by its audits.

use serde::Serialize;
use std::collections::BTreeMap;

use super::calibration::CalibrationSet;
use crate::kernel::num;
use crate::objects::{AttemptId, Objectives, RoutingOptions, WorldLabel};

/// Errors of the candidate-level predictions, and false rejections. A value is `None` if there is nothing to measure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MonitorReport {
    /// Labelled candidates.
    pub candidates: u32,
    /// Mean absolute error of the predictions made before their rollouts.
    pub attack_error_mean: Option<f64>,
    /// Mean absolute error of predicted realism.
    pub realism_error_mean: Option<f64>,
    /// Would-be rejections that the monitor had simulated.
    pub monitored: u32,
    /// Those of them that were promising after all: A >= λ_A and R >= λ_R by their labels.
    pub false_rejections: u32,
    /// Share of monitored rejections whose rollouts would have been promising.
    pub false_rejection_rate: Option<f64>,
}

/// Compares predictions with simulator labels, one candidate for each attempt.
pub fn monitor(set: &CalibrationSet, options: &RoutingOptions) -> MonitorReport {
    let mut attempts: BTreeMap<&AttemptId, Vec<&WorldLabel>> = BTreeMap::new();
    for label in set.labels() {
        attempts.entry(&label.attempt).or_default().push(label);
    }
    let (mut attack, mut realism) = (Vec::new(), Vec::new());
    let (mut monitored, mut false_rejections) = (0, 0);
    for labels in attempts.values() {
        let Some(first) = labels.first() else { continue };
        let truth = mean(labels);
        attack.push((first.predicted.attack - truth.attack).abs());
        realism.push((first.predicted.realism - truth.realism).abs());
        if first.monitored {
            monitored += 1;
            false_rejections += u32::from(truth.attack >= options.lambda_a && truth.realism >= options.lambda_r);
        }
    }
    MonitorReport {
        candidates: attempts.len() as u32,
        attack_error_mean: num::mean(&attack),
        realism_error_mean: num::mean(&realism),
        monitored,
        false_rejections,
        false_rejection_rate: (monitored > 0).then(|| f64::from(false_rejections) / f64::from(monitored)),
    }
}

fn mean(labels: &[&WorldLabel]) -> Objectives {
    let n = labels.len().max(1) as f64;
    Objectives {
        attack: num::sum(labels.iter().map(|label| label.labels.attack)) / n,
        realism: num::sum(labels.iter().map(|label| label.labels.realism)) / n,
    }
}
