//! Car following and path following of MetaDrive's `TrajectoryIDMPolicy`, shared by the IDM ego and by reactive
//! traffic.
//!
//! Kept quirks: speeds enter the law in km/h while distances are metres, so the wanted gap is 3.6 times the one that its
//! constants suggest; the gap runs from centre to centre; nothing farther than 20 m is seen; the law's result is a
//! throttle in [-1, 1], not an acceleration. An object is on the path when its box reaches within half the path's width
//! (1 m) in the tangent frame at its centre; MetaDrive asks for a corner there, which can be had as an option
//! ([`Obstacle`]).

use crate::kernel::{Vec2, num};
use crate::sim::prepared::body::{Place, Size};
use crate::sim::prepared::path::{Along, Path};
use crate::sim::prepared::plant_options::Obstacle;

use super::bicycle::Limits;

/// Constants of the law (MetaDrive `IDMPolicy` and `TrajectoryIDMPolicy`).
pub const DISTANCE_WANTED_M: f64 = 10.0;
/// Wanted time to the road user ahead; it is multiplied by a speed in km/h, see above.
pub const TIME_WANTED: f64 = 1.5;
/// Sharpness with which the free acceleration falls off as the wanted speed comes near.
pub const EXPONENT: u32 = 10;
/// The law's acceleration, as a throttle.
pub const ACCELERATION_FACTOR: f64 = 1.0;
/// The law's comfortable deceleration, as a throttle.
pub const DECELERATION_FACTOR: f64 = 5.0;
/// Wanted speed of reactive traffic, and of the ego where its scene gives none, km/h.
pub const NORMAL_SPEED_KMPH: f64 = 40.0;
/// Largest distance at which objects are seen, metres from centre to centre.
pub const SIGHT_M: f64 = 20.0;
/// Half the width of the followed path, metres.
pub const HALF_PATH_WIDTH_M: f64 = 1.0;
/// Distance from the end of its path at which traffic leaves, metres.
pub const DESTINATION_M: f64 = 2.0;

/// Length of the lane around a path before its beginning and beyond its end, metres.
const LANE_BEYOND_M: f64 = 1.0;

const KMPH: f64 = 3.6;

/// The object ahead on the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Front {
    /// Distance along the path from centre to centre, metres; positive.
    pub gap_m: f64,
    /// Velocity of the object ahead, m/s.
    pub velocity: Vec2,
}

/// Evaluates the law: throttle (positive) or brake (negative), at most 1, unclamped below.
pub fn throttle(speed_mps: f64, velocity: Vec2, axis: Vec2, target_kmph: f64, front: Option<&Front>) -> f64 {
    let free = ACCELERATION_FACTOR * (1.0 - num::powu(KMPH * speed_mps.max(0.0) / target_kmph, EXPONENT));
    let Some(front) = front else { return free };
    let closing_kmph = KMPH * (velocity - front.velocity).dot(axis);
    let root = 2.0 * (ACCELERATION_FACTOR * DECELERATION_FACTOR).sqrt();
    let wanted = DISTANCE_WANTED_M + KMPH * speed_mps * TIME_WANTED + KMPH * speed_mps * closing_kmph / root;
    let ratio = wanted / front.gap_m;
    free - ACCELERATION_FACTOR * ratio * ratio
}

/// Returns a throttle in [-1, 1] as an acceleration of a car, m/s². Brakes grow in proportion to the pedal up to half of it, and
/// from there to full.
pub fn acceleration_mps2(throttle: f64, limits: &Limits) -> f64 {
    let pedal = throttle.clamp(-1.0, 1.0);
    if pedal > 0.0 {
        return pedal * limits.engine_mps2;
    }
    let (half, full) = (limits.half_brake_mps2, limits.brake_mps2);
    match -pedal {
        brake if brake <= 0.5 => -2.0 * brake * half,
        brake => -(half + 2.0 * (brake - 0.5) * (full - half)),
    }
}

