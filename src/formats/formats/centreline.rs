//! Lanes that come as a centre line with widths: thinned to the points that matter, with borders on both sides.

use crate::kernel::Vec2;
use crate::kernel::geom::{beside_piece, needed_points};

/// The half width of a lane whose width is unknown, metres. Given half widths are clamped to the two bounds below,
/// because recorded widths reach 13 m in junctions.
pub const HALF_WIDTH_UNKNOWN_M: f64 = 1.75;
/// Smaller half widths are raised to this, metres.
pub const HALF_WIDTH_MIN_M: f64 = 1.3;
/// Larger half widths are lowered to this, metres.
pub const HALF_WIDTH_MAX_M: f64 = 2.5;
/// Thinning moves a centre line by at most this, metres.
const TOLERANCE_M: f64 = 0.02;
/// And a border by at most this more.
const WIDTH_TOLERANCE_M: f64 = 0.1;
/// Thinning looks at this many points at a time, which bounds its cost.
const WINDOW: usize = 512;

/// A point of a centre line with the distances to its left and right border.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Across {
    /// The point on the centre line.
    pub centre: Vec2,
    /// From there to the left border, metres.
    pub left_m: f64,
    /// From there to the right border, metres.
    pub right_m: f64,
}

impl Across {
    /// Half widths as given, clamped to the bounds. 0, NaN and infinity mean unknown.
    pub fn new(centre: Vec2, left_m: f64, right_m: f64) -> Across {
        Across { centre, left_m: believed(left_m), right_m: believed(right_m) }
    }
}

fn believed(half_width_m: f64) -> f64 {
    if half_width_m.is_finite() && half_width_m > 0.0 {
        half_width_m.clamp(HALF_WIDTH_MIN_M, HALF_WIDTH_MAX_M)
    } else {
        HALF_WIDTH_UNKNOWN_M
    }
}

/// Ramer-Douglas-Peucker over centre and widths; points closer than 1 cm become one. Ends are kept.
pub fn thinned(points: &[Across]) -> Vec<Across> {
    let mut distinct: Vec<Across> = Vec::with_capacity(points.len());
    for point in points {
        if distinct.last().is_none_or(|last| last.centre.distance(point.centre) >= 0.01) {
            distinct.push(*point);
        }
    }
    let mut kept = Vec::new();
    let mut from = 0;
    while from < distinct.len() {
        let to = (from + WINDOW).min(distinct.len() - 1);
        let window = &distinct[from..=to];
        let keep = needed_points(window.len(), |a, b, k| deviation(window[a], window[b], window[k]));
        let last = to == distinct.len() - 1;
        // The last point of a window is the first of the next.
        let count = if last { keep.len() } else { keep.len() - 1 };
        kept.extend((0..count).filter(|&k| keep[k]).map(|k| distinct[from + k]));
        if last {
            break;
        }
        from = to;
    }
    kept
}

/// How far a point lies from the straight piece between two others, in tolerances.
fn deviation(a: Across, b: Across, p: Across) -> f64 {
    let (off_m, share) = beside_piece(a.centre, b.centre, p.centre);
    let off = off_m / TOLERANCE_M;
    let width = |from: f64, to: f64, here: f64| (from + (to - from) * share - here).abs() / WIDTH_TOLERANCE_M;
    off.max(width(a.left_m, b.left_m, p.left_m)).max(width(a.right_m, b.right_m, p.right_m))
}

/// Thins a plain line.
pub fn thinned_line(points: &[Vec2]) -> Vec<Vec2> {
    let across: Vec<Across> = points.iter().map(|&p| Across::new(p, 0.0, 0.0)).collect();
    thinned(&across).into_iter().map(|a| a.centre).collect()
}

/// Centre, left and right line of equal counts.
pub fn lines(points: &[Across]) -> (Vec<Vec2>, Vec<Vec2>, Vec<Vec2>) {
    let last = points.len().saturating_sub(1);
    let across = |k: usize| {
        let unit = |v: Vec2| if v.norm() > 0.0 { v * (1.0 / v.norm()) } else { Vec2::ZERO };
        let before = unit(points[k].centre - points[k.saturating_sub(1)].centre);
        let after = unit(points[(k + 1).min(last)].centre - points[k].centre);
        unit(before + after).left()
    };
    let side = |offset: &dyn Fn(&Across) -> f64| {
        (0..points.len()).map(|k| points[k].centre + across(k) * offset(&points[k])).collect()
    };
    (points.iter().map(|p| p.centre).collect(), side(&|p| p.left_m), side(&|p| -p.right_m))
}

