//! What a scene of SafeBench's eight traffic families knows beside its road: the family, the trigger, and the frames in
//! which its actors are put.

mod family;
mod stage;
mod staging;

pub use family::TrafficFamily;
pub use stage::{LeftLane, Roadside, Stage};
pub use staging::{SPAWNS_MAX, SpawnFrame, Staging};

/// Samples of a SafeBench scene: at most 300 decision steps of 0.1 s (SafeBench `max_episode_step`).
pub const STEPS: usize = 301;
/// The speed that SafeBench's ego is rewarded up to, m/s (`desired_speed`).
pub const EGO_TARGET_MPS: f64 = 8.0;
/// Box of the ego, a Lincoln MKZ, metres.
pub const EGO_SIZE_M: (f64, f64) = (4.90, 2.06);
