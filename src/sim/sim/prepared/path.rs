//! A path to drive along: arc length, direction, and projection near a known place.

use crate::kernel::{Polyline, Vec2};

/// Distance below which points of a driven path are one point, metres: a standing car's jitter is no direction.
pub const ROUTE_SPACING_M: f64 = 0.5;
/// Length that the straight pieces of MetaDrive's lane along a path exceed, metres.
pub const LANE_SPACING_M: f64 = 1.0;

/// A place beside a route.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Along {
    /// Arc length, metres; negative before the start, beyond the length after the end.
    pub s_m: f64,
    /// Signed lateral offset, positive to the left, metres.
    pub offset_m: f64,
    /// Segment that holds the nearest point.
    pub segment: usize,
}

/// A polyline with unit directions, running straight on beyond both ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    points: Vec<Vec2>,
    directions: Vec<Vec2>,
    /// Headings of all segments, or empty: each costs an arc tangent, and a path made for one rollout does not need them.
    headings_rad: Vec<f64>,
    lengths: Vec<f64>,
}

/// Squared distance from the path beyond which, if also twice as far as the best so far, a place is worth two roots, m².
const WORTH_A_LEAP_M2: f64 = 9.0;
/// Allowance for rounding of lengths and distances, metres.
const SURE_M: f64 = 1e-6;

impl Path {
    /// The path through `points`, thinned to [`ROUTE_SPACING_M`]. A path shorter than that becomes a metre straight
    /// ahead of its first point in direction `heading_rad`. `None` if a point is not finite or there is none.
    pub fn new(points: &[Vec2], heading_rad: f64) -> Option<Path> {
        Path::bare(points, heading_rad).map(Path::with_headings)
    }

    /// Does the same as [`Path::new`] for callers that hardly need headings: they are computed when they are asked for.
    pub fn bare(points: &[Vec2], heading_rad: f64) -> Option<Path> {
        Path::thinned(points, heading_rad, |apart_m| apart_m >= ROUTE_SPACING_M)
    }

    /// Makes the lane that MetaDrive makes of a path (`PointLane`): its heading jumps from piece to piece.
    pub fn lane(points: &[Vec2], heading_rad: f64) -> Option<Path> {
        Path::thinned(points, heading_rad, |apart_m| apart_m > LANE_SPACING_M).map(Path::with_headings)
    }

    fn thinned(points: &[Vec2], heading_rad: f64, are_apart: impl Fn(f64) -> bool) -> Option<Path> {
        let first = *points.first()?;
        if !points.iter().all(|p| p.is_finite()) {
            return None;
        }
        let mut kept = Vec::with_capacity(points.len());
        kept.push(first);
        for &point in &points[1..] {
            if are_apart(kept[kept.len() - 1].distance(point)) {
                kept.push(point);
            }
        }
        // The exact end is kept: arrival is measured against it.
        let end = points[points.len() - 1];
        if kept.len() > 1 && kept[kept.len() - 1].distance(end) > 1e-6 {
            kept.push(end);
        }
        if kept.len() == 1 {
            kept.push(first + Vec2::from_heading(heading_rad));
        }
        Polyline::new(kept).ok().map(Path::through)
    }

    /// Does the same as [`Path::new`], and leaves out every point that lies within `tolerance_m` of the line without it.
    pub fn simplified(points: &[Vec2], heading_rad: f64, tolerance_m: f64) -> Option<Path> {
        let fine = Path::bare(points, heading_rad)?.points;
        let mut kept = vec![fine[0]];
        let mut from = 0;
        while from + 1 < fine.len() {
            from = longest_chord(&fine, from, tolerance_m);
            kept.push(fine[from]);
        }
        Polyline::new(kept).ok().map(Path::through).map(Path::with_headings)
    }

    fn through(line: Polyline) -> Path {
        let (points, lengths) = line.into_parts();
        let directions: Vec<Vec2> =
            points.windows(2).zip(lengths.windows(2)).map(|(p, l)| (p[1] - p[0]) * (1.0 / (l[1] - l[0]))).collect();
        Path { points, directions, headings_rad: Vec::new(), lengths }
    }

