//! The drivable area as a signed-distance field: metres to the edge of the union of all lane surfaces, positive on it,
//! negative beside it, with its slope.
//!
//! Surfaces are those of [`LaneGraph`], read once at the nodes of a raster; distances come from the exact Euclidean
//! distance transform (Felzenszwalb and Huttenlocher 2012) and are right to half a diagonal of a cell. Between nodes
//! they are bilinear, so a search by slopes sees a continuous field. Outside the raster the border's value holds.
//!
//! Beside it `LaneGraph::off_road_m` and `sim::drivable` give exact distances over the same pieces, but only beside the
//! road and without slopes: a search that must feel how deep in the road it is cannot use them, nor they this raster.

use crate::kernel::{Extent, OrientedBox, Vec2, num};
use crate::scene::{LaneGraph, Scene};

/// Distance of two nodes where the scene is small enough, metres.
const CELL_M: f64 = 0.5;
/// A larger scene gets larger cells.
const NODES_MAX: f64 = 131_072.0;
/// Space kept around everything that moves in the scene, metres.
const MARGIN_M: f64 = 25.0;
/// Stands for "no edge anywhere", squared cells.
const FAR: f64 = 1e12;

/// Signed distances on a raster.
#[derive(Clone, Debug)]
pub struct RoadField {
    origin: Vec2,
    cell_m: f64,
    columns: usize,
    rows: usize,
    /// Row by row, metres.
    values: Vec<f32>,
}

impl RoadField {
    /// Returns the field around all that moves in a scene; `None` for a road without lanes: then nothing is off the road.
    pub fn of(scene: &Scene, lanes: &LaneGraph) -> Option<RoadField> {
        if lanes.lane_count() == 0 {
            return None;
        }
        let moving = scene.tracks.iter().chain([&scene.ego.track]).flat_map(|t| t.samples.iter().flatten());
        let places = moving.map(|s| s.position).chain(scene.ego.route.iter().copied());
        let Extent { low, high } = Extent::around(places.filter(|p| p.is_finite()));
        let margin = Vec2::new(MARGIN_M, MARGIN_M);
        let (low, size) = (low - margin, high - low + margin * 2.0);
        if !(size.x.is_finite() && size.y.is_finite()) {
            return None;
        }
        let cell_m = CELL_M.max((size.x * size.y / NODES_MAX).sqrt());
        let (columns, rows) = ((size.x / cell_m) as usize + 2, (size.y / cell_m) as usize + 2);
        let node = |k: usize| low + Vec2::new((k % columns) as f64, (k / columns) as f64) * cell_m;
        let drivable: Vec<bool> = (0..columns * rows).map(|k| lanes.is_drivable(node(k))).collect();
        let to_edge = squared_distances(&drivable, columns, false);
        let to_road = squared_distances(&drivable, columns, true);
        let signed = |k: usize| {
            // The edge lies half a cell before the first node on the other side.
            let cells = if drivable[k] { to_edge[k].sqrt() - 0.5 } else { 0.5 - to_road[k].sqrt() };
            (cells * cell_m).clamp(-1e4, 1e4) as f32
        };
        Some(RoadField { origin: low, cell_m, columns, rows, values: (0..columns * rows).map(signed).collect() })
    }

    /// Signed distance at a point, metres, and its slope.
    pub fn at(&self, point: Vec2) -> (f64, Vec2) {
        let patch = self.patch(point);
        (patch.distance_m(), patch.slope())
    }

    /// Signed distance at a point, metres: half of the work where nobody asks for the slope.
    pub fn distance_m(&self, point: Vec2) -> f64 {
        self.patch(point).distance_m()
    }

    #[inline(always)]
    fn patch(&self, point: Vec2) -> Patch {
        let (column, x, x_free) = place((point.x - self.origin.x) / self.cell_m, self.columns);
        let (row, y, y_free) = place((point.y - self.origin.y) / self.cell_m, self.rows);
        let from = row * self.columns + column;
        let pair = |from: usize| -> [f64; 2] {
            let pair = &self.values[from..from + 2];
            [f64::from(pair[0]), f64::from(pair[1])]
        };
        let ([a, b], [c, d]) = (pair(from), pair(from + self.columns));
        Patch { corners: [a, b, c, d], at: (x, y), free: (x_free, y_free), cell_m: self.cell_m }
    }

