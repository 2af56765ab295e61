//! Where one may drive, and in which direction: exact distances to the union of all lane surfaces, found through a
//! grid. A lane's surface is the strip of quadrilaterals between its left and right line.

use crate::kernel::Vec2;
use crate::scene::{LaneKind, Road};

/// Side of a grid cell, metres.
const CELL_M: f64 = 4.0;
/// A grid never has more cells than this; huge maps get larger cells.
const CELLS_MAX: usize = 1 << 16;
/// A place farther from every lane than this is reported as this far, metres.
pub const OFF_ROAD_M_CAP: f64 = 50.0;

/// One piece of a lane between two neighbouring points of its lines.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Rear-left, rear-right, front-right, front-left.
    corners: [Vec2; 4],
    /// Driving direction, unit; zero where the lane has none (shoulders, parking, sidewalks).
    direction: Vec2,
}

/// The drivable surface of a scene.
#[derive(Clone, Debug, Default)]
pub struct Drivable {
    pieces: Vec<Piece>,
    origin: Vec2,
    cell_m: f64,
    columns: usize,
    rows: usize,
    /// `starts[cell]..starts[cell + 1]` are the pieces whose bounds meet the cell.
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Drivable {
    /// The surface of a road. A road without lanes has none: see [`Drivable::is_known`].
    pub fn new(road: &Road) -> Drivable {
        let mut pieces = Vec::new();
        for lane in &road.lanes {
            let count = lane.left.len().min(lane.right.len()).min(lane.centre.len());
            for k in 1..count {
                let ahead = lane.centre[k] - lane.centre[k - 1];
                let norm = ahead.norm();
                let corners = [lane.left[k - 1], lane.right[k - 1], lane.right[k], lane.left[k]];
                if norm < 1e-9 || !corners.iter().all(|c| c.is_finite()) {
                    continue;
                }
                let directed = lane.kind != LaneKind::Other;
                pieces.push(Piece { corners, direction: if directed { ahead * (1.0 / norm) } else { Vec2::ZERO } });
            }
        }
        Drivable::gridded(pieces)
    }

    fn gridded(pieces: Vec<Piece>) -> Drivable {
        if pieces.is_empty() {
            return Drivable::default();
        }
        let (mut low, mut high) = (pieces[0].corners[0], pieces[0].corners[0]);
        for corner in pieces.iter().flat_map(|p| p.corners) {
            low = Vec2::new(low.x.min(corner.x), low.y.min(corner.y));
            high = Vec2::new(high.x.max(corner.x), high.y.max(corner.y));
        }
        let area = (high.x - low.x + CELL_M) * (high.y - low.y + CELL_M);
        let cell_m =
            CELL_M.max((area / CELLS_MAX as f64).sqrt() * 1.01).max((high.x - low.x).max(high.y - low.y) / 4096.0);
        let columns = ((high.x - low.x) / cell_m) as usize + 1;
        let rows = ((high.y - low.y) / cell_m) as usize + 1;
        let mut grid = Drivable { pieces, origin: low, cell_m, columns, rows, starts: Vec::new(), members: Vec::new() };
        grid.fill();
        grid
    }

    fn fill(&mut self) {
        let spans: Vec<[usize; 4]> = self.pieces.iter().map(|p| self.span(p)).collect();
        let mut counts = vec![0u32; self.columns * self.rows + 1];
        let cells = |span: &[usize; 4]| {
            let [c0, c1, r0, r1] = *span;
            (r0..=r1).flat_map(move |r| (c0..=c1).map(move |c| (r, c)))
        };
        for span in &spans {
            for (r, c) in cells(span) {
                counts[r * self.columns + c + 1] += 1;
            }
        }
        for i in 1..counts.len() {
            counts[i] += counts[i - 1];
        }
        let mut next = counts.clone();
        self.members = vec![0; counts[counts.len() - 1] as usize];
        for (piece, span) in spans.iter().enumerate() {
            for (r, c) in cells(span) {
                let slot = &mut next[r * self.columns + c];
                self.members[*slot as usize] = piece as u32;
                *slot += 1;
            }
        }
        self.starts = counts;
    }

    fn span(&self, piece: &Piece) -> [usize; 4] {
        let (mut low, mut high) = (piece.corners[0], piece.corners[0]);
        for corner in piece.corners {
            low = Vec2::new(low.x.min(corner.x), low.y.min(corner.y));
            high = Vec2::new(high.x.max(corner.x), high.y.max(corner.y));
        }
        let column = |x: f64| (((x - self.origin.x) / self.cell_m) as usize).min(self.columns - 1);
        let row = |y: f64| (((y - self.origin.y) / self.cell_m) as usize).min(self.rows - 1);
        [column(low.x), column(high.x), row(low.y), row(high.y)]
    }

    /// Whether the scene says where one may drive. If not, nothing is ever off-road or on the wrong side.
    pub fn is_known(&self) -> bool {
        !self.pieces.is_empty()
    }

    /// Distance from a point to the nearest lane surface, metres; 0 on it, at most [`OFF_ROAD_M_CAP`]. Exact if it is
    /// above `floor_m`; below, any number up to `floor_m` may come back (who looks for a maximum needs no more).
    /// `hint` is a piece near the point (any number will do); it is set to the nearest one found.
    pub fn distance_m(&self, point: Vec2, floor_m: f64, hint: &mut u32) -> f64 {
        if !self.is_known() {
            return 0.0;
        }
        let mut best = (OFF_ROAD_M_CAP * OFF_ROAD_M_CAP, *hint);
        if let Some(piece) = self.pieces.get(*hint as usize) {
            best.0 = best.0.min(squared_distance(&piece.corners, point));
        }
        // A hair below the square, so that rounding cannot lift a rejected distance above the floor.
        let enough = floor_m * floor_m * (1.0 - 1e-12);
        let column = ((point.x - self.origin.x) / self.cell_m).floor();
        let row = ((point.y - self.origin.y) / self.cell_m).floor();
        let rings = (OFF_ROAD_M_CAP / self.cell_m) as i64 + 1;
        for ring in 0..=rings {
            // What lies in this ring of cells is at least this far away.
            let nearest = (ring - 1).max(0) as f64 * self.cell_m;
            if best.0 <= enough || nearest * nearest >= best.0 {
                break;
            }
            self.search_ring(point, column as i64, row as i64, ring, &mut best);
        }
        *hint = best.1;
        best.0.sqrt()
    }

    fn search_ring(&self, point: Vec2, column: i64, row: i64, ring: i64, best: &mut (f64, u32)) {
        for r in row - ring..=row + ring {
            if r < 0 || r >= self.rows as i64 {
                continue;
            }
            let edge = r == row - ring || r == row + ring;
            let step = if edge || ring == 0 { 1 } else { 2 * ring };
            let mut c = column - ring;
            while c <= column + ring {
                if c >= 0 && c < self.columns as i64 {
                    for &piece in self.cell(r as usize * self.columns + c as usize) {
                        let squared = squared_distance(&self.pieces[piece as usize].corners, point);
                        if squared < best.0 {
                            *best = (squared, piece);
                        }
                        if squared == 0.0 {
                            return;
                        }
                    }
                }
                c += step;
            }
        }
    }

    fn cell(&self, index: usize) -> &[u32] {
        &self.members[self.starts[index] as usize..self.starts[index + 1] as usize]
    }

    /// Whether a point lies on lanes all of which run against `axis` (more than 90° off). `hint` as in
    /// [`Drivable::distance_m`].
    pub fn is_wrong_way(&self, point: Vec2, axis: Vec2, hint: &mut u32) -> bool {
        let along = |piece: &Piece| contains(&piece.corners, point) && piece.direction.dot(axis) >= 0.0;
        if !self.is_known() || self.pieces.get(*hint as usize).is_some_and(along) {
            return false;
        }
        let column = ((point.x - self.origin.x) / self.cell_m).floor();
        let row = ((point.y - self.origin.y) / self.cell_m).floor();
        if column < 0.0 || row < 0.0 || column >= self.columns as f64 || row >= self.rows as f64 {
            return false;
        }
        let mut against = false;
        for &index in self.cell(row as usize * self.columns + column as usize) {
            let piece = &self.pieces[index as usize];
            if contains(&piece.corners, point) {
                if piece.direction.dot(axis) >= 0.0 {
                    *hint = index;
                    return false;
                }
                against = true;
            }
        }
        against
    }
}

#[cfg(test)]
impl Drivable {
    /// [`Drivable::distance_m`] by looking at every piece.
    pub fn distance_by_walk_m(&self, point: Vec2) -> f64 {
        if !self.is_known() {
            return 0.0;
        }
        let nearest = self.pieces.iter().map(|p| squared_distance(&p.corners, point)).fold(f64::INFINITY, f64::min);
        nearest.sqrt().min(OFF_ROAD_M_CAP)
    }

    /// [`Drivable::is_wrong_way`] by looking at every piece.
    pub fn is_wrong_way_by_walk(&self, point: Vec2, axis: Vec2) -> bool {
        let mut under = self.pieces.iter().filter(|p| contains(&p.corners, point)).peekable();
        under.peek().is_some() && under.all(|p| p.direction.dot(axis) < 0.0)
    }
}

/// Even-odd test of a quadrilateral, folded ones included.
fn contains(corners: &[Vec2; 4], point: Vec2) -> bool {
    let mut inside = false;
    let mut a = corners[3];
    for &b in corners {
        if (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x) {
            inside = !inside;
        }
        a = b;
    }
    inside
}

fn squared_distance(corners: &[Vec2; 4], point: Vec2) -> f64 {
    if contains(corners, point) {
        return 0.0;
    }
    let mut best = f64::INFINITY;
    let mut a = corners[3];
    for &b in corners {
        let along = b - a;
        let squared = along.norm_squared();
        let share = if squared > 0.0 { ((point - a).dot(along) / squared).clamp(0.0, 1.0) } else { 0.0 };
        best = best.min((point - a - along * share).norm_squared());
        a = b;
    }
    best
}
