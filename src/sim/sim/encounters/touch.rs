//! The face through which two boxes came to touch, from where they are and how they move.

use serde::{Deserialize, Serialize};

use crate::kernel::{OrientedBox, Vec2};

/// Speed along a separating axis up to which there is no approach along it, m/s.
const APPROACH_MPS: f64 = 1e-9;

/// The road user that ran into the other: each one's velocity is measured along the normal of the touch, towards the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Striker {
    /// Only the ego moved towards the other.
    Ego,
    /// Only the other moved towards the ego.
    Other,
    /// Each moved towards the other, or neither did.
    Both,
}

/// A side of a road user's box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The edge ahead.
    Front,
    /// The edge behind.
    Rear,
    /// The flank to the left, seen from the road user.
    Left,
    /// The flank to the right, seen from the road user.
    Right,
}

impl Side {
    /// Returns the side of a box that faces a direction most. A corner hit exactly on its diagonal counts as front or rear.
    pub(super) fn facing(axis: Vec2, direction: Vec2) -> Side {
        let (ahead, aside) = (axis.dot(direction), axis.cross(direction));
        match (ahead.abs() >= aside.abs(), ahead >= 0.0, aside >= 0.0) {
            (true, true, _) => Side::Front,
            (true, false, _) => Side::Rear,
            (false, _, true) => Side::Left,
            (false, _, false) => Side::Right,
        }
    }
}

/// Returns the unit normal of the contact, from `a` to `b`: moved back along their velocities, the boxes came apart first on this
/// axis (separating axes of moving boxes: Ericson, Real-Time Collision Detection, 5.5). Positions alone cannot give it:
/// the same overlap of two corners is a rear-end strike or a sideswipe. Without relative motion it is the axis of least
/// overlap.
pub(super) fn contact_normal(a: &OrientedBox, b: &OrientedBox, relative_velocity: Vec2) -> Vec2 {
    let delta = b.center - a.center;
    let (mut best, mut latest) = (None, f64::NEG_INFINITY);
    for (axis, reach_m) in separating_axes(a, b) {
        let speed = relative_velocity.dot(axis);
        if speed.abs() < APPROACH_MPS {
            continue;
        }
        // Where `b` enters the overlap on this axis: from the side that it moves away from.
        let side = if speed > 0.0 { -1.0 } else { 1.0 };
        let entered_s = (side * reach_m - delta.dot(axis)) / speed;
        if entered_s > latest {
            (best, latest) = (Some(axis * side), entered_s);
        }
    }
    best.unwrap_or_else(|| least_overlap(a, b))
}

/// The axis along which two touching boxes overlap least, pointing from `a` to `b`; the first of equals.
fn least_overlap(a: &OrientedBox, b: &OrientedBox) -> Vec2 {
    let delta = b.center - a.center;
    let (mut best, mut least) = (a.axis, f64::INFINITY);
    for (axis, reach_m) in separating_axes(a, b) {
        let depth = reach_m - delta.dot(axis).abs();
        if depth < least {
            (best, least) = (axis, depth);
        }
    }
    if best.dot(delta) < 0.0 { -best } else { best }
}

/// The four axes on which two boxes can be apart, with the distance of the centres at which they touch there, metres.
fn separating_axes(a: &OrientedBox, b: &OrientedBox) -> [(Vec2, f64); 4] {
    let along = a.axis.dot(b.axis).abs();
    let across = a.axis.cross(b.axis).abs();
    [
        (a.axis, a.half_length_m + b.half_length_m * along + b.half_width_m * across),
        (a.axis.left(), a.half_width_m + b.half_length_m * across + b.half_width_m * along),
        (b.axis, b.half_length_m + a.half_length_m * along + a.half_width_m * across),
        (b.axis.left(), b.half_width_m + a.half_length_m * across + a.half_width_m * along),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car(x: f64, y: f64) -> OrientedBox {
        OrientedBox::new(Vec2::new(x, y), 0.0, 4.0, 2.0)
    }

    #[test]
    fn one_overlap_of_corners_is_struck_from_behind_or_from_the_side_as_the_motion_says() {
        // Corners overlap by 0.1 m along and 0.1 m across.
        let (ego, other) = (car(0.0, 0.0), car(3.9, 1.9));
        let normal = |x, y| contact_normal(&ego, &other, Vec2::new(x, y));
        assert_eq!(normal(-5.0, -0.1), Vec2::new(1.0, 0.0), "it was reached along the road");
        assert_eq!(normal(-0.1, -1.0), Vec2::new(0.0, 1.0), "it came in from the left");
    }

    #[test]
    fn without_relative_motion_the_least_overlap_decides() {
        assert_eq!(contact_normal(&car(0.0, 0.0), &car(3.9, 1.0), Vec2::ZERO), Vec2::new(1.0, 0.0));
        assert_eq!(contact_normal(&car(0.0, 0.0), &car(1.0, -1.9), Vec2::ZERO), Vec2::new(0.0, -1.0));
    }

    #[test]
    fn a_side_is_named_from_the_road_user_s_own_point_of_view() {
        let axis = Vec2::new(0.0, 1.0);
        let of = |x, y| Side::facing(axis, Vec2::new(x, y));
        assert_eq!(
            [of(0.0, 1.0), of(0.0, -1.0), of(-1.0, 0.0), of(1.0, 0.0)],
            [Side::Front, Side::Rear, Side::Left, Side::Right]
        );
    }
}
