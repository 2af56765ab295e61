//! What traffic of a kind shows: bound and tolerance of each soft diagnostic, calibrated from recorded pools
//! (`evaluation::calibrate`). An input of experiments, never a default.

use serde::{Deserialize, Serialize};

use super::soft;
use crate::kernel::{Digest, canon::CanonError};
use crate::scene::AgentKind;
use crate::sim::{AdversaryReport, Feasibility};

/// Bound and tolerance of one quantity, both in its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    /// What recorded traffic of the kind stays below, up to the calibration's quantile.
    pub bound: f64,
    /// ρ_j: the excess over the bound at which the diagnostic is 0.
    pub tolerance: f64,
}

impl Limit {
    /// d_j of the excess over the bound and over the adversary's own recording, whichever is larger.
    pub fn diagnostic(&self, report: &AdversaryReport, of: impl Fn(&Feasibility) -> f64) -> f64 {
        let own = report.recorded.as_ref().map_or(0.0, &of);
        soft(of(&report.simulated) - self.bound.max(own), self.tolerance)
    }
}

/// Limits of one kind of road user.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Recorded road users that they rest on.
    pub road_users: usize,
    /// Whether the kind had too few, so that all kinds together stand in for it.
    pub pooled: bool,
    pub off_road_m: Limit,
    pub wrong_way_m: Limit,
    pub acceleration_mps2: Limit,
    pub jerk_mps3: Limit,
    pub slip_mps: Limit,
    pub jump_m: Limit,
    pub kink_m: Limit,
    pub roughness_m: Limit,
}

impl Limits {
    pub fn by_name(&self) -> [(&'static str, Limit); 8] {
        [
            ("off_road_m", self.off_road_m),
            ("wrong_way_m", self.wrong_way_m),
            ("acceleration_mps2", self.acceleration_mps2),
            ("jerk_mps3", self.jerk_mps3),
            ("slip_mps", self.slip_mps),
            ("jump_m", self.jump_m),
            ("kink_m", self.kink_m),
            ("roughness_m", self.roughness_m),
        ]
    }
}

/// Limits by kind of road user, and what they were made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Share of recorded road users that stay below each bound.
    pub quantile: f64,
    /// Digests of the recorded pools, and how many scenes they hold in all.
    pub pools: Vec<Digest>,
    pub scenes: usize,
    pub vehicle: Limits,
    pub cyclist: Limits,
    pub pedestrian: Limits,
    /// Barriers, cones, parked or unknown things.
    #[serde(rename = "static")]
    pub fixed: Limits,
}

impl Calibration {
    pub fn of(&self, kind: AgentKind) -> &Limits {
        match kind {
            AgentKind::Vehicle => &self.vehicle,
            AgentKind::Cyclist => &self.cyclist,
            AgentKind::Pedestrian => &self.pedestrian,
            AgentKind::Static => &self.fixed,
        }
    }

    pub fn by_kind(&self) -> [(&'static str, &Limits); 4] {
        [
            ("vehicle", &self.vehicle),
            ("cyclist", &self.cyclist),
            ("pedestrian", &self.pedestrian),
            ("static", &self.fixed),
        ]
    }

    /// Digest of the values.
    pub fn digest(&self) -> Result<Digest, CanonError> {
        Digest::of("evodrive/calibration/1", self)
    }
}
