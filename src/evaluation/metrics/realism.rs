//! r_MD(τ) = Σ w_j d_j(τ) over the seven diagnostics (paper eq. app-metadrive-realism-score). They judge what a program
//! changed: a scene without an adversary was left as recorded and has d_j = 1 by definition.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::{acceleration, collision_validity, continuity, initial_overlap, jerk, lane_validity, route_progress};
use crate::kernel::num;
use crate::sim::Outcome;

/// Weights w_j, bounds and tolerances ρ_j of the diagnostics. The paper states none; the experiment file declares them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RealismOptions {
    pub weights: RealismWeights,
    /// ρ of map and lane validity, metres.
    pub off_road_tolerance_m: f64,
    /// ρ of route progress, metres.
    pub wrong_way_tolerance_m: f64,
    /// ρ of trajectory continuity, metres.
    pub jump_tolerance_m: f64,
    /// Acceleration and braking up to here are no violation, m/s².
    pub acceleration_bound_mps2: f64,
    /// Lateral acceleration up to here is no violation, m/s².
    pub lateral_acceleration_bound_mps2: f64,
    /// ρ of bounded acceleration, m/s².
    pub acceleration_tolerance_mps2: f64,
    /// Jerk up to here is no violation, m/s³.
    pub jerk_bound_mps3: f64,
    /// ρ of bounded jerk, m/s³.
    pub jerk_tolerance_mps3: f64,
}

/// w_j, not negative, with sum 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RealismWeights {
    pub lane_validity: f64,
    pub initial_non_overlap: f64,
    pub collision_validity: f64,
    pub route_progress: f64,
    pub continuity: f64,
    pub acceleration: f64,
    pub jerk: f64,
}

/// Options that define no score.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RealismError {
    #[error("realism.weights sum to {0}, expected 1; scale them")]
    Sum(f64),
    #[error("realism.{name} is {found}, expected {expected}")]
    Value { name: &'static str, found: f64, expected: &'static str },
}

impl RealismWeights {
    /// By the diagnostics' names.
    fn named(&self) -> [(&'static str, f64); 7] {
        [
            ("lane_validity", self.lane_validity),
            ("initial_non_overlap", self.initial_non_overlap),
            ("collision_validity", self.collision_validity),
            ("route_progress", self.route_progress),
            ("continuity", self.continuity),
            ("acceleration", self.acceleration),
            ("jerk", self.jerk),
        ]
    }
}

impl RealismOptions {
    /// Whether the options define a score in [0, 1].
    pub fn check(&self) -> Result<(), RealismError> {
        for (name, weight) in self.weights.named() {
            if !(0.0..=1.0).contains(&weight) {
                return Err(RealismError::Value { name, found: weight, expected: "a weight in [0, 1]" });
            }
        }
        let total = num::sum(self.weights.named().map(|(_, w)| w));
        if (total - 1.0).abs() > 1e-9 {
            return Err(RealismError::Sum(total));
        }
        let tolerances = [
            ("off_road_tolerance_m", self.off_road_tolerance_m),
            ("wrong_way_tolerance_m", self.wrong_way_tolerance_m),
            ("jump_tolerance_m", self.jump_tolerance_m),
            ("acceleration_bound_mps2", self.acceleration_bound_mps2),
            ("lateral_acceleration_bound_mps2", self.lateral_acceleration_bound_mps2),
            ("acceleration_tolerance_mps2", self.acceleration_tolerance_mps2),
            ("jerk_bound_mps3", self.jerk_bound_mps3),
            ("jerk_tolerance_mps3", self.jerk_tolerance_mps3),
        ];
        match tolerances.into_iter().find(|(_, v)| !(v.is_finite() && *v > 0.0)) {
            Some((name, found)) => Err(RealismError::Value { name, found, expected: "a number above 0" }),
            None => Ok(()),
        }
    }
}

/// d_j by name.
pub fn diagnostics(outcome: &Outcome, o: &RealismOptions) -> BTreeMap<String, f64> {
    let acceleration = acceleration::bounded_acceleration(
        outcome,
        o.acceleration_bound_mps2,
        o.lateral_acceleration_bound_mps2,
        o.acceleration_tolerance_mps2,
    );
    [
        ("lane_validity", lane_validity::lane_validity(outcome, o.off_road_tolerance_m)),
        ("initial_non_overlap", initial_overlap::initial_non_overlap(outcome)),
        ("collision_validity", collision_validity::collision_validity(outcome)),
        ("route_progress", route_progress::route_progress(outcome, o.wrong_way_tolerance_m)),
        ("continuity", continuity::continuity(outcome, o.jump_tolerance_m)),
        ("acceleration", acceleration),
        ("jerk", jerk::bounded_jerk(outcome, o.jerk_bound_mps3, o.jerk_tolerance_mps3)),
    ]
    .into_iter()
    .map(|(name, d)| (name.to_string(), d))
    .collect()
}

/// Σ w_j d_j, in [0, 1]; as 1 - Σ w_j (1 - d_j), so that no violation gives 1 exactly.
pub fn realism(diagnostics: &BTreeMap<String, f64>, weights: &RealismWeights) -> f64 {
    let lost = |(name, weight): (&str, f64)| weight * (1.0 - diagnostics.get(name).copied().unwrap_or(0.0));
    (1.0 - num::sum(weights.named().map(lost))).clamp(0.0, 1.0)
}
