//! Limits of traffic of a kind: bound and tolerance of each soft diagnostic, calibrated from recorded pools
//! (`evaluation::calibrate`). An input of experiments, never a default.

use serde::{Deserialize, Serialize};

use crate::kernel::{Digest, canon::CanonError};
use crate::scene::AgentKind;

/// Bound and tolerance of one quantity, both in its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    /// Value that recorded traffic of the kind stays below, up to the calibration's quantile.
    pub bound: f64,
    /// ρ_j: the excess over the bound at which the diagnostic is 0.
    pub tolerance: f64,
}

/// Limits of one kind of road user.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Recorded road users that they rest on.
    pub road_users: usize,
    /// True if the kind had too few, so that the limits are those of all kinds together.
    pub pooled: bool,
    /// Distance by which a corner of the box leaves the drivable area, metres.
    pub off_road_m: Limit,
    /// Driven against the direction of every lane, metres.
    pub wrong_way_m: Limit,
    /// Level of the filtered acceleration, m/s².
    pub acceleration_mps2: Limit,
    /// Level of the filtered jerk, m/s³.
    pub jerk_mps3: Limit,
    /// Level of the filtered velocity across the heading, m/s.
    pub slip_mps: Limit,
    /// A step that the velocities at its ends do not explain, metres.
    pub jump_m: Limit,
    /// A step that the step before it does not explain, metres.
    pub kink_m: Limit,
    /// Displacement that the filter takes away, metres.
    pub roughness_m: Limit,
    /// Displacement that rolling wheels do not explain, metres; only in a calibration made with `--of-kind`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unrolled_m: Option<Limit>,
    /// Level of the filtered speed, m/s; likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_mps: Option<Limit>,
}

impl Limits {
    /// Returns all of them with their names, in the order of the fields.
    pub fn by_name(&self) -> Vec<(&'static str, Limit)> {
        // The pattern has no `..`, so that no limit is left out.
        macro_rules! named {
            ($($name:ident)*) => {{
                let Limits { road_users: _, pooled: _, $($name),* } = *self;
                [$((stringify!($name), Option::<Limit>::from($name))),*]
            }};
        }
        let all = named!(off_road_m wrong_way_m acceleration_mps2 jerk_mps3 slip_mps jump_m kink_m roughness_m unrolled_m speed_mps);
        all.into_iter().filter_map(|(name, limit)| Some((name, limit?))).collect()
    }
}

/// Limits by kind of road user, and their source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Share of recorded road users that stay below each bound.
    pub quantile: f64,
    /// Digests of the recorded pools.
    pub pools: Vec<Digest>,
    /// Number of scenes in these pools together.
    pub scenes: usize,
    /// Limits of cars, lorries, buses and motorcycles.
    pub vehicle: Limits,
    /// Limits of cyclists.
    pub cyclist: Limits,
    /// Limits of people on foot.
    pub pedestrian: Limits,
    /// Limits of barriers, cones, parked or unknown things.
    #[serde(rename = "static")]
    pub fixed: Limits,
}

impl Calibration {
    /// The limits of one kind of road user.
    pub fn of(&self, kind: AgentKind) -> &Limits {
        match kind {
            AgentKind::Vehicle => &self.vehicle,
            AgentKind::Cyclist => &self.cyclist,
            AgentKind::Pedestrian => &self.pedestrian,
            AgentKind::Static => &self.fixed,
        }
    }

    /// Returns all of them with the names of their kinds.
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
