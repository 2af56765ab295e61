//! A lane's centre as a smooth reference line: straight lines where the lane is straight, else parametric cubics
//! through its important points, with the lane's half widths along it.

use crate::kernel::geom::beside_piece;
use crate::kernel::{Vec2, num};
use crate::scene::Lane;

/// Points closer than this are merged, metres.
pub(super) const SAME_PLACE_M: f64 = 1e-3;
/// How far a dropped point or width may lie from what is written, metres.
const TOLERANCE_M: f64 = 0.01;
/// A cubic with a smaller control offset is written as a line, metres.
const STRAIGHT_M: f64 = 1e-6;
/// Least distance from the centre to a boundary, metres, so that every lane has a width.
pub(super) const HALF_WIDTH_M_MIN: f64 = 0.05;

/// A point of the reference line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Station {
    pub point: Vec2,
    pub heading_rad: f64,
    /// From the centre to the boundaries, metres.
    pub left_m: f64,
    pub right_m: f64,
    pub s_m: f64,
}

/// `u(p), v(p)` for p in 0..=1 in axes at the start of the part: coefficients of p, p^2, p^3.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cubic {
    pub u: [f64; 3],
    pub v: [f64; 3],
}

impl Cubic {
    fn speed(&self, p: f64) -> f64 {
        let along = |[b, c, d]: [f64; 3]| b + 2.0 * c * p + 3.0 * d * p * p;
        num::hypot(along(self.u), along(self.v))
    }

