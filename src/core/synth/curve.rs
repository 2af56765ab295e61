//! Smooth plane curves by arc length. Lanes lie along them and drivers follow them. This module does not know roads.

use crate::kernel::{Vec2, num};

/// A place on a curve.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub position: Vec2,
    pub heading_rad: f64,
    /// 1/m, positive when it bends to the left.
    pub curvature: f64,
}

/// Vertices with their exact directions; between two of them a cubic Hermite arc, so that motion along it
/// has a continuous direction.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub points: Vec<Vec2>,
    /// Unwrapped, so that neighbouring vertices can be interpolated.
    headings: Vec<f64>,
    lengths: Vec<f64>,
}

/// Largest distance of two vertices on a bend, metres.
const BEND_SPACING_M: f64 = 1.0;
/// Largest distance of two vertices where the curve is straight, metres.
const STRAIGHT_SPACING_M: f64 = 10.0;

impl Curve {
    /// Needs at least two vertices that differ, which every constructor here provides.
    fn new(points: Vec<Vec2>, mut headings: Vec<f64>) -> Curve {
        let mut lengths = vec![0.0];
        for i in 1..points.len() {
            let turn = num::wrap_angle(headings[i] - headings[i - 1]);
            headings[i] = headings[i - 1] + turn;
            // The arc over a chord, to second order in the turn.
            let arc = points[i].distance(points[i - 1]) * (1.0 + turn * turn / 24.0);
            lengths.push(lengths[i - 1] + arc);
        }
        Curve { points, headings, lengths }
    }

    /// Pieces `(length, curvature at its start, curvature at its end)` with curvature linear in between
    /// (clothoids), laid one after the other from a pose.
    pub fn bend(start: Vec2, heading_rad: f64, pieces: &[(f64, f64, f64)]) -> Curve {
        let (mut points, mut headings) = (vec![start], vec![heading_rad]);
        let (mut position, mut base) = (start, heading_rad);
        for &(length, from, to) in pieces {
            let straight = from == 0.0 && to == 0.0;
            let spacing = if straight { STRAIGHT_SPACING_M } else { BEND_SPACING_M };
            let count = (length / spacing).ceil().max(1.0) as usize;
            let step = length / count as f64;
            let heading = |s: f64| base + from * s + 0.5 * (to - from) * s * s / length;
            for k in 0..count {
                let s = step * k as f64;
                // Simpson's rule over the step.
                let (a, b, c) = (heading(s), heading(s + 0.5 * step), heading(s + step));
                let mean = Vec2::from_heading(a) + Vec2::from_heading(b) * 4.0 + Vec2::from_heading(c);
                position = position + mean * (step / 6.0);
                points.push(position);
                headings.push(c);
            }
            base = heading(length);
        }
        Curve::new(points, headings)
    }

    /// The quintic between two poses with the given end curvatures whose sharpest bend is mildest.
    pub fn between(from: Place, to: Place) -> Curve {
        let chord = from.position.distance(to.position);
        let sharpest = |reach: f64| {
            let quintic = Quintic::new(from, to, reach * chord);
            (1..20).map(|k| quintic.curvature(f64::from(k) / 20.0).abs()).fold(0.0, f64::max)
        };
        let (mut best, mut mildest) = (1.0, f64::INFINITY);
        for k in 0..13 {
            let reach = 0.8 + 0.1 * f64::from(k);
            let bend = sharpest(reach);
            if bend < mildest - 1e-9 {
                (best, mildest) = (reach, bend);
            }
        }
        let quintic = Quintic::new(from, to, best * chord);
        let count = (chord * 1.1 / BEND_SPACING_M).ceil().max(4.0) as usize;
        let share = |k: usize| k as f64 / count as f64;
        let points = (0..=count).map(|k| quintic.position(share(k))).collect();
        let headings = (0..=count).map(|k| quintic.velocity(share(k)).heading()).collect();
        Curve::new(points, headings)
    }

    /// Returns the curve moved sideways, positive to the left; vertices stay abreast of each other.
    pub fn offset(&self, left_m: f64) -> Curve {
        let points = self.line(left_m);
        Curve::new(points, self.headings.clone())
    }

    /// Vertices moved sideways, positive to the left.
    pub fn line(&self, left_m: f64) -> Vec<Vec2> {
        let aside = |(p, h): (&Vec2, &f64)| *p + Vec2::from_heading(*h).left() * left_m;
        self.points.iter().zip(&self.headings).map(aside).collect()
    }

    pub fn reversed(&self) -> Curve {
        let points = self.points.iter().rev().copied().collect();
        Curve::new(points, self.headings.iter().rev().map(|h| h + num::PI).collect())
    }

    pub fn length_m(&self) -> f64 {
        self.lengths[self.lengths.len() - 1]
    }

    pub fn start(&self) -> Place {
        self.at(0.0)
    }

    pub fn end(&self) -> Place {
        self.at(self.length_m())
    }

    /// Segment and share of it at an arc length.
    fn station(&self, s_m: f64) -> (usize, f64) {
        let i = self.lengths.partition_point(|&l| l <= s_m).clamp(1, self.points.len() - 1) - 1;
        (i, (s_m - self.lengths[i]) / (self.lengths[i + 1] - self.lengths[i]))
    }