/// Half widths of a lane from the outline of its surface: how far it reaches to either side of each point. They stay
/// unknown if the outline is invalid or far too large.
pub fn widths_within(centre: &[Vec2], outline: &[Vec2]) -> Vec<Across> {
    const EFFORT_MAX: usize = 200_000;
    let plain: Vec<Across> = centre.iter().map(|&p| Across::new(p, 0.0, 0.0)).collect();
    let thin = thinned(&plain);
    if outline.len() < 3 || outline.len().saturating_mul(thin.len()) > EFFORT_MAX {
        return thin;
    }
    let last = thin.len().saturating_sub(1);
    let reach = |from: Vec2, direction: Vec2| {
        let hits = (0..outline.len()).filter_map(|k| {
            let (a, b) = (outline[k], outline[(k + 1) % outline.len()]);
            let edge = b - a;
            let down = direction.cross(edge);
            let along = (a - from).cross(edge) / down;
            let share = (a - from).cross(direction) / down;
            (down != 0.0 && along > 0.0 && (0.0..=1.0).contains(&share)).then_some(along)
        });
        hits.fold(f64::INFINITY, f64::min)
    };
    (0..thin.len())
        .map(|k| {
            let along = thin[(k + 1).min(last)].centre - thin[k.saturating_sub(1)].centre;
            let left = along.left() * (1.0 / along.norm().max(1e-9));
            let here = thin[k].centre;
            Across::new(here, reach(here, left), reach(here, -left))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Polyline, num};

    #[test]
    fn thinning_keeps_shape_and_drops_what_is_straight() {
        let bend = |k: usize| {
            let angle = k as f64 * 0.005;
            Vec2::new(100.0 * num::sin(angle), 100.0 - 100.0 * num::cos(angle))
        };
        let points: Vec<Vec2> =
            (0..=40).map(|k| Vec2::new(-20.0 + 0.5 * k as f64, 0.0)).chain((1..2000).map(bend)).collect();
        let thin = thinned_line(&points);
        assert!(thin.len() < points.len() / 5, "{}", thin.len());
        let line = Polyline::new(thin).unwrap();
        let off = points.iter().map(|p| line.project(*p).offset_m.abs()).fold(0.0, f64::max);
        assert!(off <= TOLERANCE_M + 1e-9, "{off}");
    }

    #[test]
    fn a_change_of_width_keeps_its_place() {
        let width = |k: usize| if k < 50 { 1.5 } else { 2.4 };
        let points: Vec<Across> = (0..100).map(|k| Across::new(Vec2::new(k as f64, 0.0), width(k), 1.5)).collect();
        let thin = thinned(&points);
        assert_eq!(thin.iter().map(|a| a.centre.x as usize).collect::<Vec<_>>(), [0, 49, 50, 99]);
    }

    #[test]
    fn unknown_and_wild_widths_are_replaced() {
        let across = Across::new(Vec2::ZERO, 0.0, 13.0);
        assert_eq!((across.left_m, across.right_m), (HALF_WIDTH_UNKNOWN_M, HALF_WIDTH_MAX_M));
        assert_eq!(Across::new(Vec2::ZERO, f64::NAN, 0.2).right_m, HALF_WIDTH_MIN_M);
    }

    #[test]
    fn an_outline_gives_the_width_to_either_side() {
        let outline = [(0.0, -1.4), (20.0, -1.4), (20.0, 2.1), (0.0, 2.1)].map(|(x, y)| Vec2::new(x, y));
        let found = widths_within(&[Vec2::new(1.0, 0.0), Vec2::new(19.0, 0.0)], &outline);
        assert!(found.iter().all(|a| (a.left_m - 2.1).abs() < 1e-9 && (a.right_m - 1.4).abs() < 1e-9));
        let (centre, left, right) = lines(&found);
        assert_eq!((centre[0], left[0].y > 2.0, right[1].y < -1.3), (Vec2::new(1.0, 0.0), true, true));
    }
}
