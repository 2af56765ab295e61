//! The pieces of all lanes in a uniform grid, to find those near a point. The lane graph and the simulator share this
//! description of the road's surface. It is built once; a query allocates nothing, and its answer depends only on the
//! pieces and the point.

use super::{Lane, LaneIx, LaneKind, Road};
use crate::kernel::Vec2;

/// Side of a cell where the road is no larger than `CELLS_MAX` of them, metres.
const CELL_M: f64 = 5.0;
const CELLS_MAX: f64 = 32_768.0;
/// Most entries of pieces in cells. A road whose long pieces would need more gets larger cells.
const ENTRIES_MAX: u64 = 32_000_000;

/// [`Pieces::touching`] finds every piece that is no farther than this, metres.
pub const TOUCH_M: f64 = 1e-3;

/// A cell that lies this much too far is still searched, m²: far more than rounding can amount to.
const SLACK_M2: f64 = 1e-3;

/// One segment of a lane: its centre line and the surface around it.
#[derive(Clone, Debug)]
pub struct Piece {
    lane: u32,
    /// Kind of its lane.
    pub kind: LaneKind,
    /// True if its surface has four corners that all turn clearly to the same side, so that a point beyond one edge is outside.
    pub is_convex: bool,
    /// First point of the segment, metres.
    pub from: Vec2,
    /// Unit vector in driving direction; zero where two centre points coincide.
    pub direction: Vec2,
    /// Length of the segment, metres.
    pub length_m: f64,
    /// Arc length of `from`, metres.
    pub start_s_m: f64,
    /// left, left, right, right: around the surface.
    pub surface: [Vec2; 4],
    low: Vec2,
    high: Vec2,
}

impl Piece {
    /// The lane that it belongs to.
    pub fn lane(&self) -> LaneIx {
        self.lane as LaneIx
    }

    /// Streets and freeways; not bike lanes, shoulders, sidewalks.
    pub fn is_through(&self) -> bool {
        matches!(self.kind, LaneKind::Street | LaneKind::Freeway)
    }

    /// Place of the nearest point of the centre segment, from 0 to its length, and its squared distance.
    pub fn nearest(&self, point: Vec2) -> (f64, f64) {
        let along = (point - self.from).dot(self.direction).clamp(0.0, self.length_m);
        (along, (point - self.from - self.direction * along).norm_squared())
    }

    /// Returns `true` if a point lies on its surface.
    pub fn contains(&self, point: Vec2) -> bool {
        let boxed = point.x >= self.low.x && point.x <= self.high.x && point.y >= self.low.y && point.y <= self.high.y;
        boxed && crate::kernel::geom::polygon_contains(&self.surface, point)
    }