    /// The place at an arc length; straight on beyond the ends.
    pub fn at(&self, s_m: f64) -> Place {
        let (i, t) = self.station(s_m.clamp(0.0, self.length_m()));
        let span = self.lengths[i + 1] - self.lengths[i];
        let (h0, h1) = (self.headings[i], self.headings[i + 1]);
        let (p0, p1) = (self.points[i], self.points[i + 1]);
        let (m0, m1) = (Vec2::from_heading(h0) * span, Vec2::from_heading(h1) * span);
        let (t2, t3) = (t * t, t * t * t);
        let heading_rad = h0 + (h1 - h0) * t;
        let on =
            p0 * (2.0 * t3 - 3.0 * t2 + 1.0) + m0 * (t3 - 2.0 * t2 + t) + p1 * (3.0 * t2 - 2.0 * t3) + m1 * (t3 - t2);
        let beyond = s_m - s_m.clamp(0.0, self.length_m());
        let position = if beyond == 0.0 { on } else { on + Vec2::from_heading(heading_rad) * beyond };
        Place { position, heading_rad, curvature: (h1 - h0) / span }
    }

    /// Arc length abreast of `s` on a curve that was made by [`Curve::offset`] from the same base.
    pub fn abreast(&self, s_m: f64, of: &Curve) -> f64 {
        let (i, t) = of.station(s_m);
        match (self.lengths.get(i), self.lengths.get(i + 1)) {
            (Some(a), Some(b)) => a + (b - a) * t,
            _ => s_m,
        }
    }

    /// The bent stretches of the curve, each at most `spacing` metres long: `(start, end, largest curvature)`.
    pub fn bends(&self, spacing_m: f64) -> Vec<(f64, f64, f64)> {
        let mut crossings: Vec<(f64, f64, f64)> = Vec::new();
        for i in 0..self.points.len() - 1 {
            let (a, b) = (self.lengths[i], self.lengths[i + 1]);
            let curvature = ((self.headings[i + 1] - self.headings[i]) / (b - a)).abs();
            match crossings.last_mut() {
                Some(last) if last.1 == a && b - last.0 <= spacing_m => *last = (last.0, b, last.2.max(curvature)),
                _ if curvature > 1e-4 => crossings.push((a, b, curvature)),
                _ => {}
            }
        }
        crossings
    }
}

/// A polynomial of degree five in the plane with given ends, end directions and end curvatures.
struct Quintic {
    coefficients: [Vec2; 6],
}

impl Quintic {
    fn new(from: Place, to: Place, reach_m: f64) -> Quintic {
        let tangent = |p: Place| Vec2::from_heading(p.heading_rad) * reach_m;
        let bend = |p: Place| tangent(p).left() * (reach_m * p.curvature);
        let (p0, p1) = (from.position, to.position);
        let (v0, v1, a0, a1) = (tangent(from), tangent(to), bend(from), bend(to));
        let d = p1 - p0;
        let coefficients = [
            p0,
            v0,
            a0 * 0.5,
            d * 10.0 - v0 * 6.0 - v1 * 4.0 - a0 * 1.5 + a1 * 0.5,
            d * -15.0 + v0 * 8.0 + v1 * 7.0 + a0 * 1.5 - a1,
            d * 6.0 - (v0 + v1) * 3.0 - a0 * 0.5 + a1 * 0.5,
        ];
        Quintic { coefficients }
    }

    fn position(&self, t: f64) -> Vec2 {
        self.coefficients.iter().rev().fold(Vec2::ZERO, |sum, &c| sum * t + c)
    }

    fn velocity(&self, t: f64) -> Vec2 {
        (1..6).rev().fold(Vec2::ZERO, |sum, k| sum * t + self.coefficients[k] * k as f64)
    }

    fn curvature(&self, t: f64) -> f64 {
        let v = self.velocity(t);
        let a = (2..6).rev().fold(Vec2::ZERO, |sum, k| sum * t + self.coefficients[k] * (k * (k - 1)) as f64);
        let speed = v.norm().max(1e-6);
        v.cross(a) / (speed * speed * speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(x: f64, y: f64, heading_rad: f64) -> Place {
        Place { position: Vec2::new(x, y), heading_rad, curvature: 0.0 }
    }

    #[test]
    fn a_quarter_circle_ends_where_geometry_says() {
        let radius = 50.0;
        let curve = Curve::bend(Vec2::ZERO, 0.0, &[(num::FRAC_PI_2 * radius, 1.0 / radius, 1.0 / radius)]);
        assert!(curve.end().position.distance(Vec2::new(radius, radius)) < 1e-6);
        assert!((curve.length_m() - num::FRAC_PI_2 * radius).abs() < 1e-3);
    }

    #[test]
    fn a_turn_between_two_poses_starts_and_ends_straight_and_bends_mildly() {
        let curve = Curve::between(place(0.0, 0.0, 0.0), place(10.0, 10.0, num::FRAC_PI_2));
        assert!(curve.at(0.0).curvature.abs() < 0.03);
        let sharpest = curve.bends(5.0).iter().map(|b| b.2).fold(0.0, f64::max);
        assert!(sharpest < 0.2, "{sharpest}");
    }

    #[test]
    fn places_abreast_lie_on_one_normal() {
        let base = Curve::bend(Vec2::ZERO, 0.3, &[(40.0, 0.0, 0.0), (30.0, 0.0, 0.01), (50.0, 0.01, 0.01)]);
        let (left, right) = (base.offset(3.0), base.offset(-3.0));
        let from = right.at(77.3);
        let to = left.at(left.abreast(77.3, &right));
        assert!((from.position.distance(to.position) - 6.0).abs() < 1e-3);
        assert!((to.position - from.position).dot(Vec2::from_heading(from.heading_rad)).abs() < 0.01);
    }
}
