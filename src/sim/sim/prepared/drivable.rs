//! The drivable surface and its directions: exact distances to the union of all lane surfaces. A lane's surface is
//! the strip of quadrilaterals between its left and right line; they and their grid are those of the lane graph.
//!
//! Three computations of the project use this surface. This one serves rollouts: it looks for the largest distance so
//! far, starts at the piece that last held the place, and skips what cannot raise the maximum. `LaneGraph::off_road_m`
//! serves single questions up to 100 m. `stage::road_field::RoadField` is a raster of signed distances with slopes, for
//! searches by gradient, right to half a cell. The first two share their pieces, and results depend on both in the last bits.

use std::sync::Arc;

use crate::kernel::Vec2;
use crate::scene::LaneKind;
use crate::scene::pieces::{Piece, Pieces};

/// Largest distance that is reported for a place off all lanes, metres.
pub const OFF_ROAD_M_CAP: f64 = 50.0;
/// Length of a centre line below which a piece is no surface, metres.
const PIECE_M_MIN: f64 = 1e-9;
/// Allowance for rounding, where the rectangle around a piece shows that the piece is farther away than something, m². Its root is
/// [`TOUCH_M`](crate::scene::pieces::TOUCH_M).
const SLACK_M2: f64 = 1e-6;
/// Distance of a place from a line beyond which rounding does not decide on which side the place lies, metres.
const SURE_M: f64 = 1e-6;

/// The drivable surface of a scene.
#[derive(Clone, Debug)]
pub struct Drivable {
    pieces: Arc<Pieces>,
    known: bool,
}

impl Drivable {
    /// Makes the surface of these pieces. A road without lanes has none: see [`Drivable::is_known`].
    pub fn of(pieces: Arc<Pieces>) -> Drivable {
        let known = pieces.all().iter().any(counts);
        Drivable { pieces, known }
    }

    /// Returns `true` if the scene says where one may drive. If not, nothing is ever off-road or on the wrong side.
    pub fn is_known(&self) -> bool {
        self.known
    }

    fn piece(&self, hint: u32) -> Option<&Piece> {
        self.pieces.all().get(hint as usize).filter(|piece| counts(piece))
    }

    /// Returns the distance from a point to the nearest lane surface, metres; 0 on it, at most [`OFF_ROAD_M_CAP`]. Exact if it is
    /// above `floor_m`; below, any number up to `floor_m` may come back (a search for a maximum needs no more).
    /// `hint` is a piece near the point (any number will do); it is set to the nearest one found.
    pub fn distance_m(&self, point: Vec2, floor_m: f64, hint: &mut u32) -> f64 {
        if !self.is_known() {
            return 0.0;
        }
        let mut best = OFF_ROAD_M_CAP * OFF_ROAD_M_CAP;
        if let Some(piece) = self.piece(*hint) {
            best = best.min(squared_distance(&corners(piece), point));
        }
        // A hair below the square, so that rounding cannot lift a rejected distance above the floor.
        let enough = floor_m * floor_m * (1.0 - 1e-12);
        if best <= enough {
            return best.sqrt();
        }
        let mut best_m = best.sqrt();
        self.pieces.outward(point, best_m, |ix, piece| {
            // The rectangle around a piece is tested first, because most pieces of a cell are far from the place.
            if counts(piece) && piece.bound_distance_squared(point) <= best + SLACK_M2 {
                let squared = squared_distance(&corners(piece), point);
                if squared < best {
                    (best, *hint) = (squared, ix);
                    best_m = if best <= enough { -1.0 } else { best.sqrt() };
                }
            }
            best_m
        });
        best.sqrt()
    }

    /// Returns `true` if a point lies on the surface, where [`Drivable::distance_m`] is 0; costs less where it does not. `hint` as there.
    pub fn holds(&self, point: Vec2, hint: &mut u32) -> bool {
        self.holds_for_m(point, Vec2::ZERO, hint).is_some()
    }