    /// Arc length by Gauss-Legendre with five points on each of eight pieces.
    fn length_m(&self) -> f64 {
        const NODES: [(f64, f64); 5] = [
            (0.0, 0.568_888_888_888_888_9),
            (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
            (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
            (0.906_179_845_938_664, 0.236_926_885_056_189_1),
            (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
        ];
        let half = 1.0 / 16.0;
        let piece = |k: usize| {
            let middle = half * (2 * k + 1) as f64;
            num::sum(NODES.iter().map(|(x, weight)| weight * self.speed(middle + half * x))) * half
        };
        num::sum((0..8).map(piece))
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Part {
    pub s_m: f64,
    pub from: Vec2,
    pub heading_rad: f64,
    pub length_m: f64,
    /// `None` for a straight line.
    pub cubic: Option<Cubic>,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Curve {
    pub parts: Vec<Part>,
    /// Ends of the parts. `[parts + 1]`
    pub stations: Vec<Station>,
}

impl Curve {
    pub fn length_m(&self) -> f64 {
        self.parts.last().map_or(0.0, |part| part.s_m + part.length_m)
    }

    /// Arc length and offset to the left of the nearest place, by the chords.
    pub fn nearest(&self, point: Vec2) -> (f64, f64) {
        let mut best = (f64::INFINITY, 0.0, 0.0);
        for pair in self.stations.windows(2) {
            let chord = pair[1].point - pair[0].point;
            let share = ((point - pair[0].point).dot(chord) / chord.norm_squared()).clamp(0.0, 1.0);
            let off = point - pair[0].point.lerp(pair[1].point, share);
            if off.norm() < best.0 {
                let side = if chord.cross(off) >= 0.0 { off.norm() } else { -off.norm() };
                best = (off.norm(), pair[0].s_m + share * (pair[1].s_m - pair[0].s_m), side);
            }
        }
        (best.1, best.2)
    }

    /// A curve through at least two stations at different places.
    pub fn through(stations: &[Station]) -> Curve {
        let kept = thinned(stations);
        let mut curve = Curve { parts: Vec::new(), stations: Vec::new() };
        let mut s_m = 0.0;
        for pair in kept.windows(2) {
            let part = part(s_m, &pair[0], &pair[1]);
            curve.stations.push(Station { s_m, ..pair[0] });
            s_m += part.length_m;
            curve.parts.push(part);
        }
        curve.stations.extend(kept.last().map(|last| Station { s_m, ..*last }));
        curve
    }
}

/// The stations of a lane; `None` if all its points coincide.
pub(super) fn stations_of(lane: &Lane) -> Option<Vec<Station>> {
    let mut picked: Vec<usize> = Vec::new();
    for (k, p) in lane.centre.iter().enumerate() {
        if picked.last().is_none_or(|&last| lane.centre[last].distance(*p) > SAME_PLACE_M) {
            picked.push(k);
        }
    }
    if picked.len() < 2 {
        return None;
    }
    // The end stays where the next lane begins.
    if let Some(last) = picked.last_mut() {
        *last = lane.centre.len() - 1;
    }
    let at = |i: usize| lane.centre[picked[i]];
    let headings: Vec<f64> = (0..picked.len())
        .map(|i| {
            let (before, after) = (at(i.saturating_sub(1)), at((i + 1).min(picked.len() - 1)));
            let along = after - before;
            let ahead = if i + 1 < picked.len() { at(i + 1) - at(i) } else { at(i) - at(i - 1) };
            if along.norm() > SAME_PLACE_M { bisector(at(i), before, after) } else { ahead.heading() }
        })
        .collect();
    let station = |i: usize| {
        let k = picked[i];
        let aside = Vec2::from_heading(headings[i]).left();
        let half = |side: Vec2, sign: f64| ((side - lane.centre[k]).dot(aside) * sign).max(HALF_WIDTH_M_MIN);
        Station {
            point: lane.centre[k],
            heading_rad: headings[i],
            left_m: half(lane.left[k], 1.0),
            right_m: half(lane.right[k], -1.0),
            s_m: 0.0,
        }
    };
    Some((0..picked.len()).map(station).collect())
}

/// Direction at the middle of three points of the circle through them; at an end the direction of the chord.
fn bisector(here: Vec2, before: Vec2, after: Vec2) -> f64 {
    let (back, ahead) = (here - before, after - here);
    if back.norm() <= SAME_PLACE_M || ahead.norm() <= SAME_PLACE_M {
        return (after - before).heading();
    }
    // The shorter chord is closer to the tangent, so it has more weight.
    let turn = num::wrap_angle(ahead.heading() - back.heading());
    num::wrap_angle(back.heading() + turn * back.norm() / (back.norm() + ahead.norm()))
}

/// The first `length_m` metres, and the rest. Both contain the station at the cut. A cut at an end leaves one of them
/// empty.
pub(super) fn cut(stations: &[Station], length_m: f64) -> (Vec<Station>, Vec<Station>) {
    let mut run = 0.0;
    for k in 1..stations.len() {
        let (a, b) = (&stations[k - 1], &stations[k]);
        let step = a.point.distance(b.point);
        if run + step > length_m {
            let share = (length_m - run) / step;
            let turn = num::wrap_angle(b.heading_rad - a.heading_rad);
            let between = Station {
                point: a.point.lerp(b.point, share),
                heading_rad: num::wrap_angle(a.heading_rad + turn * share),
                left_m: a.left_m + share * (b.left_m - a.left_m),
                right_m: a.right_m + share * (b.right_m - a.right_m),
                s_m: 0.0,
            };
            let head = stations[..k].iter().copied().filter(|s| s.point.distance(between.point) > SAME_PLACE_M);
            let tail = stations[k..].iter().copied().filter(|s| s.point.distance(between.point) > SAME_PLACE_M);
            return (head.chain([between]).collect(), [between].into_iter().chain(tail).collect());
        }
        run += step;
    }
    (stations.to_vec(), Vec::new())
}

/// The stations that are kept: Douglas and Peucker's method on the line and on both widths.
fn thinned(stations: &[Station]) -> Vec<Station> {
    let mut keep = vec![false; stations.len()];
    let last = stations.len() - 1;
    (keep[0], keep[last]) = (true, true);
    let mut open = vec![(0, last)];
    while let Some((from, to)) = open.pop() {
        let worst = (from + 1..to).map(|k| (off(&stations[from], &stations[to], &stations[k]), k));
        let Some((error, k)) = worst.max_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
        if error > TOLERANCE_M {
            keep[k] = true;
            open.extend([(from, k), (k, to)]);
        }
    }
    stations.iter().zip(keep).filter(|(_, keep)| *keep).map(|(station, _)| *station).collect()
}

fn off(a: &Station, b: &Station, station: &Station) -> f64 {
    let (line, share) = beside_piece(a.point, b.point, station.point);
    let width = |of: fn(&Station) -> f64| (of(station) - (of(a) + share * (of(b) - of(a)))).abs();
    line.max(width(|s| s.left_m)).max(width(|s| s.right_m))
}

/// Hermite's cubic between two stations, with their headings.
fn part(s_m: f64, a: &Station, b: &Station) -> Part {
    let chord = (b.point - a.point).norm();
    let to = (b.point - a.point).rotated(-a.heading_rad);
    let turn = num::wrap_angle(b.heading_rad - a.heading_rad);
    let end = Vec2::from_heading(turn) * chord;
    let start = Vec2::new(chord, 0.0);
    let square = to * 3.0 - start * 2.0 - end;
    let cube = start + end - to * 2.0;
    if square.norm() + cube.norm() < STRAIGHT_M {
        let heading_rad = (b.point - a.point).heading();
        return Part { s_m, from: a.point, heading_rad, length_m: chord, cubic: None };
    }
    let cubic = Cubic { u: [start.x, square.x, cube.x], v: [0.0, square.y, cube.y] };
    Part { s_m, from: a.point, heading_rad: a.heading_rad, length_m: cubic.length_m(), cubic: Some(cubic) }
}
