//! Every number of PDM-Closed, with its value there.

use serde::{Deserialize, Serialize};

use crate::kernel::num;

/// Seconds of a step of proposals, forecast and score.
pub const STEP_S: f64 = 0.1;
/// Steps that a proposal is unrolled, simulated and scored: 4 s.
pub const STEPS: usize = 40;
/// States of a proposal: now, and behind each step.
pub const STATES: usize = STEPS + 1;
/// Steps of a proposal that one forecast holds for: maps of the others are made every 0.2 s.
pub const STEPS_A_MAP: usize = 2;

/// Numbers that decide, by the names of the field: `pdm_closed_planner.yaml`, `PDMScorer`, `PDMEmergencyBrake`, nuPlan's configurations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Shares of the speed limit at which proposals aim.
    pub speed_shares: [f64; 5],
    /// Offsets of the paths of proposals to the left of the centreline, metres, in the order of the paths.
    pub offsets_m: [f64; 3],
    /// Speed aimed at where no limit is known, m/s.
    pub free_speed_mps: f64,
    /// s0 of IDM, metres.
    pub gap_min_m: f64,
    /// T of IDM, s.
    pub headway_s: f64,
    /// a of IDM, m/s².
    pub acceleration_mps2: f64,
    /// b of IDM, m/s²: the braking of proposals, at most.
    pub brake_mps2: f64,
    /// Exponent of the speed in IDM.
    pub exponent: u32,
    /// Distance between centres beyond which others are not seen, metres.
    pub radius_m: f64,
    /// Most others that are kept, the nearest ones: vehicles, pedestrians, cyclists, things.
    pub kept: [usize; 4],
    /// Weight of the progress in the score.
    pub progress_weight: f64,
    /// Weight of the time to collision.
    pub time_to_collision_weight: f64,
    /// Weight of comfort.
    pub comfort_weight: f64,
    /// Way against traffic at which a proposal loses half of its score, and all of it, metres.
    pub oncoming_m: [f64; 2],
    /// Times ahead for which the time to collision is checked, s.
    pub collision_looks_s: [f64; 4],
    /// Time, s, within which a contact for which the ego is at fault makes it brake fully ...
    pub emergency_s: f64,
    /// ... where it is no faster than this, m/s.
    pub emergency_mps: f64,
    /// Least and greatest acceleration of the emergency brake; also the bounds of comfort along the heading, m/s².
    pub along_mps2: [f64; 2],
    /// Bounds of comfort: acceleration to the side, m/s².
    pub across_mps2: f64,
    /// Change of the acceleration, m/s³.
    pub jerk_mps3: f64,
    /// Its part along the heading, m/s³.
    pub jerk_along_mps3: f64,
    /// Change of the yaw rate, rad/s².
    pub yaw_radps2: f64,
    /// Yaw rate, rad/s.
    pub yaw_radps: f64,
}

/// The published values.
pub const PUBLISHED: Settings = Settings {
    speed_shares: [0.2, 0.4, 0.6, 0.8, 1.0],
    offsets_m: [0.0, -1.0, 1.0],
    free_speed_mps: 15.0,
    gap_min_m: 1.0,
    headway_s: 1.5,
    acceleration_mps2: 1.5,
    brake_mps2: 3.0,
    exponent: 10,
    radius_m: 50.0,
    kept: [50, 25, 10, 50],
    progress_weight: 5.0,
    time_to_collision_weight: 5.0,
    comfort_weight: 2.0,
    oncoming_m: [2.0, 6.0],
    collision_looks_s: [0.0, 0.3, 0.6, 0.9],
    emergency_s: 2.0,
    emergency_mps: 5.0,
    along_mps2: [-4.05, 2.40],
    across_mps2: 4.89,
    jerk_mps3: 8.37,
    jerk_along_mps3: 4.13,
    yaw_radps2: 1.93,
    yaw_radps: 0.95,
};

/// Angle from the ego's heading below which a road user is ahead, radians.
pub const AHEAD_RAD: f64 = 20.0 * num::PI / 180.0;
/// Progress of the best proposal up to which all count as equal, metres.
pub const PROGRESS_MIN_M: f64 = 0.1;
