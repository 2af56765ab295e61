//! r_MD(τ) = Σ w_j d_j(τ): the weighted sum of feasibility diagnostics (paper eq. app-metadrive-realism-score).
//! The paper names the diagnostics, not their weights and tolerances: weights come from the experiment file, tolerances
//! from a calibration on recorded traffic that the file names.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::limits::{Calibration, Limit, Limits};
use super::{
    acceleration, collision_validity, continuity, initial_overlap, jerk, map, parked, place_of_kind, rolling,
    route_completion, slip, speed_of_kind, wrong_way,
};
use crate::kernel::num;
use crate::objects::{RealismMean, is_unsaid, is_yes, yes};
use crate::sim::{AdversaryReport, Outcome};

/// w_j, shares of one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Weights {
    /// Of leaving the drivable area.
    pub map_validity: f64,
    /// Of driving against lanes.
    pub lane_direction: f64,
    /// Of the recorded way that is not driven.
    pub route_completion: f64,
    /// Of overlapping somebody at the beginning.
    pub initial_non_overlap: f64,
    /// Of touching somebody who moves, the ego aside.
    pub collision_validity: f64,
    /// Of driving through what stands.
    pub parked_obstacles: f64,
    /// Of places that make no one motion.
    pub trajectory_continuity: f64,
    /// Of accelerations beyond those of recorded traffic.
    pub bounded_acceleration: f64,
    /// Of jerks beyond those of recorded traffic.
    pub bounded_jerk: f64,
    /// Of sliding sideways.
    pub bounded_slip: f64,
    /// Of going where wheels do not take it; absent, the diagnostic is not there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rolling: Option<f64>,
    /// Of being faster than its kind; likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_of_kind: Option<f64>,
    /// Of being where its kind does not belong; likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place_of_kind: Option<f64>,
}

/// d_j of one adversary by the limits of its kind.
type Diagnostic = fn(&AdversaryReport, &Limits) -> f64;

/// What realism rests on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RealismOptions {
    /// How much each diagnostic counts.
    pub weights: Weights,
    /// In a file: the table itself, `evodrive:recorded`, or the path of a file that `evodrive calibrate` wrote.
    pub calibration: Box<Calibration>,
    /// What R(c) is a mean of.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub mean: RealismMean,
    /// Whether an adversary is excused as far as its own recording is poor. The paper has no such rule.
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
    /// What it must be.
    pub expected: &'static str,
}

impl RealismOptions {
    /// The diagnostics with their w_j, in name order: ten, and those of kinds and places where they are asked for.
    fn diagnostics(&self) -> impl Iterator<Item = (&'static str, f64, Diagnostic)> {
        let of = &self.weights;
        let all: [(&'static str, Option<f64>, Diagnostic); 13] = [
            (acceleration::NAME, Some(of.bounded_acceleration), acceleration::diagnostic),
            (jerk::NAME, Some(of.bounded_jerk), jerk::diagnostic),
            (slip::NAME, Some(of.bounded_slip), slip::diagnostic),
            (collision_validity::NAME, Some(of.collision_validity), |of, _| collision_validity::diagnostic(of)),
            (initial_overlap::NAME, Some(of.initial_non_overlap), |of, _| initial_overlap::diagnostic(of)),
            (wrong_way::NAME, Some(of.lane_direction), wrong_way::diagnostic),
            (map::NAME, Some(of.map_validity), map::diagnostic),
            (parked::NAME, Some(of.parked_obstacles), |of, _| parked::diagnostic(of)),
            (place_of_kind::NAME, of.place_of_kind, |of, _| place_of_kind::diagnostic(of)),
            (rolling::NAME, of.rolling, rolling::diagnostic),
            (route_completion::NAME, Some(of.route_completion), |of, _| route_completion::diagnostic(of)),
            (speed_of_kind::NAME, of.speed_of_kind, speed_of_kind::diagnostic),
            (continuity::NAME, Some(of.trajectory_continuity), continuity::diagnostic),
        ];
        all.into_iter().filter_map(|(name, weight, diagnostic)| Some((name, weight?, diagnostic)))
    }

    /// w_j with their names, in name order.
    pub fn weights(&self) -> Vec<(&'static str, f64)> {
        self.diagnostics().map(|(name, weight, _)| (name, weight)).collect()
    }

    /// Whether a diagnostic counts that needs `simulator.of_kind`.
    pub fn asks_of_kind(&self) -> bool {
        self.weights.rolling.is_some() || self.weights.speed_of_kind.is_some()
    }

    /// Whether a diagnostic counts that needs `simulator.of_place`.
    pub fn asks_of_place(&self) -> bool {
        self.weights.place_of_kind.is_some()
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
        let unbounded = |limit: fn(&Limits) -> Option<Limit>| {
            self.calibration.by_kind().into_iter().find(|(_, limits)| limit(limits).is_none()).map(|(kind, _)| kind)
        };
        for (weight, name, limit) in [
            (self.weights.rolling, "unrolled_m", (|of| of.unrolled_m) as fn(&Limits) -> Option<Limit>),
            (self.weights.speed_of_kind, "speed_mps", |of| of.speed_mps),
        ] {
            if let (Some(_), Some(kind)) = (weight, unbounded(limit)) {
                let expected =
                    "a bound and a tolerance; name evodrive:kinds, or a file of `evodrive calibrate --of-kind`";
                return wrong(format!("calibration.{kind}.{name}"), "missing".into(), expected);
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

/// The same of some reports.
pub fn realism_of(reports: &[AdversaryReport], options: &RealismOptions) -> (BTreeMap<String, f64>, f64) {
    let diagnostics: Vec<_> = options.diagnostics().collect();
    let mut worst = vec![1.0f64; diagnostics.len()];
    for report in reports {
        let bare = (!options.excuses_recordings).then(|| report.without_recording());
        let report = bare.as_ref().unwrap_or(report);
        let limits = options.calibration.of(report.kind);
        let of_report = diagnostics.iter().map(|(_, _, diagnostic)| diagnostic(report, limits));
        worst.iter_mut().zip(of_report).for_each(|(so_far, value)| *so_far = so_far.min(value));
    }
    let missing = num::sum(diagnostics.iter().zip(&worst).map(|((_, weight, _), d)| weight * (1.0 - d)));
    let named = diagnostics.iter().zip(worst).map(|((name, ..), d)| (name.to_string(), d)).collect();
    // The last bit of rounding is clamped away.
    (named, (1.0 - missing).clamp(0.0, 1.0))
}