    fn with_headings(mut self) -> Path {
        self.headings_rad = self.directions.iter().map(|d| d.heading()).collect();
        self
    }

    /// Returns the corners of its line, at least two, metres.
    pub fn points(&self) -> &[Vec2] {
        &self.points
    }

    /// Returns the length from its first point to its last, metres.
    pub fn length_m(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    /// Returns the segment that holds arc length `s`, searched from a known segment.
    pub fn segment_near(&self, s_m: f64, known: usize) -> usize {
        let last = self.directions.len() - 1;
        let mut i = known.min(last);
        while i > 0 && self.lengths[i] > s_m {
            i -= 1;
        }
        while i < last && self.lengths[i + 1] <= s_m {
            i += 1;
        }
        i
    }

    /// Returns the point at arc length `s`.
    pub fn at(&self, s_m: f64, known: usize) -> Vec2 {
        let i = self.segment_near(s_m, known);
        self.points[i] + self.directions[i] * (s_m - self.lengths[i])
    }

    /// Returns the heading of the segment at arc length `s`, (-π, π].
    pub fn heading_at(&self, s_m: f64, known: usize) -> f64 {
        let segment = self.segment_near(s_m, known);
        self.headings_rad.get(segment).copied().unwrap_or_else(|| self.directions[segment].heading())
    }

    /// Returns the unit direction of a segment.
    pub fn direction(&self, segment: usize) -> Vec2 {
        self.directions[segment.min(self.directions.len() - 1)]
    }

    /// Returns the nearest place on the whole route; the first of equals.
    pub fn project(&self, point: Vec2) -> Along {
        self.project_between(point, 0, f64::INFINITY)
    }

    /// Returns the nearest place not more than `back_m` before and `ahead_m` after a known place; the first of equals.
    pub fn project_near(&self, point: Vec2, known: &Along, back_m: f64, ahead_m: f64) -> Along {
        let first = self.segment_near(known.s_m - back_m, known.segment);
        self.project_between(point, first, known.s_m + ahead_m)
    }

    /// Returns a place on the line through the segment of `near`, which runs on beyond both ends of the segment: MetaDrive's
    /// `local_coordinates`.
    pub fn on_line_of(&self, near: &Along, point: Vec2) -> Along {
        let (delta, direction) = (point - self.points[near.segment], self.directions[near.segment]);
        let s_m = self.lengths[near.segment] + delta.dot(direction);
        Along { s_m, offset_m: direction.cross(delta), segment: near.segment }
    }

    fn project_between(&self, point: Vec2, first: usize, until_s_m: f64) -> Along {
        let last = self.directions.len() - 1;
        let (mut best, mut best_squared) = ((first.min(last), 0.0), f64::INFINITY);
        let mut i = first.min(last);
        while i <= last {
            if self.lengths[i] > until_s_m && best_squared.is_finite() {
                break;
            }
            let delta = point - self.points[i];
            let mut along = delta.dot(self.directions[i]);
            // The first and the last segment run on beyond the ends.
            if i > 0 {
                along = along.max(0.0);
            }
            if i < last {
                along = along.min(self.lengths[i + 1] - self.lengths[i]);
            }
            let squared = (delta - self.directions[i] * along).norm_squared();
            if squared < best_squared {
                (best, best_squared) = ((i, along), squared);
            } else if squared > 4.0 * best_squared + WORTH_A_LEAP_M2 {
                // A path comes nearer by no more than its length: a piece that ends sooner than that is farther away than the best.
                let free_m = squared.sqrt() - best_squared.sqrt() - SURE_M;
                let until_m = self.lengths[i] + along + free_m;
                while i + 1 < last && self.lengths[i + 2] < until_m {
                    i += 1;
                }
            }
            i += 1;
        }
        let (i, along) = best;
        let side = self.directions[i].cross(point - self.points[i]);
        let distance = best_squared.sqrt();
        Along { s_m: self.lengths[i] + along, offset_m: if side < 0.0 { -distance } else { distance }, segment: i }
    }
}

/// Returns the end of a long chord from point `from` that holds: doubled while it does, then halved back.
fn longest_chord(points: &[Vec2], from: usize, tolerance_m: f64) -> usize {
    let holds = |to: usize| chord_holds(&points[from..=to], tolerance_m);
    let last = points.len() - 1;
    let mut good = from + 1;
    let mut bad = last + 1;
    while good < last {
        let to = (from + 2 * (good - from)).min(last);
        if !holds(to) {
            bad = to;
            break;
        }
        good = to;
    }
    while good + 1 < bad.min(last + 1) {
        let middle = good + (bad - good) / 2;
        if holds(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    good
}

/// Returns `true` if all inner points lie within `tolerance_m` of the chord between the ends.
fn chord_holds(points: &[Vec2], tolerance_m: f64) -> bool {
    let (a, b) = (points[0], points[points.len() - 1]);
    let along = b - a;
    let squared = along.norm_squared();
    if squared < 1e-12 {
        return false;
    }
    points[1..points.len() - 1].iter().all(|&p| {
        let share = ((p - a).dot(along) / squared).clamp(0.0, 1.0);
        (p - a.lerp(b, share)).norm_squared() <= tolerance_m * tolerance_m
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// [`Path::project_between`] by looking at every segment.
    fn project_by_walk(path: &Path, point: Vec2, first: usize, until_s_m: f64) -> Along {
        let last = path.directions.len() - 1;
        let places = (first.min(last)..=last).map_while(|i| {
            let is_first = i == first.min(last);
            (is_first || path.lengths[i] <= until_s_m).then(|| {
                let delta = point - path.points[i];
                let least = if i > 0 { 0.0 } else { f64::NEG_INFINITY };
                let most = if i < last { path.lengths[i + 1] - path.lengths[i] } else { f64::INFINITY };
                let along = delta.dot(path.directions[i]).max(least).min(most);
                (i, along, (delta - path.directions[i] * along).norm_squared())
            })
        });
        let (i, along, squared) = places.reduce(|best, one| if one.2 < best.2 { one } else { best }).unwrap();
        let side = path.directions[i].cross(point - path.points[i]);
        let offset_m = if side < 0.0 { -squared.sqrt() } else { squared.sqrt() };
        Along { s_m: path.lengths[i] + along, offset_m, segment: i }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(600))]

        #[test]
        fn what_is_leapt_over_changes_no_place(
            turns in prop::collection::vec(-1.2..1.2f64, 2..80),
            step_m in 0.3..4.0f64,
            at in (-60.0..60.0f64, -60.0..60.0f64),
            near in 0..80usize,
            until_m in prop::option::of(0.0..120.0f64),
        ) {
            let (mut points, mut heading) = (vec![Vec2::ZERO], 0.0);
            for turn in &turns {
                heading += turn * turn * turn;
                points.push(points[points.len() - 1] + Vec2::from_heading(heading) * step_m);
            }
            let path = Path::new(&points, 0.0).unwrap();
            let until_m = until_m.unwrap_or(f64::INFINITY);
            // Anywhere, and beside the path, where a loop comes near again.
            let beside = points[near % points.len()] + Vec2::new(0.01 * at.0, 0.01 * at.1);
            for point in [Vec2::new(at.0, at.1), beside] {
                for first in [0, near] {
                    let (fast, plain) = (path.project_between(point, first, until_m), project_by_walk(&path, point, first, until_m));
                    prop_assert_eq!((fast.segment, fast.s_m.to_bits(), fast.offset_m.to_bits()), (plain.segment, plain.s_m.to_bits(), plain.offset_m.to_bits()));
                }
            }
        }
    }

    #[test]
    fn a_bare_path_has_the_headings_of_a_whole_one() {
        let points: Vec<Vec2> = (0..40).map(|k| Vec2::new(f64::from(k), 0.03 * f64::from(k * k))).collect();
        let (whole, bare) = (Path::new(&points, 0.0).unwrap(), Path::bare(&points, 0.0).unwrap());
        assert_eq!((whole.points(), whole.length_m()), (bare.points(), bare.length_m()));
        for k in 0..120 {
            let s_m = 0.5 * f64::from(k);
            assert_eq!(whole.heading_at(s_m, 0).to_bits(), bare.heading_at(s_m, 0).to_bits(), "{s_m}");
        }
    }
}
