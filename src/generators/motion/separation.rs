//! The distance of two bodies with its gradients: the distance of a point from a box (KING's attraction and repulsion)
//! and the overlap of disc chains (STRIVE's soft contact).

use super::kinematics::Slope;
use crate::kernel::{OrientedBox, Vec2};

/// The gradient at a pose, given the gradient at a point that is fixed to its body.
pub fn on_body(pull: Vec2, arm: Vec2) -> Slope {
    Slope { position: pull, heading: pull.dot(arm.left()), speed: 0.0 }
}

/// Distance of a point from a box, 0 inside, with its slope in the box's pose. The slope at the point is minus the
/// slope's position.
pub fn point_to_box(point: Vec2, body: &OrientedBox) -> (f64, Slope) {
    let delta = point - body.center;
    let (along, across) = (delta.dot(body.axis), body.axis.cross(delta));
    let outside = |offset: f64, half: f64| (offset.abs() - half).max(0.0) * offset.signum();
    let (dx, dy) = (outside(along, body.half_length_m), outside(across, body.half_width_m));
    let distance = (dx * dx + dy * dy).sqrt();
    if distance == 0.0 {
        return (0.0, Slope::default());
    }
    let (nx, ny) = (dx / distance, dy / distance);
    let normal = body.axis * nx + body.axis.left() * ny;
    (distance, Slope { position: -normal, heading: nx * across - ny * along, speed: 0.0 })
}

/// Distance of two boxes by their corners, 0 when a corner lies in the other, with slopes in both poses.
pub fn box_to_box(a: &OrientedBox, b: &OrientedBox) -> (f64, Slope, Slope) {
    let mut best = (f64::INFINITY, Slope::default(), Slope::default());
    for corner in a.corners() {
        let (distance, slope) = point_to_box(corner, b);
        if distance < best.0 {
            best = (distance, on_body(-slope.position, corner - a.center), slope);
        }
    }
    for corner in b.corners() {
        let (distance, slope) = point_to_box(corner, a);
        if distance < best.0 {
            best = (distance, slope, on_body(-slope.position, corner - b.center));
        }
    }
    best
}

/// STRIVE: each body is five discs as wide as itself along its length.
const DISCS: i32 = 5;

/// STRIVE's soft contact, `1 − d / (r_a + r_b + buffer)` for the nearest pair of discs, with slopes in both poses;
/// `None` where no pair is that near.
pub fn disc_overlap(a: &OrientedBox, b: &OrientedBox, buffer_m: f64) -> Option<(f64, Slope, Slope)> {
    let reach = a.half_width_m + b.half_width_m + buffer_m;
    let room = reach + a.half_length_m + b.half_length_m;
    if (a.center - b.center).norm_squared() > room * room {
        return None;
    }
    let arm = |body: &OrientedBox, i: i32| {
        let last = f64::from(DISCS - 1) / 2.0;
        body.axis * ((body.half_length_m - body.half_width_m).max(0.0) * f64::from(i - DISCS / 2) / last)
    };
    let mut best = (reach * reach, Vec2::ZERO, Vec2::ZERO, Vec2::ZERO);
    for i in 0..DISCS {
        let own = arm(a, i);
        for j in 0..DISCS {
            let theirs = arm(b, j);
            let between = a.center + own - b.center - theirs;
            let squared = between.norm_squared();
            if squared < best.0 {
                best = (squared, between, own, theirs);
            }
        }
    }
    let (squared, between, own, theirs) = best;
    if squared >= reach * reach {
        return None;
    }
    let distance = squared.sqrt();
    // Two bodies at exactly the same place are pushed apart along the first one's axis.
    let unit = if distance > 1e-9 { between * (1.0 / distance) } else { a.axis };
    let pull = unit * (-1.0 / reach);
    Some((1.0 - distance / reach, on_body(pull, own), on_body(-pull, theirs)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn car(x: f64, y: f64, heading: f64) -> OrientedBox {
        OrientedBox::new(Vec2::new(x, y), heading, 4.6, 1.9)
    }

    /// Central differences of `f` in the pose (x, y, heading).
    fn slope(pose: [f64; 3], f: impl Fn(&OrientedBox) -> f64) -> [f64; 3] {
        core::array::from_fn(|k| {
            let at = |step: f64| {
                let mut moved = pose;
                moved[k] += step;
                f(&car(moved[0], moved[1], moved[2]))
            };
            (at(1e-6) - at(-1e-6)) / 2e-6
        })
    }

    fn close(found: &Slope, expected: [f64; 3]) -> bool {
        let found = [found.position.x, found.position.y, found.heading];
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5)
    }

    proptest! {
        #[test]
        fn slopes_of_distances_match_finite_differences(
            x in 4.0..9.0f64, y in 2.5..6.0f64, heading in -3.0..3.0f64, other in -3.0..3.0f64,
        ) {
            let still = car(0.0, 0.0, other);
            let (distance, a, b) = box_to_box(&car(x, y, heading), &still);
            prop_assert!((distance - car(x, y, heading).distance(&still)).abs() < 1e-9 || distance == 0.0);
            // Where two pairs are nearest at once the distance has a kink.
            let moved = slope([x, y, heading], |c| box_to_box(c, &still).0);
            let back = slope([0.0, 0.0, other], |c| box_to_box(&car(x, y, heading), c).0);
            let kink = slope([x, y, heading + 1e-3], |c| box_to_box(c, &still).0);
            prop_assume!(moved.iter().zip(kink).all(|(p, q)| (p - q).abs() < 0.05));
            prop_assert!(close(&a, moved) && close(&b, back), "{a:?} {moved:?} {b:?} {back:?}");
        }

        #[test]
        fn slopes_of_disc_overlaps_match_finite_differences(
            x in -2.0..2.0f64, y in 0.8..1.6f64, heading in -0.4..0.4f64,
        ) {
            let still = car(0.0, 0.0, 0.1);
            let value = |c: &OrientedBox| disc_overlap(c, &still, 0.5).map_or(0.0, |o| o.0);
            let Some((overlap, own, _)) = disc_overlap(&car(x, y, heading), &still, 0.5) else { return Ok(()) };
            prop_assert!(overlap > 0.0 && overlap < 1.0);
            let moved = slope([x, y, heading], value);
            let kink = slope([x + 1e-3, y, heading + 1e-3], value);
            prop_assume!(moved.iter().zip(kink).all(|(p, q)| (p - q).abs() < 0.01));
            prop_assert!(close(&own, moved), "{own:?} {moved:?}");
        }
    }

    #[test]
    fn discs_that_do_not_touch_give_nothing() {
        assert_eq!(disc_overlap(&car(0.0, 0.0, 0.0), &car(0.0, 2.5, 0.0), 0.5), None);
        assert!(disc_overlap(&car(0.0, 0.0, 0.0), &car(0.0, 2.3, 0.0), 0.5).is_some());
    }
}
