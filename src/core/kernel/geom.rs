//! Plane geometry in metres and radians, right-handed, angles counter-clockwise from +x.

use serde::{Deserialize, Serialize};
use std::ops::{Add, Mul, Neg, Sub};

use super::num;

/// A point or a displacement, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 2]", into = "[f64; 2]")]
pub struct Vec2 {
    /// First coordinate, metres; headings count from its axis.
    pub x: f64,
    /// Second coordinate, metres; to the left of the first axis.
    pub y: f64,
}

impl From<[f64; 2]> for Vec2 {
    fn from([x, y]: [f64; 2]) -> Vec2 {
        Vec2 { x, y }
    }
}

impl From<Vec2> for [f64; 2] {
    fn from(v: Vec2) -> [f64; 2] {
        [v.x, v.y]
    }
}

impl Vec2 {
    /// The origin.
    pub const ZERO: Vec2 = Vec2 { x: 0.0, y: 0.0 };

    /// The point or displacement (x, y).
    pub const fn new(x: f64, y: f64) -> Vec2 {
        Vec2 { x, y }
    }

    /// Unit vector of a heading.
    pub fn from_heading(heading_rad: f64) -> Vec2 {
        let (sin, cos) = num::sin_cos(heading_rad);
        Vec2 { x: cos, y: sin }
    }

    /// Scalar product, m².
    pub fn dot(self, other: Vec2) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// z of the cross product: positive when `other` lies to the left of `self`.
    pub fn cross(self, other: Vec2) -> f64 {
        self.x * other.y - self.y * other.x
    }

    /// Square of the length, m².
    pub fn norm_squared(self) -> f64 {
        self.dot(self)
    }

    /// Length, metres.
    pub fn norm(self) -> f64 {
        self.norm_squared().sqrt()
    }

    /// Distance between two points, metres.
    pub fn distance(self, other: Vec2) -> f64 {
        (self - other).norm()
    }

    /// Direction of a displacement; 0 for the zero vector.
    pub fn heading(self) -> f64 {
        num::atan2(self.y, self.x)
    }

    /// Returns it turned left by 90 degrees.
    pub fn left(self) -> Vec2 {
        Vec2 { x: -self.y, y: self.x }
    }

    /// Returns it turned by an angle, counter-clockwise.
    pub fn rotated(self, angle_rad: f64) -> Vec2 {
        let (sin, cos) = num::sin_cos(angle_rad);
        Vec2 { x: self.x * cos - self.y * sin, y: self.x * sin + self.y * cos }
    }

    /// The point at `share` of the way to `other`: 0 here, 1 there.
    pub fn lerp(self, other: Vec2, share: f64) -> Vec2 {
        self + (other - self) * share
    }

    /// Returns `true` if neither coordinate is NaN or infinite.
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite()
    }
}

impl Add for Vec2 {
    type Output = Vec2;
    fn add(self, other: Vec2) -> Vec2 {
        Vec2 { x: self.x + other.x, y: self.y + other.y }
    }
}

impl Sub for Vec2 {
    type Output = Vec2;
    fn sub(self, other: Vec2) -> Vec2 {
        Vec2 { x: self.x - other.x, y: self.y - other.y }
    }
}

impl Mul<f64> for Vec2 {
    type Output = Vec2;
    fn mul(self, factor: f64) -> Vec2 {
        Vec2 { x: self.x * factor, y: self.y * factor }
    }
}

impl Neg for Vec2 {
    type Output = Vec2;
    fn neg(self) -> Vec2 {
        Vec2 { x: -self.x, y: -self.y }
    }
}

/// A place and a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Place, metres.
    pub position: Vec2,
    /// Counter-clockwise from +x.
    pub heading_rad: f64,
}

impl Pose {
    /// `point` seen from here: x ahead, y to the left.
    pub fn to_local(self, point: Vec2) -> Vec2 {
        let forward = Vec2::from_heading(self.heading_rad);
        let delta = point - self.position;
        Vec2 { x: delta.dot(forward), y: forward.cross(delta) }
    }
}

/// The footprint of a road user: a rectangle with its centre, half extents and unit axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    /// Centre, metres.
    pub center: Vec2,
    /// Unit vector along the length.
    pub axis: Vec2,
    /// Half the length, metres.
    pub half_length_m: f64,
    /// Half the width, metres.
    pub half_width_m: f64,
}