/// Returns the pedal in [-1, 1] that gives this acceleration, m/s²: the inverse of [`acceleration_mps2`].
pub(in crate::sim) fn pedal(acceleration_mps2: f64, limits: &Limits) -> f64 {
    if acceleration_mps2 >= 0.0 {
        return (acceleration_mps2 / limits.engine_mps2).min(1.0);
    }
    let (half, full) = (limits.half_brake_mps2, limits.brake_mps2);
    match -acceleration_mps2 {
        // First, because half and full brakes may take the same.
        brake if brake >= full => -1.0,
        brake if brake <= half => -0.5 * brake / half,
        brake => -(0.5 + 0.5 * (brake - half) / (full - half)),
    }
}

/// Returns how far ahead of `own` along the path an object is, if it is on the path. An object beyond the path's end is on it
/// if its box reaches back over the end.
pub fn gap_on_path(
    route: &Path,
    own: &Along,
    position: Vec2,
    axis: Vec2,
    size: &Size,
    obstacle: Obstacle,
) -> Option<f64> {
    if obstacle == Obstacle::Lane {
        return gap_in_lane(route, own, position, axis, size);
    }
    let at = route.project_near(position, own, 0.0, SIGHT_M);
    let gap_m = at.s_m - own.s_m;
    if gap_m <= 0.0 || at.offset_m.abs() > size.radius_m + HALF_PATH_WIDTH_M {
        return None;
    }
    let direction = route.direction(at.segment);
    let (along, across) = (direction.dot(axis).abs(), direction.cross(axis).abs());
    if at.s_m - size.half_length_m * along - size.half_width_m * across > route.length_m() {
        return None;
    }
    let is_on_path = if obstacle == Obstacle::Corner {
        let mut corners = size.at(Place { position, axis }).corners().into_iter();
        corners.any(|corner| (at.offset_m + direction.cross(corner - position)).abs() <= HALF_PATH_WIDTH_M)
    } else {
        at.offset_m.abs() - size.half_length_m * across - size.half_width_m * along <= HALF_PATH_WIDTH_M
    };
    is_on_path.then_some(gap_m)
}

/// Does the same as MetaDrive does: an object is on the path if it has a corner in the lane around it, which bends as the path does,
/// and is nearer than [`SIGHT_M`] along it, too.
fn gap_in_lane(lane: &Path, own: &Along, position: Vec2, axis: Vec2, size: &Size) -> Option<f64> {
    let near = lane.project_near(position, own, SIGHT_M, 2.0 * SIGHT_M);
    if near.offset_m.abs() > size.radius_m + HALF_PATH_WIDTH_M {
        return None;
    }
    let gap_m = lane.on_line_of(&near, position).s_m - own.s_m;
    if gap_m <= 0.0 || gap_m >= SIGHT_M {
        return None;
    }
    let end_m = lane.length_m().ceil() + LANE_BEYOND_M;
    let mut corners = size.at(Place { position, axis }).corners().into_iter();
    let is_in_lane = corners.any(|corner| {
        let at = lane.project_near(corner, own, SIGHT_M, 2.0 * SIGHT_M);
        at.offset_m.abs() <= HALF_PATH_WIDTH_M && (-LANE_BEYOND_M..=end_m).contains(&at.s_m)
    });
    is_in_lane.then_some(gap_m)
}

/// Puts an object in the place of `nearest` if it is on the path and nearer; the first of equals stays. Only then its
/// velocity is fetched.
#[allow(clippy::too_many_arguments)]
pub(in crate::sim) fn nearer(
    nearest: &mut Option<Front>,
    route: &Path,
    own: &Along,
    position: Vec2,
    axis: Vec2,
    velocity: impl FnOnce() -> Vec2,
    size: &Size,
    obstacle: Obstacle,
) {
    if let Some(gap_m) = gap_on_path(route, own, position, axis, size, obstacle)
        && nearest.is_none_or(|n| gap_m < n.gap_m)
    {
        *nearest = Some(Front { gap_m, velocity: velocity() });
    }
}
