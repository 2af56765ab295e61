//! Poses of CARLA, whose y points to the right.

use crate::kernel::{Pose, Vec2, num};

/// A CARLA pose in our frame.
pub(super) fn pose(x: f64, y: f64, yaw_degrees: f64) -> Pose {
    Pose { position: Vec2::new(x, -y), heading_rad: num::wrap_angle(-yaw_degrees * num::PI / 180.0) }
}