    /// How far the outermost corner of a body is beside the road, metres; 0 on it.
    pub fn departure_m(&self, body: &OrientedBox) -> f64 {
        // Two raster cells of slack: distances are right to half a cell's diagonal, and here no more is asked.
        if self.distance_m(body.center) > body.radius() + 2.0 * self.cell_m {
            return 0.0;
        }
        body.corners().iter().map(|corner| -self.distance_m(*corner)).fold(0.0, f64::max)
    }
}

/// A cell of the raster and a point in it.
struct Patch {
    /// Distances at its nodes: this row, then the next. Metres.
    corners: [f64; 4],
    /// Shares of the cell that the point lies in.
    at: (f64, f64),
    /// True if the distance changes along x and y: not beyond the border.
    free: (bool, bool),
    cell_m: f64,
}

impl Patch {
    #[inline(always)]
    fn rows(&self) -> (f64, f64) {
        let ([a, b, c, d], x) = (self.corners, self.at.0);
        (a + (b - a) * x, c + (d - c) * x)
    }

    #[inline(always)]
    fn distance_m(&self) -> f64 {
        let (near, far) = self.rows();
        near + (far - near) * self.at.1
    }

    #[inline(always)]
    fn slope(&self) -> Vec2 {
        let ([a, b, c, d], y) = (self.corners, self.at.1);
        let (near, far) = self.rows();
        let by_x = ((b - a) * (1.0 - y) + (d - c) * y) / self.cell_m;
        let by_y = (far - near) / self.cell_m;
        Vec2::new(if self.free.0 { by_x } else { 0.0 }, if self.free.1 { by_y } else { 0.0 })
    }
}

/// Cell, share within it, and whether the coordinate lies inside the raster.
fn place(at: f64, count: usize) -> (usize, f64, bool) {
    let last = (count - 1) as f64;
    let inside = (0.0..last).contains(&at);
    let at = if at.is_finite() { at.clamp(0.0, last) } else { 0.0 };
    let cell = (at as usize).min(count - 2);
    (cell, at - cell as f64, inside)
}

/// Squared distance, in cells, from every node to the nearest node whose mark is `wanted`.
fn squared_distances(marks: &[bool], columns: usize, wanted: bool) -> Vec<f64> {
    let mut grid: Vec<f64> = marks.iter().map(|m| if *m == wanted { 0.0 } else { FAR }).collect();
    let rows = marks.len() / columns;
    let mut line = Vec::with_capacity(columns.max(rows));
    let mut hull = Hull::default();
    for column in 0..columns {
        line.clear();
        line.extend((0..rows).map(|row| grid[row * columns + column]));
        hull.transform(&line, |row, value| grid[row * columns + column] = value);
    }
    for row in 0..rows {
        line.clear();
        line.extend_from_slice(&grid[row * columns..(row + 1) * columns]);
        hull.transform(&line, |column, value| grid[row * columns + column] = value);
    }
    grid
}

/// The lower envelope of parabolas on a line: one dimension of the transform.
#[derive(Default)]
struct Hull {
    tops: Vec<usize>,
    /// `from[k]`: where the k-th parabola becomes the lowest.
    from: Vec<f64>,
}

impl Hull {
    fn transform(&mut self, line: &[f64], mut set: impl FnMut(usize, f64)) {
        let (tops, from) = (&mut self.tops, &mut self.from);
        tops.clear();
        from.clear();
        let height = |q: usize| line[q] + (q * q) as f64;
        for q in 0..line.len() {
            let mut meets = f64::NEG_INFINITY;
            while let (Some(&top), Some(&start)) = (tops.last(), from.last()) {
                meets = (height(q) - height(top)) / (2.0 * (q - top) as f64);
                if meets > start {
                    break;
                }
                tops.pop();
                from.pop();
                meets = f64::NEG_INFINITY;
            }
            tops.push(q);
            from.push(meets);
        }
        let mut k = 0;
        for q in 0..line.len() {
            while k + 1 < from.len() && from[k + 1] <= q as f64 {
                k += 1;
            }
            let gap = q as f64 - tops[k] as f64;
            set(q, gap * gap + line[tops[k]]);
        }
    }
}

/// A point this deep in the road costs nothing: [`gaussian_pull`] is cut off there, metres.
pub fn gaussian_reach_m(sigma_m: f64) -> f64 {
    4.0 * sigma_m
}

