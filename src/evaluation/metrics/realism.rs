//! r_MD(τ) = Σ w_j d_j(τ): the weighted sum of seven feasibility diagnostics (paper eq. app-metadrive-realism-score).
//! The paper names the diagnostics, not their weights and tolerances: those come from the experiment file.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{acceleration, collision_validity, continuity, initial_overlap, jerk, map, route_progress};
use crate::kernel::num;
use crate::sim::{AdversaryReport, Outcome};

/// How many there are.
const DIAGNOSTICS: usize = 7;

/// Weight and tolerance of a soft diagnostic of one quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Diagnostic {
    /// w_j, 1.
    pub weight: f64,
    /// ρ_j, in the diagnostic's unit; not used by binary ones, which have none.
    pub tolerance: f64,
}

/// Weight, bound and tolerance of a soft diagnostic of an excess.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoundedDiagnostic {
    pub weight: f64,
    /// What is still normal driving, in the diagnostic's unit.
    pub bound: f64,
    /// ρ_j for what lies beyond the bound, same unit.
    pub tolerance: f64,
}

/// Weight of a binary diagnostic.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BinaryDiagnostic {
    pub weight: f64,
}

/// The seven diagnostics. Weights are non-negative and sum to 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RealismOptions {
    /// Tolerance in metres beyond the drivable area.
    pub map_validity: Diagnostic,
    pub initial_non_overlap: BinaryDiagnostic,
    pub collision_validity: BinaryDiagnostic,
    /// Tolerance in metres driven against a lane.
    pub route_progress: Diagnostic,
    /// Tolerance in metres jumped.
    pub trajectory_continuity: Diagnostic,
    /// m/s².
    pub bounded_acceleration: BoundedDiagnostic,
    /// m/s³.
    pub bounded_jerk: BoundedDiagnostic,
}

/// Options that define no score.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("evaluation.realism.{place} is {found}, expected {expected}")]
pub struct OptionsError {
    pub place: String,
    pub found: f64,
    pub expected: &'static str,
}

impl RealismOptions {
    /// w_j with their names, in name order.
    pub fn weights(&self) -> [(&'static str, f64); DIAGNOSTICS] {
        [
            (acceleration::NAME, self.bounded_acceleration.weight),
            (jerk::NAME, self.bounded_jerk.weight),
            (collision_validity::NAME, self.collision_validity.weight),
            (initial_overlap::NAME, self.initial_non_overlap.weight),
            (map::NAME, self.map_validity.weight),
            (route_progress::NAME, self.route_progress.weight),
            (continuity::NAME, self.trajectory_continuity.weight),
        ]
    }

    /// Weights must be shares of one, tolerances positive.
    pub fn check(&self) -> Result<(), OptionsError> {
        let wrong = |place: String, found: f64, expected| Err(OptionsError { place, found, expected });
        for (name, weight) in self.weights() {
            if !(0.0..=1.0).contains(&weight) {
                return wrong(format!("{name}.weight"), weight, "a share from 0 to 1");
            }
        }
        let tolerances = [
            (map::NAME, self.map_validity.tolerance),
            (route_progress::NAME, self.route_progress.tolerance),
            (continuity::NAME, self.trajectory_continuity.tolerance),
            (acceleration::NAME, self.bounded_acceleration.tolerance),
            (jerk::NAME, self.bounded_jerk.tolerance),
        ];
        for (name, tolerance) in tolerances {
            if !(tolerance.is_finite() && tolerance > 0.0) {
                return wrong(format!("{name}.tolerance"), tolerance, "a positive number");
            }
        }
        for (name, options) in [(acceleration::NAME, self.bounded_acceleration), (jerk::NAME, self.bounded_jerk)] {
            if !(options.bound.is_finite() && options.bound >= 0.0) {
                return wrong(format!("{name}.bound"), options.bound, "a number not below 0");
            }
        }
        let total = num::sum(self.weights().into_iter().map(|(_, weight)| weight));
        match (total - 1.0).abs() < 1e-9 {
            true => Ok(()),
            false => wrong("weights (their sum)".into(), total, "1"),
        }
    }

    /// d_j of one adversary, in name order.
    fn of_adversary(&self, report: &AdversaryReport) -> [f64; DIAGNOSTICS] {
        [
            acceleration::diagnostic(report, &self.bounded_acceleration),
            jerk::diagnostic(report, &self.bounded_jerk),
            collision_validity::diagnostic(report),
            initial_overlap::diagnostic(report),
            map::diagnostic(report, self.map_validity.tolerance),
            route_progress::diagnostic(report, self.route_progress.tolerance),
            continuity::diagnostic(report, self.trajectory_continuity.tolerance),
        ]
    }
}

/// d_j of a rollout by name, and r_MD(τ) in [0, 1]. Of each diagnostic it is the worst adversary's, so that a second
/// attacker cannot hide a first. A rollout without adversaries changed nothing that could be unrealistic: every
/// diagnostic is 1.
pub fn realism(outcome: &Outcome, options: &RealismOptions) -> (BTreeMap<String, f64>, f64) {
    let mut worst = [1.0f64; DIAGNOSTICS];
    for report in &outcome.adversaries {
        worst.iter_mut().zip(options.of_adversary(report)).for_each(|(so_far, value)| *so_far = so_far.min(value));
    }
    let weights = options.weights();
    let missing = num::sum(weights.iter().zip(worst).map(|((_, weight), d)| weight * (1.0 - d)));
    let named = weights.iter().zip(worst).map(|((name, _), d)| (name.to_string(), d)).collect();
    // The last bit of rounding is clamped away.
    (named, (1.0 - missing).clamp(0.0, 1.0))
}