impl OrientedBox {
    /// The box of a road user at a place.
    pub fn new(center: Vec2, heading_rad: f64, length_m: f64, width_m: f64) -> OrientedBox {
        OrientedBox::along(center, Vec2::from_heading(heading_rad), length_m, width_m)
    }

    /// The box of a road user at a place, given the unit vector of its heading.
    pub fn along(center: Vec2, axis: Vec2, length_m: f64, width_m: f64) -> OrientedBox {
        OrientedBox { center, axis, half_length_m: 0.5 * length_m, half_width_m: 0.5 * width_m }
    }

    /// Front-left, rear-left, rear-right, front-right: counter-clockwise.
    pub fn corners(&self) -> [Vec2; 4] {
        let along = self.axis * self.half_length_m;
        let across = self.axis.left() * self.half_width_m;
        let c = self.center;
        [c + along + across, c - along + across, c - along - across, c + along - across]
    }

    /// Radius of the circle around the centre that holds the box.
    pub fn radius(&self) -> f64 {
        (self.half_length_m * self.half_length_m + self.half_width_m * self.half_width_m).sqrt()
    }

    /// Returns `true` if the boxes share a point (separating axes; touching counts).
    pub fn overlaps(&self, other: &OrientedBox) -> bool {
        let delta = other.center - self.center;
        let along = self.axis.dot(other.axis).abs();
        let across = self.axis.cross(other.axis).abs();
        let apart = |axis: Vec2, own: f64, length_share: f64, width_share: f64, b: &OrientedBox| {
            delta.dot(axis).abs() > own + b.half_length_m * length_share + b.half_width_m * width_share
        };
        !(apart(self.axis, self.half_length_m, along, across, other)
            || apart(self.axis.left(), self.half_width_m, across, along, other)
            || apart(other.axis, other.half_length_m, along, across, self)
            || apart(other.axis.left(), other.half_width_m, across, along, self))
    }

    /// Smallest distance between the boxes, metres; 0 when they overlap.
    pub fn distance(&self, other: &OrientedBox) -> f64 {
        if self.overlaps(other) {
            return 0.0;
        }
        // Two convex polygons that do not overlap are nearest at a corner of one of them.
        let to_box = |points: [Vec2; 4], target: &OrientedBox| {
            points.iter().map(|p| target.squared_distance_to_point(*p)).fold(f64::INFINITY, f64::min)
        };
        // A larger square never has a smaller root, so one root will do.
        to_box(self.corners(), other).min(to_box(other.corners(), self)).sqrt()
    }

    /// Square of the distance from the box to a point, square metres; 0 inside.
    fn squared_distance_to_point(&self, point: Vec2) -> f64 {
        let delta = point - self.center;
        let along = (delta.dot(self.axis).abs() - self.half_length_m).max(0.0);
        let across = (self.axis.cross(delta).abs() - self.half_width_m).max(0.0);
        along * along + across * across
    }
}

/// A rectangle along the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Its lowest corner, metres.
    pub low: Vec2,
    /// Its highest corner, metres.
    pub high: Vec2,
}

impl Extent {
    /// Returns the rectangle around some places; without places it meets nothing.
    pub fn around(places: impl IntoIterator<Item = Vec2>) -> Extent {
        let nowhere = Vec2::new(f64::INFINITY, f64::INFINITY);
        places.into_iter().fold(Extent { low: nowhere, high: -nowhere }, |Extent { low, high }, place| Extent {
            low: Vec2::new(low.x.min(place.x), low.y.min(place.y)),
            high: Vec2::new(high.x.max(place.x), high.y.max(place.y)),
        })
    }

    /// Returns the rectangle widened by this margin on every side, metres.
    pub fn grown(&self, margin_m: f64) -> Extent {
        let margin = Vec2::new(margin_m, margin_m);
        Extent { low: self.low - margin, high: self.high + margin }
    }

    /// Returns `true` if the two share a point.
    pub fn meets(&self, other: &Extent) -> bool {
        self.low.x <= other.high.x
            && self.high.x >= other.low.x
            && self.low.y <= other.high.y
            && self.high.y >= other.low.y
    }
}

/// Nearest place on a polyline to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Arc length of the nearest point, metres.
    pub s_m: f64,
    /// Signed lateral offset, positive to the left, metres.
    pub offset_m: f64,
    /// Direction of the segment there.
    pub heading_rad: f64,
    /// Index of the segment.
    pub segment: usize,
}