    /// Does the same, and returns how far a ray from there in a unit direction surely stays on the piece that holds the point, metres: `None`
    /// beside the surface, 0 where that piece holds it by rounding only.
    pub fn holds_for_m(&self, point: Vec2, direction: Vec2, hint: &mut u32) -> Option<f64> {
        if !self.is_known() {
            return Some(f64::INFINITY);
        }
        let on = |piece: &Piece| {
            if piece.bound_distance_squared(point) > SLACK_M2 {
                return None;
            }
            match lies(piece, point, direction) {
                Lies::Inside { sure_m } => Some(sure_m),
                Lies::Outside => None,
                Lies::Unsure => is_on(&corners(piece), point).then_some(0.0),
            }
        };
        if let Some(sure_m) = self.piece(*hint).and_then(on) {
            return Some(sure_m);
        }
        let mut pieces = self.pieces.touching(point).filter(|(_, piece)| counts(piece));
        let (ix, sure_m) = pieces.find_map(|(ix, piece)| Some((ix, on(piece)?)))?;
        *hint = ix;
        Some(sure_m)
    }

    /// Returns how far a ray from a point in a unit direction surely stays on the piece `hint`, metres: [`Drivable::holds`] is true
    /// all the way. 0 where the point is not well inside that piece.
    pub fn surely_holds_for_m(&self, point: Vec2, direction: Vec2, hint: u32) -> f64 {
        match self.piece(hint).map(|piece| lies(piece, point, direction)) {
            Some(Lies::Inside { sure_m }) => sure_m,
            _ => 0.0,
        }
    }

    /// Returns `true` if a point lies on lanes all of which run against `axis` (more than 90° off). `hint` as in
    /// [`Drivable::distance_m`].
    pub fn is_wrong_way(&self, point: Vec2, axis: Vec2, hint: &mut u32) -> bool {
        let along = |piece: &Piece| contains(&corners(piece), point) && driving_direction(piece).dot(axis) >= 0.0;
        if !self.is_known() || self.piece(*hint).is_some_and(along) {
            return false;
        }
        let mut against = false;
        for (ix, piece) in self.pieces.touching(point) {
            if counts(piece) && contains(&corners(piece), point) {
                if driving_direction(piece).dot(axis) >= 0.0 {
                    *hint = ix;
                    return false;
                }
                against = true;
            }
        }
        against
    }
}

fn counts(piece: &Piece) -> bool {
    piece.length_m >= PIECE_M_MIN
}

/// Returns the rear-left, rear-right, front-right and front-left corner.
fn corners(piece: &Piece) -> [Vec2; 4] {
    let [rear_left, front_left, front_right, rear_right] = piece.surface;
    [rear_left, rear_right, front_right, front_left]
}

/// Returns a unit vector; zero where the lane has no direction (shoulders, parking, sidewalks).
fn driving_direction(piece: &Piece) -> Vec2 {
    if piece.kind == LaneKind::Other { Vec2::ZERO } else { piece.direction }
}

#[cfg(test)]
impl Drivable {
    fn counted(&self) -> impl Iterator<Item = &Piece> {
        self.pieces.all().iter().filter(|p| counts(p))
    }

    /// [`Drivable::distance_m`] by looking at every piece.
    pub fn distance_by_walk_m(&self, point: Vec2) -> f64 {
        if !self.is_known() {
            return 0.0;
        }
        let nearest = self.counted().map(|p| squared_distance(&corners(p), point)).fold(f64::INFINITY, f64::min);
        nearest.sqrt().min(OFF_ROAD_M_CAP)
    }

    /// [`Drivable::holds`] by looking at every piece.
    pub fn holds_by_walk(&self, point: Vec2) -> bool {
        !self.is_known() || self.counted().any(|p| squared_distance(&corners(p), point) <= 0.0)
    }

    /// [`Drivable::is_wrong_way`] by looking at every piece.
    pub fn is_wrong_way_by_walk(&self, point: Vec2, axis: Vec2) -> bool {
        let mut under = self.counted().filter(|p| contains(&corners(p), point)).peekable();
        under.peek().is_some() && under.all(|p| driving_direction(p).dot(axis) < 0.0)
    }
}

/// Position of a place relative to a piece.
enum Lies {
    /// Well inside, and further on for so many metres in some direction.
    Inside { sure_m: f64 },
    /// Well outside.
    Outside,
    /// So near to an edge that rounding decides, or the piece is folded.
    Unsure,
}

