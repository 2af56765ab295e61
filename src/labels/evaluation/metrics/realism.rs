//! r_MD(τ) = Σ w_j d_j(τ): the weighted sum of feasibility diagnostics (paper eq. app-metadrive-realism-score).
//! The paper names the diagnostics, not their weights and tolerances: weights come from the experiment file, tolerances
//! from a calibration on recorded traffic that the file names.

use serde::{Deserialize, Serialize, Serializer, ser::SerializeMap};
use std::collections::BTreeMap;

use super::diagnostic::{Counts, Diagnostic};
use super::limits::{Calibration, Limits};
use super::{
    acceleration, collision_validity, continuity, initial_overlap, jerk, map, parked, place_of_kind, rolling,
    route_completion, slip, speed_of_kind, wrong_way,
};
use crate::kernel::num;
use crate::objects::{RealismMean, is_unsaid, is_yes, yes};
use crate::sim::{AdversaryReport, Outcome};

/// Every diagnostic, in the order in which weights are written.
pub const DIAGNOSTICS: [&Diagnostic; 13] = [
    &map::ROW,
    &wrong_way::ROW,
    &route_completion::ROW,
    &initial_overlap::ROW,
    &collision_validity::ROW,
    &parked::ROW,
    &continuity::ROW,
    &acceleration::ROW,
    &jerk::ROW,
    &slip::ROW,
    &rolling::ROW,
    &speed_of_kind::ROW,
    &place_of_kind::ROW,
];

/// w_j by name, shares of one.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "BTreeMap<String, f64>")]
pub struct Weights(BTreeMap<String, f64>);

impl TryFrom<BTreeMap<String, f64>> for Weights {
    type Error = String;

    fn try_from(weights: BTreeMap<String, f64>) -> Result<Weights, String> {
        let missing = |of: &&&Diagnostic| of.counts == Counts::Always && !weights.contains_key(of.name());
        if let Some(of) = DIAGNOSTICS.iter().find(missing) {
            return Err(format!("missing field `{}`", of.name()));
        }
        match weights.keys().find(|name| DIAGNOSTICS.iter().all(|of| of.name() != *name)) {
            Some(name) => Err(format!("unknown field `{name}`")),
            None => Ok(Weights(weights)),
        }
    }
}

impl Serialize for Weights {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (of, weight) in DIAGNOSTICS.iter().filter_map(|of| Some((of, self.0.get(of.name())?))) {
            // Digests tell an option from a number, and these were options when the first experiments had them.
            if of.counts == Counts::Always {
                map.serialize_entry(of.name(), weight)?;
            } else {
                map.serialize_entry(of.name(), &Some(weight))?;
            }
        }
        map.end()
    }
}

/// Options of the realism score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RealismOptions {
    /// Share of each diagnostic in the score.
    pub weights: Weights,
    /// In a file: the table itself, `evodrive:recorded`, or the path of a file that `evodrive calibrate` wrote.
    pub calibration: Box<Calibration>,
    /// Mean that gives R(c).
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub mean: RealismMean,
    /// True if an adversary is excused as far as its own recording is poor. The paper has no such rule.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub excuses_recordings: bool,
}

/// Options that define no score.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("evaluation.realism.{place} is {found}, expected {expected}")]
pub struct OptionsError {
    /// The key below `[evaluation.realism]`.
    pub place: String,
    /// Its value.
    pub found: String,
    /// Values that it may have.
    pub expected: &'static str,
}

impl RealismOptions {
    /// The diagnostics that count with their w_j, in name order.
    pub fn diagnostics(&self) -> impl Iterator<Item = (&'static Diagnostic, f64)> {
        let row = |name: &String| DIAGNOSTICS.into_iter().find(|of| of.name() == name);
        self.weights.0.iter().filter_map(move |(name, weight)| Some((row(name)?, *weight)))
    }

    /// w_j with their names, in name order.
    pub fn weights(&self) -> Vec<(&'static str, f64)> {
        self.diagnostics().map(|(of, weight)| (of.name(), weight)).collect()
    }

    /// Returns the names of the diagnostics that count in this way.
    pub fn counting(&self, counts: Counts) -> Vec<&'static str> {
        self.diagnostics().filter(|(of, _)| of.counts == counts).map(|(of, _)| of.name()).collect()
    }

    /// Weights must be shares of one, tolerances positive, bounds no less than zero.
    pub fn check(&self) -> Result<(), OptionsError> {
        let wrong = |place: String, found: String, expected| Err(OptionsError { place, found, expected });
        for (name, weight) in self.weights() {
            if !(0.0..=1.0).contains(&weight) {
                return wrong(format!("weights.{name}"), weight.to_string(), "a share from 0 to 1");
            }
        }
        for (kind, limits) in self.calibration.by_kind() {
            for (name, limit) in limits.by_name() {
                let place = format!("calibration.{kind}.{name}");
                if !(limit.tolerance.is_finite() && limit.tolerance > 0.0) {
                    return wrong(format!("{place}.tolerance"), limit.tolerance.to_string(), "a positive number");
                }
                if !(limit.bound.is_finite() && limit.bound >= 0.0) {
                    return wrong(format!("{place}.bound"), limit.bound.to_string(), "a number not below 0");
                }
            }
        }
        for quantity in self.diagnostics().flat_map(|(of, _)| of.quantities()) {
            let unbounded = |(_, limits): &(&str, &Limits)| (quantity.limit)(limits).is_none();
            if let Some((kind, _)) = self.calibration.by_kind().into_iter().find(unbounded) {
                let expected =
                    "a bound and a tolerance; name evodrive:kinds, or a file of `evodrive calibrate --of-kind`";
                return wrong(format!("calibration.{kind}.{}", quantity.name), "missing".into(), expected);
            }
        }
        let total = num::sum(self.weights().into_iter().map(|(_, weight)| weight));
        if (total - 1.0).abs() < 1e-9 { Ok(()) } else { wrong("weights (their sum)".into(), total.to_string(), "1") }
    }
}

/// d_j of a rollout by name, and r_MD(τ) in [0, 1]. Of each diagnostic it is the worst adversary's, so that a second
/// attacker cannot hide a first. A rollout without adversaries changed nothing that could be unrealistic: every
/// diagnostic is 1, and the scene counts as not acted in.
pub fn realism(outcome: &Outcome, options: &RealismOptions) -> (BTreeMap<String, f64>, f64) {
    realism_of(&outcome.adversaries, options)
}

/// Does the same for some reports.
pub fn realism_of(reports: &[AdversaryReport], options: &RealismOptions) -> (BTreeMap<String, f64>, f64) {
    let diagnostics: Vec<_> = options.diagnostics().collect();
    let mut worst = vec![1.0f64; diagnostics.len()];
    for report in reports {
        let bare = (!options.excuses_recordings).then(|| report.without_recording());
        let report = bare.as_ref().unwrap_or(report);
        let limits = options.calibration.of(report.kind);
        let of_report = diagnostics.iter().map(|(of, _)| of.value(report, limits));
        worst.iter_mut().zip(of_report).for_each(|(so_far, value)| *so_far = so_far.min(value));
    }
    let missing = num::sum(diagnostics.iter().zip(&worst).map(|((_, weight), d)| weight * (1.0 - d)));
    let named = diagnostics.iter().zip(worst).map(|((of, _), d)| (of.name().to_string(), d)).collect();
    // The last bit of rounding is clamped away.
    (named, (1.0 - missing).clamp(0.0, 1.0))
}