/// One point of a line in this many serves as a bound for the distance to the line.
const COARSE: usize = 16;
/// Bound on the rounding of a distance or a length, metres.
const SLACK_M: f64 = 1e-3;

/// A path with arc length. At least two points, no zero-length segment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Vec2>", into = "Vec<Vec2>")]
pub struct Polyline {
    points: Vec<Vec2>,
    /// Arc length at each point; the first is 0.
    lengths: Vec<f64>,
}

/// Points that cannot be a path.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PolylineError {
    /// Fewer than two different points; it holds how many.
    #[error("a path needs two points that differ, found {0}")]
    TooShort(usize),
    /// A point is NaN or infinite; it holds the index.
    #[error("point {0} of the path is not finite")]
    NotFinite(usize),
}

impl TryFrom<Vec<Vec2>> for Polyline {
    type Error = PolylineError;
    fn try_from(points: Vec<Vec2>) -> Result<Polyline, PolylineError> {
        Polyline::new(points)
    }
}

impl From<Polyline> for Vec<Vec2> {
    fn from(line: Polyline) -> Vec<Vec2> {
        line.points
    }
}

impl Polyline {
    /// Consecutive points closer than 1 nm are one point.
    pub fn new(points: Vec<Vec2>) -> Result<Polyline, PolylineError> {
        if let Some(bad) = points.iter().position(|p| !p.is_finite()) {
            return Err(PolylineError::NotFinite(bad));
        }
        let mut kept: Vec<Vec2> = Vec::with_capacity(points.len());
        let mut lengths = Vec::with_capacity(points.len());
        for point in points {
            match kept.last() {
                None => lengths.push(0.0),
                Some(last) => {
                    let step = last.distance(point);
                    if step < 1e-9 {
                        continue;
                    }
                    lengths.push(lengths[lengths.len() - 1] + step);
                }
            }
            kept.push(point);
        }
        if kept.len() < 2 {
            return Err(PolylineError::TooShort(kept.len()));
        }
        Ok(Polyline { points: kept, lengths })
    }

    /// Its points, metres. `[points]`
    pub fn points(&self) -> &[Vec2] {
        &self.points
    }

    /// Arc length at each point, metres.
    pub fn lengths(&self) -> &[f64] {
        &self.lengths
    }

    /// Its points and the arc length at each, metres.
    pub fn into_parts(self) -> (Vec<Vec2>, Vec<f64>) {
        (self.points, self.lengths)
    }

