//! Data of a scene of SafeBench's eight traffic families besides its road: the family, the trigger, and the frames in
//! which its actors are placed.

mod family;
mod stage;
mod staging;

pub use family::TrafficFamily;
pub use stage::{LeftLane, Roadside, Stage};
pub use staging::{SPAWNS_MAX, SpawnFrame, Staging};

use super::{AgentKind, Ego, Sample, Track};
use crate::kernel::Vec2;

/// Samples of a SafeBench scene: at most 300 decision steps of 0.1 s (SafeBench `max_episode_step`).
pub const STEPS: usize = 301;
/// The speed that SafeBench's ego is rewarded up to, m/s (`desired_speed`).
pub const EGO_TARGET_MPS: f64 = 8.0;
/// Box of the ego, a Lincoln MKZ, metres.
pub const EGO_SIZE_M: (f64, f64) = (4.90, 2.06);

/// SafeBench's ego: it stands at the beginning of its route.
pub fn ego_at_rest(position: Vec2, heading_rad: f64, route: Vec<Vec2>) -> Ego {
    let start = Sample { position, heading_rad, velocity: Vec2::ZERO };
    let mut samples = vec![None; STEPS];
    samples[0] = Some(start);
    let (length_m, width_m) = EGO_SIZE_M;
    let track = Track { id: "ego".into(), kind: AgentKind::Vehicle, length_m, width_m, samples };
    Ego { track, start_step: 0, route, target_speed_mps: Some(EGO_TARGET_MPS) }
}