/// The cost of a point and its slope.
#[cfg(test)]
pub fn gaussian_departure(field: &RoadField, point: Vec2, sigma_m: f64) -> (f64, Vec2) {
    gaussian_pull(field, point, sigma_m).map_or((0.0, Vec2::ZERO), |(t, pull)| (gaussian_mass(t), pull))
}

/// Returns, for KING's cost of a point beside the road, [`gaussian_mass`], the distance in deviations and the slope; `None` where a point
/// costs nothing.
#[inline]
pub fn gaussian_pull(field: &RoadField, point: Vec2, sigma_m: f64) -> Option<(f64, Vec2)> {
    let patch = field.patch(point);
    let distance = patch.distance_m();
    if distance > gaussian_reach_m(sigma_m) {
        return None;
    }
    let slope = patch.slope();
    let t = distance / sigma_m;
    let density = num::exp(-0.5 * t * t) / (num::TAU.sqrt() * sigma_m);
    Some((t, slope * -density))
}

/// KING's cost at a distance in deviations: the mass of a Gaussian around a point that falls on undrivable ground, which for a
/// straight edge is Φ(−d/σ). Above 0 within reach.
pub fn gaussian_mass(t: f64) -> f64 {
    0.5 * num::erfc(t / core::f64::consts::SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fixture::two_lane_scene;
    use proptest::prelude::*;

    fn field() -> (RoadField, LaneGraph) {
        let scene = two_lane_scene();
        let lanes = LaneGraph::of(&scene.road);
        (RoadField::of(&scene, &lanes).unwrap(), lanes)
    }

    #[test]
    fn distances_on_the_road_are_those_to_its_edge() {
        // Two lanes from y = -1.75 to 5.25.
        let (field, _) = field();
        for (y, edge) in [(0.0, 1.75), (1.75, 3.5), (3.5, 1.75), (5.0, 0.25)] {
            let (found, _) = field.at(Vec2::new(50.0, y));
            assert!((found - edge).abs() < 0.36, "y {y}: {found}");
        }
    }

    #[test]
    fn a_road_without_lanes_has_no_field() {
        let mut scene = two_lane_scene();
        scene.road.lanes.clear();
        assert!(RoadField::of(&scene, &LaneGraph::of(&scene.road)).is_none());
    }

    #[test]
    fn a_scene_of_any_extent_gets_a_bounded_raster() {
        let mut scene = two_lane_scene();
        scene.ego.route.push(Vec2::new(9e6, -4e6));
        let field = RoadField::of(&scene, &LaneGraph::of(&scene.road)).unwrap();
        assert!(field.values.len() < 200_000, "{}", field.values.len());
    }

    proptest! {
        #[test]
        fn distances_beside_the_road_agree_with_the_lane_surfaces(x in -10.0..140.0f64, y in -20.0..25.0f64) {
            let (field, lanes) = field();
            let (point, exact) = (Vec2::new(x, y), lanes.off_road_m(Vec2::new(x, y)));
            let (found, _) = field.at(point);
            prop_assert!((-found).max(0.0) <= exact + 0.5 && (-found).max(0.0) >= exact - 0.5, "{found} {exact}");
        }

        #[test]
        fn slopes_match_finite_differences_within_a_cell(
            column in 20usize..240, row in 20usize..80, x in 0.1..0.9f64, y in 0.1..0.9f64,
        ) {
            let (field, _) = field();
            let point = field.origin + Vec2::new(column as f64 + x, row as f64 + y) * field.cell_m;
            for sigma_m in [0.5, 1.0] {
                let cost = |p: Vec2| gaussian_departure(&field, p, sigma_m).0;
                let (_, slope) = gaussian_departure(&field, point, sigma_m);
                let step = 1e-5;
                let by_x = (cost(point + Vec2::new(step, 0.0)) - cost(point - Vec2::new(step, 0.0))) / (2.0 * step);
                let by_y = (cost(point + Vec2::new(0.0, step)) - cost(point - Vec2::new(0.0, step))) / (2.0 * step);
                prop_assert!((slope.x - by_x).abs() < 1e-4 && (slope.y - by_y).abs() < 1e-4, "{slope:?} {by_x} {by_y}");
            }
        }
    }
}