    /// Arc length from the first point to the last, metres.
    pub fn length_m(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    /// The segment that holds arc length `s`; the ends hold what lies beyond them.
    pub fn segment_at(&self, s_m: f64) -> usize {
        self.lengths.partition_point(|&l| l <= s_m).clamp(1, self.points.len() - 1) - 1
    }

    /// The point at arc length `s`, running straight on beyond both ends.
    pub fn at(&self, s_m: f64) -> Vec2 {
        let i = self.segment_at(s_m);
        let span = self.lengths[i + 1] - self.lengths[i];
        self.points[i].lerp(self.points[i + 1], (s_m - self.lengths[i]) / span)
    }

    /// Direction of the segment at arc length `s`.
    pub fn heading_at(&self, s_m: f64) -> f64 {
        self.segment_heading(self.segment_at(s_m))
    }

    /// Direction of a segment, radians.
    pub fn segment_heading(&self, segment: usize) -> f64 {
        (self.points[segment + 1] - self.points[segment]).heading()
    }

    /// Nearest place on the path; if two are equally near, the first. Beyond the ends `s` is clamped.
    ///
    /// A line is no nearer than a point of it is, less the way along the line from that point. Stretches that are passed over for this
    /// reason make the search short, and its answer is that of [`Polyline::project_within`] over all segments.
    pub fn project(&self, point: Vec2) -> Projection {
        let last = self.points.len() - 1;
        let coarse = self.points.iter().step_by(COARSE).map(|at| (*at - point).norm_squared());
        let mut bound_m = coarse.fold(f64::INFINITY, f64::min).sqrt() + SLACK_M;
        let (mut best, mut best_share, mut best_distance) = (0, 0.0, f64::INFINITY);
        // The line up to there is too far away.
        let mut passed_m = f64::NEG_INFINITY;
        for i in 0..last {
            if self.lengths[i + 1] < passed_m {
                continue;
            }
            passed_m = self.lengths[i] + ((self.points[i] - point).norm() - bound_m);
            if self.lengths[i + 1] < passed_m {
                continue;
            }
            let (share, distance) = self.nearest_of(i, point);
            if distance < best_distance {
                (best, best_share, best_distance) = (i, share, distance);
                bound_m = bound_m.min(distance.sqrt() + SLACK_M);
            }
        }
        self.projection(point, best, best_share, best_distance)
    }

    /// [`Polyline::project`] restricted to segments `from..to` (a window around a known place is cheaper).
    pub fn project_within(&self, point: Vec2, from: usize, to: usize) -> Projection {
        let to = to.clamp(1, self.points.len() - 1);
        let from = from.min(to - 1);
        let (mut best, mut best_share, mut best_distance) = (from, 0.0, f64::INFINITY);
        for i in from..to {
            let (share, distance) = self.nearest_of(i, point);
            if distance < best_distance {
                (best, best_share, best_distance) = (i, share, distance);
            }
        }
        self.projection(point, best, best_share, best_distance)
    }

    /// The share of a segment at which it is nearest, and the squared distance there.
    fn nearest_of(&self, segment: usize, point: Vec2) -> (f64, f64) {
        let (a, b) = (self.points[segment], self.points[segment + 1]);
        let along = b - a;
        let share = ((point - a).dot(along) / along.norm_squared()).clamp(0.0, 1.0);
        (share, (point - a.lerp(b, share)).norm_squared())
    }

    fn projection(&self, point: Vec2, i: usize, share: f64, distance_squared: f64) -> Projection {
        let along = self.points[i + 1] - self.points[i];
        let side = along.cross(point - self.points[i]);
        let distance = distance_squared.sqrt();
        Projection {
            s_m: self.lengths[i] + share * (self.lengths[i + 1] - self.lengths[i]),
            offset_m: if side < 0.0 { -distance } else { distance },
            heading_rad: along.heading(),
            segment: i,
        }
    }

    /// Points every `spacing` metres, both ends kept.
    pub fn resampled(&self, spacing_m: f64) -> Polyline {
        let pieces = (self.length_m() / spacing_m).ceil().max(1.0) as usize;
        let points = (0..=pieces).map(|k| self.at(self.length_m() * k as f64 / pieces as f64)).collect();
        Polyline::new(points).unwrap_or_else(|_| self.clone())
    }
}

/// Returns `true` if the open segments `a-b` and `c-d` cross or touch.
pub fn segments_cross(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> bool {
    let side = |p: Vec2, q: Vec2, r: Vec2| (q - p).cross(r - p);
    let (d1, d2) = (side(c, d, a), side(c, d, b));
    let (d3, d4) = (side(a, b, c), side(a, b, d));
    ((d1 > 0.0) != (d2 > 0.0)) && ((d3 > 0.0) != (d4 > 0.0))
}

/// Returns the distance of a point from the straight piece between two others, metres, and the share of it, 0..=1, where it is nearest.
pub fn beside_piece(a: Vec2, b: Vec2, point: Vec2) -> (f64, f64) {
    let along = b - a;
    let length = along.norm_squared();
    let share = if length > 0.0 { ((point - a).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
    (point.distance(a.lerp(b, share)), share)
}

/// Returns `true` for each of `count` points of a line that it needs (Ramer 1972; Douglas and Peucker 1973): its ends, and, worst first,
/// those whose excess over the piece between two kept ones, `excess(from, to, k)`, is above 1.
pub fn needed_points(count: usize, excess: impl Fn(usize, usize, usize) -> f64) -> Vec<bool> {
    let mut needed = vec![false; count];
    let Some(last) = count.checked_sub(1) else { return needed };
    (needed[0], needed[last]) = (true, true);
    let mut open = vec![(0, last)];
    while let Some((from, to)) = open.pop() {
        let mut worst = (1.0, from);
        for k in from + 1..to {
            let excess = excess(from, to, k);
            if excess > worst.0 {
                worst = (excess, k);
            }
        }
        if worst.1 > from {
            needed[worst.1] = true;
            open.extend([(from, worst.1), (worst.1, to)]);
        }
    }
    needed
}

/// Returns `true` if a point lies inside a polygon (even-odd rule).
pub fn polygon_contains(polygon: &[Vec2], point: Vec2) -> bool {
    let mut inside = false;
    for (i, a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if (a.y > point.y) != (b.y > point.y) {
            let x = a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x);
            if point.x < x {
                inside = !inside;
            }
        }
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parry_shape(b: &OrientedBox) -> (parry2d_f64::math::Pose, parry2d_f64::shape::Cuboid) {
        use parry2d_f64::math::{Pose, Vector};
        let pose = Pose::new(Vector::new(b.center.x, b.center.y), b.axis.heading());
        (pose, parry2d_f64::shape::Cuboid::new(Vector::new(b.half_length_m, b.half_width_m)))
    }

    proptest! {
        #[test]
        fn what_is_passed_over_changes_no_projection(
            turns in prop::collection::vec((-1.6..1.6f64, 0.0..4.0f64), 1..90), away in prop::sample::select(vec![0.0, 5e6]),
            x in -60.0..60.0f64, y in -60.0..60.0f64, whole in any::<bool>(),
        ) {
            let mut points = vec![Vec2::new(away, -away)];
            let mut heading_rad = 0.0;
            for (turn_rad, length_m) in turns {
                heading_rad += turn_rad;
                let to = points[points.len() - 1] + Vec2::from_heading(heading_rad) * (0.1 + length_m);
                // On whole metres lines meet themselves, and places are equally near to several segments.
                points.push(if whole { Vec2::new(to.x.round(), to.y.round()) } else { to });
            }
            points.dedup();
            prop_assume!(points.len() > 1);
            let line = Polyline::new(points).unwrap();
            let at = if whole { Vec2::new(x.round(), y.round()) } else { Vec2::new(x, y) };
            let at = at + Vec2::new(away, -away);
            prop_assert_eq!(line.project(at), line.project_within(at, 0, usize::MAX));
        }

        #[test]
        fn overlap_and_distance_agree_with_parry(
            x in -8.0..8.0f64, y in -8.0..8.0f64, h1 in -4.0..4.0f64, h2 in -4.0..4.0f64,
            l1 in 0.5..6.0f64, w1 in 0.5..3.0f64, l2 in 0.5..6.0f64, w2 in 0.5..3.0f64,
        ) {
            let a = OrientedBox::new(Vec2::new(1.0, -2.0), h1, l1, w1);
            let b = OrientedBox::new(Vec2::new(x, y), h2, l2, w2);
            let ((pa, sa), (pb, sb)) = (parry_shape(&a), parry_shape(&b));
            let exact = parry2d_f64::query::distance(&pa, &sa, &pb, &sb).unwrap().distance;
            prop_assert!((a.distance(&b) - exact).abs() < 1e-6, "{} {}", a.distance(&b), exact);
            if exact > 1e-6 {
                prop_assert!(!a.overlaps(&b));
            }
            // The one root of the least square is, to the bit, the least of eight roots.
            if !a.overlaps(&b) {
                let to = |points: [Vec2; 4], target: &OrientedBox| points.map(|p| target.squared_distance_to_point(p).sqrt());
                let plain = to(a.corners(), &b).into_iter().chain(to(b.corners(), &a)).fold(f64::INFINITY, f64::min);
                prop_assert_eq!(a.distance(&b).to_bits(), plain.to_bits());
            }
        }

        #[test]
        fn projecting_a_point_beside_a_path_gives_its_place_and_side(s in 0.5..19.5f64, offset in -1.0..1.0f64) {
            let line = Polyline::new((0..=10).map(|k| Vec2::new(2.0 * k as f64, 0.0)).collect()).unwrap();
            let found = line.project(Vec2::new(s, offset));
            prop_assert!((found.s_m - s).abs() < 1e-9);
            prop_assert!((found.offset_m - offset).abs() < 1e-9);
        }
    }

    #[test]
    fn a_path_of_one_place_is_refused() {
        assert_eq!(Polyline::new(vec![Vec2::ZERO; 4]), Err(PolylineError::TooShort(1)));
        assert_eq!(Polyline::new(vec![Vec2::new(f64::NAN, 0.0)]), Err(PolylineError::NotFinite(0)));
    }

    #[test]
    fn a_path_runs_straight_on_beyond_its_ends() {
        let line = Polyline::new(vec![Vec2::ZERO, Vec2::new(10.0, 0.0)]).unwrap();
        assert_eq!(line.at(12.0), Vec2::new(12.0, 0.0));
        assert_eq!(line.at(-1.0), Vec2::new(-1.0, 0.0));
    }
}
