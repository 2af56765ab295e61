//! r_MD(τ) = Σ w_j d_j(τ): the weighted sum of ten feasibility diagnostics (paper eq. app-metadrive-realism-score).
//! The paper names the diagnostics, not their weights and tolerances: weights come from the experiment file, tolerances
//! from a calibration on recorded traffic that the file names.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::limits::Calibration;
use super::{
    acceleration, collision_validity, continuity, initial_overlap, jerk, map, parked, route_completion, slip, wrong_way,
};
use crate::kernel::num;
use crate::sim::{AdversaryReport, Outcome};

/// How many there are.
const DIAGNOSTICS: usize = 10;

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
}

/// What realism rests on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RealismOptions {
    /// How much each diagnostic counts.
    pub weights: Weights,
    /// In a file: the table itself, `evodrive:recorded`, or the path of a file that `evodrive calibrate` wrote.
    pub calibration: Box<Calibration>,
}

/// Options that define no score.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("evaluation.realism.{place} is {found}, expected {expected}")]
pub struct OptionsError {
    /// The key below `[evaluation.realism]`.
    pub place: String,
    /// Its value.
    pub found: f64,
    /// What it must be.
    pub expected: &'static str,
}

impl RealismOptions {
    /// w_j with their names, in name order.
    pub fn weights(&self) -> [(&'static str, f64); DIAGNOSTICS] {
        let of = &self.weights;
        [
            (acceleration::NAME, of.bounded_acceleration),
            (jerk::NAME, of.bounded_jerk),
            (slip::NAME, of.bounded_slip),
            (collision_validity::NAME, of.collision_validity),
            (initial_overlap::NAME, of.initial_non_overlap),
            (wrong_way::NAME, of.lane_direction),
            (map::NAME, of.map_validity),
            (parked::NAME, of.parked_obstacles),
            (route_completion::NAME, of.route_completion),
            (continuity::NAME, of.trajectory_continuity),
        ]
    }

    /// Weights must be shares of one, tolerances positive, bounds no less than zero.
    pub fn check(&self) -> Result<(), OptionsError> {
        let wrong = |place: String, found: f64, expected| Err(OptionsError { place, found, expected });
        for (name, weight) in self.weights() {
            if !(0.0..=1.0).contains(&weight) {
                return wrong(format!("weights.{name}"), weight, "a share from 0 to 1");
            }
        }
        for (kind, limits) in self.calibration.by_kind() {
            for (name, limit) in limits.by_name() {
                let place = format!("calibration.{kind}.{name}");
                if !(limit.tolerance.is_finite() && limit.tolerance > 0.0) {
                    return wrong(format!("{place}.tolerance"), limit.tolerance, "a positive number");
                }
                if !(limit.bound.is_finite() && limit.bound >= 0.0) {
                    return wrong(format!("{place}.bound"), limit.bound, "a number not below 0");
                }
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
        let limits = self.calibration.of(report.kind);
        [
            acceleration::diagnostic(report, limits),
            jerk::diagnostic(report, limits),
            slip::diagnostic(report, limits),
            collision_validity::diagnostic(report),
            initial_overlap::diagnostic(report),
            wrong_way::diagnostic(report, limits),
            map::diagnostic(report, limits),
            parked::diagnostic(report),
            route_completion::diagnostic(report),
            continuity::diagnostic(report, limits),
        ]
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
    let mut worst = [1.0f64; DIAGNOSTICS];
    for report in reports {
        worst.iter_mut().zip(options.of_adversary(report)).for_each(|(so_far, value)| *so_far = so_far.min(value));
    }
    let weights = options.weights();
    let missing = num::sum(weights.iter().zip(worst).map(|((_, weight), d)| weight * (1.0 - d)));
    let named = weights.iter().zip(worst).map(|((name, _), d)| (name.to_string(), d)).collect();
    // The last bit of rounding is clamped away.
    (named, (1.0 - missing).clamp(0.0, 1.0))
}
