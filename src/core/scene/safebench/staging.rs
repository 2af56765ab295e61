//! Start of a family's scenario on a route, and places of its actors, as frames relative to the trigger.

use serde::{Deserialize, Serialize};

use super::family::TrafficFamily;
use crate::kernel::{Pose, Vec2, num};

/// Actors that one scenario may place.
pub const SPAWNS_MAX: usize = 16;

/// A pose relative to the trigger.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpawnFrame {
    /// Ahead of the trigger, metres.
    pub fwd_m: f64,
    /// To the right of it, metres; negative on the left.
    pub right_m: f64,
    /// Heading relative to the trigger's, counter-clockwise, radians; -pi/2 drives from the left to the right.
    pub yaw_rad: f64,
}

/// The part of a scene that comes from SafeBench's scenario file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Staging {
    /// Its traffic family.
    pub family: TrafficFamily,
    /// SafeBench's route number; 4 to 13 are the ten that are evaluated.
    pub route: u32,
    /// The trigger point: on the ego's route, heading along it.
    pub trigger: Pose,
    /// Frames of the actors of families 5 to 8; empty for the others, whose actors stand along the ego's road.
    pub spawns: Vec<SpawnFrame>,
}

impl Staging {
    /// The pose of a frame.
    pub fn pose(&self, frame: &SpawnFrame) -> Pose {
        let offset = Vec2::new(frame.fwd_m, -frame.right_m).rotated(self.trigger.heading_rad);
        Pose {
            position: self.trigger.position + offset,
            heading_rad: num::wrap_angle(self.trigger.heading_rad + frame.yaw_rad),
        }
    }

    /// The frame of a pose; the inverse of [`Staging::pose`].
    pub fn frame(&self, pose: Pose) -> SpawnFrame {
        let local = self.trigger.to_local(pose.position);
        let yaw_rad = num::wrap_angle(pose.heading_rad - self.trigger.heading_rad);
        SpawnFrame { fwd_m: local.x, right_m: -local.y, yaw_rad }
    }

    /// The group in which rollouts of this scene are aggregated: `family/route`.
    pub fn group(&self) -> String {
        format!("{}/{}", self.family.name(), self.route)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_told_ahead_and_to_the_right_of_the_trigger() {
        let trigger = Pose { position: Vec2::new(10.0, 5.0), heading_rad: num::FRAC_PI_2 };
        let staging = Staging { family: TrafficFamily::RedLightRunning, route: 4, trigger, spawns: vec![] };
        let frame = SpawnFrame { fwd_m: 30.0, right_m: -20.0, yaw_rad: -num::FRAC_PI_2 };
        let pose = staging.pose(&frame);
        assert!(pose.position.distance(Vec2::new(-10.0, 35.0)) < 1e-9, "north of the trigger, then west: {pose:?}");
        assert!(pose.heading_rad.abs() < 1e-12, "it drives east, from the left to the right");
        let back = staging.frame(pose);
        assert!((back.fwd_m - 30.0).abs() < 1e-9 && (back.right_m + 20.0).abs() < 1e-9);
        assert_eq!(staging.group(), "red_light_running/4");
    }
}