    /// Squared distance from a point outside to the surface's rim.
    pub fn rim_distance_squared(&self, point: Vec2) -> f64 {
        let mut best = f64::INFINITY;
        for k in 0..4 {
            let (a, b) = (self.surface[k], self.surface[(k + 1) % 4]);
            let along = b - a;
            let length = along.norm_squared();
            let share = if length > 0.0 { ((point - a).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
            best = best.min((point - a.lerp(b, share)).norm_squared());
        }
        best
    }

    /// Squared distance from a point to the piece's bounding rectangle; 0 inside.
    pub fn bound_distance_squared(&self, point: Vec2) -> f64 {
        let dx = (self.low.x - point.x).max(point.x - self.high.x).max(0.0);
        let dy = (self.low.y - point.y).max(point.y - self.high.y).max(0.0);
        dx * dx + dy * dy
    }
}

/// All pieces by lane, then along it.
#[derive(Clone, Debug)]
pub struct Pieces {
    all: Vec<Piece>,
    /// [`outline`] of each.
    outlines: Vec<[f32; 4]>,
    low: Vec2,
    cell_m: f64,
    columns: i64,
    rows: i64,
    /// Pieces of cell `c` are `items[starts[c]..starts[c + 1]]`.
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Pieces {
    /// The pieces of every lane of a validated road.
    pub fn of(road: &Road) -> Pieces {
        Pieces::of_lanes(road, |_| true)
    }

    /// The pieces of the lanes that `takes` chooses.
    pub fn of_lanes(road: &Road, takes: impl Fn(&Lane) -> bool) -> Pieces {
        let lanes = || road.lanes.iter().enumerate().filter(|(_, lane)| takes(lane));
        // Exact capacity, because a whole pool of prepared scenes is kept in memory.
        let mut pieces = Vec::with_capacity(lanes().map(|(_, lane)| segments(lane).len()).sum());
        for (ix, lane) in lanes() {
            push_pieces(lane, ix, &mut pieces);
        }
        Pieces::gridded(pieces, ENTRIES_MAX)
    }

    fn gridded(pieces: Vec<Piece>, entries_max: u64) -> Pieces {
        let (mut low, mut high) = (Vec2::ZERO, Vec2::ZERO);
        if let Some(first) = pieces.first() {
            (low, high) = (first.low, first.high);
        }
        for piece in &pieces {
            low = Vec2::new(low.x.min(piece.low.x), low.y.min(piece.low.y));
            high = Vec2::new(high.x.max(piece.high.x), high.y.max(piece.high.y));
        }
        let size = high - low;
        let longest = size.x.max(size.y);
        let cell_m = CELL_M.max((size.x * size.y / CELLS_MAX).sqrt()).max(longest / CELLS_MAX);
        let outlines = pieces.iter().map(outline).collect();
        let mut gridded =
            Pieces { all: pieces, outlines, low, cell_m, columns: 1, rows: 1, starts: vec![], items: vec![] };
        gridded.divide(size);
        // The size of a cell changes the time of a query, never its answer.
        while gridded.entries() > entries_max && gridded.columns * gridded.rows > 1 {
            gridded.cell_m *= 2.0;
            gridded.divide(size);
        }
        gridded.fill();
        gridded
    }

    fn divide(&mut self, size: Vec2) {
        self.columns = (size.x / self.cell_m).floor() as i64 + 1;
        self.rows = (size.y / self.cell_m).floor() as i64 + 1;
    }

    /// Number of entries of pieces in cells.
    fn entries(&self) -> u64 {
        let touched = |piece: &Piece| {
            let (columns, rows) = self.cells_of(piece);
            let count = |range: &std::ops::RangeInclusive<i64>| (range.end() - range.start() + 1).max(0) as u64;
            count(&columns) * count(&rows)
        };
        self.all.iter().map(touched).fold(0, u64::saturating_add)
    }

    /// Number of pieces in the fullest cell.
    pub fn fullest_cell(&self) -> usize {
        self.starts.windows(2).map(|w| (w[1] - w[0]) as usize).max().unwrap_or(0)
    }

    /// Returns the pieces by lane, then along it.
    pub fn all(&self) -> &[Piece] {
        &self.all
    }

    /// Counting sort of pieces into the cells that their bounding rectangles touch.
    fn fill(&mut self) {
        let cells = (self.columns * self.rows) as usize;
        let mut counts = vec![0u32; cells + 1];
        for piece in &self.all {
            self.for_cells_of(piece, |cell| counts[cell + 1] += 1);
        }
        for cell in 0..cells {
            counts[cell + 1] += counts[cell];
        }
        let mut items = vec![0u32; counts[cells] as usize];
        let mut next = counts.clone();
        for (ix, piece) in self.all.iter().enumerate() {
            self.for_cells_of(piece, |cell| {
                items[next[cell] as usize] = ix as u32;
                next[cell] += 1;
            });
        }
        (self.starts, self.items) = (counts, items);
    }

    fn for_cells_of(&self, piece: &Piece, mut visit: impl FnMut(usize)) {
        let (columns, rows) = self.cells_of(piece);
        for row in rows {
            for column in columns.clone() {
                visit((row * self.columns + column) as usize);
            }
        }
    }

    /// Columns and rows that a piece's bounding rectangle touches.
    fn cells_of(&self, piece: &Piece) -> (std::ops::RangeInclusive<i64>, std::ops::RangeInclusive<i64>) {
        let (low, high) = (self.cell_of(piece.low), self.cell_of(piece.high));
        (low.0.max(0)..=high.0.min(self.columns - 1), low.1.max(0)..=high.1.min(self.rows - 1))
    }

    fn cell_of(&self, point: Vec2) -> (i64, i64) {
        let column = ((point.x - self.low.x) / self.cell_m).floor() as i64;
        let row = ((point.y - self.low.y) / self.cell_m).floor() as i64;
        (column, row)
    }

    /// Pieces of the cell that holds the point, with their places in [`Pieces::all`]: all whose bounding rectangle holds the point or is
    /// no farther from it than [`TOUCH_M`], and at most some that are a little farther.
    pub fn touching(&self, point: Vec2) -> impl Iterator<Item = (u32, &Piece)> {
        let (column, row) = self.cell_of(point);
        let inside = column >= 0 && row >= 0 && column < self.columns && row < self.rows;
        let range = if inside { self.range((row * self.columns + column) as usize) } else { 0..0 };
        let (x, y) = (point.x as f32, point.y as f32);
        let place = [x, y, -x, -y];
        let touches = move |ix: &&u32| {
            let outline = &self.outlines[**ix as usize];
            // Without branches: most pieces of a cell are elsewhere, and each on another side.
            (0..4).fold(true, |touches, side| touches & (outline[side] <= place[side]))
        };
        self.items[range].iter().filter(touches).map(|&ix| (ix, &self.all[ix as usize]))
    }

    fn range(&self, cell: usize) -> std::ops::Range<usize> {
        self.starts[cell] as usize..self.starts[cell + 1] as usize
    }

    /// Shows `visit` every piece within `within_m` of the point (and some beyond) with its place in [`Pieces::all`],
    /// cell ring by cell ring outward. `visit` returns the distance within which it still looks for something, negative
    /// for nothing more; a piece may be shown twice.
    pub fn outward(&self, point: Vec2, within_m: f64, mut visit: impl FnMut(u32, &Piece) -> f64) {
        let (column, row) = self.cell_of(point);
        let gap = |at: i64, count: i64| (-at).max(at.saturating_sub(count - 1)).max(0);
        let reach = |at: i64, count: i64| at.saturating_abs().max((count - 1).saturating_sub(at).saturating_abs());
        let last = reach(column, self.columns).max(reach(row, self.rows));
        let mut bound_m = within_m;
        // Squared distance from the point to the nearest place of a row or column of cells.
        let aside = |from: f64, at: f64, cell: i64| {
            let low = from + cell as f64 * self.cell_m;
            let gap = (low - at).max(at - low - self.cell_m).max(0.0);
            gap * gap
        };
        let mut ring = gap(column, self.columns).max(gap(row, self.rows));
        // Cells of ring r lie at least (r - 1) cells away.
        while ring <= last && (ring - 1) as f64 * self.cell_m <= bound_m {
            let rows = row.saturating_sub(ring).max(0)..=row.saturating_add(ring).min(self.rows - 1);
            for y in rows {
                let by_y = aside(self.low.y, point.y, y);
                let whole = (y - row).abs() == ring;
                let (west, east) = (column.saturating_sub(ring), column.saturating_add(ring));
                let step = if whole { 1 } else { (2 * ring).max(1) as usize };
                let skip_to = if whole { west.max(0) } else { west };
                for x in (skip_to..=east.min(self.columns - 1)).step_by(step) {
                    // Nothing in a cell is nearer than the cell; the slack is for rounding at its border.
                    if x < 0 || by_y + aside(self.low.x, point.x, x) > bound_m * bound_m + SLACK_M2 {
                        continue;
                    }
                    for &ix in &self.items[self.range((y * self.columns + x) as usize)] {
                        bound_m = bound_m.min(visit(ix, &self.all[ix as usize]));
                        if bound_m < 0.0 {
                            return;
                        }
                    }
                }
            }
            ring += 1;
        }
    }
}

/// Returns `true` if the corners run clockwise, and none is nearer than a micrometre to the line between its neighbours.
fn is_convex(surface: &[Vec2; 4]) -> bool {
    (0..4).all(|k| {
        let (before, after) = (surface[(k + 1) % 4] - surface[k], surface[(k + 2) % 4] - surface[(k + 1) % 4]);
        let around = before.x.abs() + before.y.abs() + after.x.abs() + after.y.abs();
        before.cross(after) < -1e-6 * around
    })
}

/// Rectangle around a piece, larger by [`TOUCH_M`] and the largest rounding: low x and y, minus high x and y, metres. The numbers are
/// short because a place is compared with all pieces of a cell, few of which are near.
fn outline(piece: &Piece) -> [f32; 4] {
    let (low, high) = (piece.low, piece.high);
    // A rounding to `f32` is at most 6e-8 of a number; there are two, of the rectangle and of the place.
    let slack = |a: f64, b: f64| 2.0 * TOUCH_M + 1e-6 * a.abs().max(b.abs());
    let (wide, tall) = (slack(low.x, high.x), slack(low.y, high.y));
    [(low.x - wide) as f32, (low.y - tall) as f32, (-high.x - wide) as f32, (-high.y - tall) as f32]
}

/// Indices of the end points of those segments that all three lines of the lane have.
fn segments(lane: &Lane) -> std::ops::Range<usize> {
    1..lane.centre.len().min(lane.left.len()).min(lane.right.len()).max(1)
}

fn push_pieces(lane: &Lane, ix: LaneIx, pieces: &mut Vec<Piece>) {
    let mut start_s_m = 0.0;
    for k in segments(lane) {
        let (from, to) = (lane.centre[k - 1], lane.centre[k]);
        let length_m = from.distance(to);
        let surface = [lane.left[k - 1], lane.left[k], lane.right[k], lane.right[k - 1]];
        let around = || surface.iter().chain([&from, &to]);
        let low = around().fold(from, |m, p| Vec2::new(m.x.min(p.x), m.y.min(p.y)));
        let high = around().fold(from, |m, p| Vec2::new(m.x.max(p.x), m.y.max(p.y)));
        pieces.push(Piece {
            lane: ix as u32,
            kind: lane.kind,
            is_convex: is_convex(&surface),
            from,
            direction: if length_m > 0.0 { (to - from) * (1.0 / length_m) } else { Vec2::ZERO },
            length_m,
            start_s_m,
            surface,
            low,
            high,
        });
        start_s_m += length_m;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fixture::two_lane_scene;

    /// Which pieces hold a point, and the nearest within 30 m.
    fn found(pieces: &Pieces, point: Vec2) -> (Vec<u32>, Option<(f64, u32)>) {
        let mut under: Vec<u32> =
            pieces.touching(point).filter(|(_, piece)| piece.contains(point)).map(|p| p.0).collect();
        under.sort_unstable();
        let mut best: Option<(f64, u32)> = None;
        pieces.outward(point, 30.0, |ix, piece| {
            let distance = piece.nearest(point).1;
            if distance <= 900.0 && best.is_none_or(|b| (distance, ix) < b) {
                best = Some((distance, ix));
            }
            best.map_or(30.0, |b| b.0.sqrt())
        });
        (under, best)
    }

    #[test]
    fn pieces_across_the_whole_map_get_larger_cells_and_the_same_answers() {
        let mut road = two_lane_scene().road;
        let far = |k: usize| if k.is_multiple_of(2) { Vec2::new(-900.0, -900.0) } else { Vec2::new(900.0, 900.0) };
        let mut zigzag = road.lanes[0].clone();
        zigzag.centre = (0..40).map(far).collect();
        zigzag.left = zigzag.centre.iter().map(|p| *p + Vec2::new(-2.0, 2.0)).collect();
        zigzag.right = zigzag.centre.iter().map(|p| *p + Vec2::new(2.0, -2.0)).collect();
        road.lanes.push(zigzag);
        let fine = Pieces::of(&road);
        assert!(fine.entries() > 40_000 && fine.items.len() as u64 == fine.entries(), "{}", fine.entries());
        for most in [10_000, 500, 1] {
            let coarse = Pieces::gridded(fine.all.clone(), most);
            assert!(coarse.cell_m > fine.cell_m);
            assert!(coarse.entries() <= most || coarse.columns * coarse.rows == 1);
            for k in 0..400 {
                let point = Vec2::new(f64::from(k % 20) * 7.0 - 10.0, f64::from(k / 20) * 3.0 - 15.0);
                assert_eq!(found(&fine, point), found(&coarse, point), "{point:?}, {most}");
            }
        }
    }

    #[test]
    fn whoever_touches_a_place_is_told_of_it_and_few_others_are_wherever_the_road_lies() {
        for away_m in [0.0, 3e4, -2e6, 9e6] {
            let mut road = two_lane_scene().road;
            let away = Vec2::new(away_m, -0.7 * away_m);
            for lane in &mut road.lanes {
                for line in [&mut lane.centre, &mut lane.left, &mut lane.right] {
                    line.iter_mut().for_each(|p| *p = *p + away);
                }
            }
            let pieces = Pieces::of(&road);
            let (mut told, mut near) = (0, 0);
            for k in 0..4000 {
                let point = away + Vec2::new(f64::from(k % 80) * 1.75 - 7.0, f64::from(k / 80) * 0.35 - 4.9);
                // On the lines between pieces, and hardly beside them.
                for point in [point, point + Vec2::new(0.0, TOUCH_M), point - Vec2::new(TOUCH_M, 0.0)] {
                    let cell = |piece: &Piece| {
                        let ((columns, rows), (column, row)) = (pieces.cells_of(piece), pieces.cell_of(point));
                        columns.contains(&column) && rows.contains(&row)
                    };
                    let touches =
                        |piece: &Piece| piece.bound_distance_squared(point) <= TOUCH_M * TOUCH_M && cell(piece);
                    let indexed = || pieces.all().iter().enumerate().map(|(ix, piece)| (ix as u32, piece));
                    let expected: Vec<u32> = indexed().filter(|(_, piece)| touches(piece)).map(|(ix, _)| ix).collect();
                    let found: Vec<u32> = pieces.touching(point).map(|(ix, _)| ix).collect();
                    assert!(expected.iter().all(|ix| found.contains(ix)), "{point:?}: {found:?}, not {expected:?}");
                    (told, near) = (told + found.len(), near + expected.len());
                }
            }
            assert!(near > 1000 && (away_m.abs() > 1e6 || told < near + near / 4), "{away_m}: {told} {near}");
        }
    }
}