/// Decides by the side of each edge on which the place is.
fn lies(piece: &Piece, point: Vec2, direction: Vec2) -> Lies {
    let corners = corners(piece);
    let (mut sure_m, mut is_inside) = (f64::INFINITY, true);
    let mut a = corners[3];
    for b in corners {
        // The corners run counter-clockwise, so inside is to the left of every edge. Where that holds of all four
        // edges the surface winds once around the place, folded or not.
        let edge = b - a;
        let margin = SURE_M * (edge.x.abs() + edge.y.abs());
        let (left, change) = (edge.cross(point - a), edge.cross(direction));
        if left < margin {
            if piece.is_convex && left < -margin {
                return Lies::Outside;
            }
            is_inside = false;
        }
        if change < 0.0 {
            sure_m = sure_m.min((left - margin) / -change);
        }
        a = b;
    }
    if is_inside { Lies::Inside { sure_m: if sure_m.is_finite() { sure_m } else { 0.0 } } } else { Lies::Unsure }
}

/// Runs the even-odd test of a quadrilateral, folded ones included.
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
        best = best.min(squared_distance_to_edge(a, b, point));
        a = b;
    }
    best
}

fn squared_distance_to_edge(a: Vec2, b: Vec2, point: Vec2) -> f64 {
    let along = b - a;
    let squared = along.norm_squared();
    let share = if squared > 0.0 { ((point - a).dot(along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (point - a - along * share).norm_squared()
}

/// Returns `true` if [`squared_distance`] is 0. Divides only where the point lies on an edge's line or nearly so.
fn is_on(corners: &[Vec2; 4], point: Vec2) -> bool {
    if contains(corners, point) {
        return true;
    }
    let mut a = corners[3];
    for &b in corners {
        let edge = b - a;
        let off_line = edge.cross(point - a).abs() > SURE_M * (edge.x.abs() + edge.y.abs());
        if !off_line && squared_distance_to_edge(a, b, point) <= 0.0 {
            return true;
        }
        a = b;
    }
    false
}

/// Surfaces for the tests of this module.
#[cfg(test)]
pub(in crate::sim) mod samples {
    use super::*;
    use crate::scene::Road;
    use crate::sim::scenes::lane;

    /// Makes lanes in all directions that cross, touch and leave gaps; some share an end or an edge. 1 is half a metre.
    pub fn surface(ends: &[(i32, i32)]) -> Drivable {
        let place = |&(x, y): &(i32, i32)| Vec2::new(0.5 * f64::from(x), 0.5 * f64::from(y));
        let lanes = ends.windows(2).filter(|e| e[0] != e[1]).map(|e| lane(place(&e[0]), place(&e[1])));
        Drivable::of(Arc::new(Pieces::of(&Road { lanes: lanes.collect(), ..Road::default() })))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::scene::Road;
    use crate::sim::scenes::lane;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        // Lanes of recorded maps have pieces that are folded or bent inward, where a place may lie on the surface and to the right of
        // an edge.
        #[test]
        fn a_piece_of_any_form_holds_what_the_walk_says_and_as_far_as_it_says(
            corners in prop::collection::vec((-12..=12i32, -12..=12i32), 8..=24),
            from in (-26..=26, -26..=26),
            turn in 0..48,
            hint in 0u32..6,
        ) {
            let place = |at: &(i32, i32)| Vec2::new(0.5 * f64::from(at.0), 0.5 * f64::from(at.1));
            let lanes = corners.chunks_exact(4).map(|drawn| {
                let mut lane = lane(Vec2::ZERO, Vec2::new(1.0, 0.0));
                (lane.left, lane.right) = (drawn[..2].iter().map(place).collect(), drawn[2..].iter().map(place).collect());
                lane
            });
            let road = Drivable::of(Arc::new(Pieces::of(&Road { lanes: lanes.collect(), ..Road::default() })));
            let from = Vec2::new(0.25 * f64::from(from.0), 0.25 * f64::from(from.1));
            let direction = Vec2::from_heading(f64::from(turn) * std::f64::consts::TAU / 48.0);
            let held_m = road.holds_for_m(from, direction, &mut { hint });
            prop_assert_eq!(held_m.is_some(), road.holds_by_walk(from));
            for share in [0.25, 0.5, 1.0] {
                let sure_m = share * held_m.unwrap_or(0.0);
                prop_assert!(held_m.is_none() || road.holds_by_walk(from + direction * sure_m), "{sure_m} of {held_m:?} m");
            }
        }
    }
}
