//! The lane graph: which lane something drives in, how far it is from the road, and where it can go from there.
//! Built once per scene from its road; queries allocate nothing, except [`LaneGraph::reachable`].

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::sync::Arc;

use super::pieces::Pieces;
use super::{LaneIx, Neighbour, Road};
use crate::kernel::{Polyline, Pose, Vec2, num};

/// Something drives in a lane when its heading is within 45 degrees of the lane's (CAT's criterion).
pub const HEADING_DIFFERENCE_MAX_RAD: f64 = num::PI / 4.0;
/// Distances from the road are measured up to this value, metres.
pub const OFF_ROAD_MAX_M: f64 = 100.0;

/// Place of a point in a lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LanePlace {
    /// Which lane.
    pub lane: LaneIx,
    /// Arc length along the centre line, metres.
    pub s_m: f64,
    /// Signed lateral offset from the centre line, positive to the left, metres.
    pub offset_m: f64,
    /// Direction of the lane there.
    pub heading_rad: f64,
    /// Distance to the centre line, metres: larger than `offset_m` beyond a lane's end.
    pub distance_m: f64,
}

/// A lane that can be driven to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// Which lane.
    pub lane: LaneIx,
    /// Way from the start of the search to this lane's first point, metres; negative for lanes alongside.
    pub start_m: f64,
    /// Lane changes on the way.
    pub lane_changes: usize,
    /// The lane before it; `None` for the first.
    pub via: Option<LaneIx>,
}

/// Lanes with their topology and a grid for queries by place.
#[derive(Clone, Debug)]
pub struct LaneGraph {
    centres: Vec<Option<Polyline>>,
    exits: Vec<Vec<LaneIx>>,
    entries: Vec<Vec<LaneIx>>,
    neighbours: Vec<[Vec<LaneIx>; 2]>,
    through: Vec<bool>,
    pieces: Arc<Pieces>,
}

impl LaneGraph {
    /// Builds the graph of a validated road. Links to lanes that do not exist are left out.
    pub fn of(road: &Road) -> LaneGraph {
        let count = road.lanes.len();
        let known = |links: &[LaneIx]| links.iter().copied().filter(|&ix| ix < count).collect::<Vec<_>>();
        let beside = |side: &[Neighbour]| {
            let fits = side.iter().filter(|n| n.lane < count && n.same_direction);
            fits.map(|n| n.lane).collect::<Vec<_>>()
        };
        let pieces = Arc::new(Pieces::of(road));
        let mut through = vec![false; count];
        for piece in pieces.all() {
            through[piece.lane()] = piece.is_through();
        }
        LaneGraph {
            centres: road.lanes.iter().map(|lane| Polyline::new(lane.centre.clone()).ok()).collect(),
            exits: road.lanes.iter().map(|lane| known(&lane.exits)).collect(),
            entries: road.lanes.iter().map(|lane| known(&lane.entries)).collect(),
            neighbours: road.lanes.iter().map(|l| [beside(&l.left_neighbours), beside(&l.right_neighbours)]).collect(),
            through,
            pieces,
        }
    }

    /// The surface of its lanes, piece by piece.
    pub fn pieces(&self) -> &Arc<Pieces> {
        &self.pieces
    }

    /// Number of lanes of the road.
    pub fn lane_count(&self) -> usize {
        self.centres.len()
    }

    /// Centre line of a lane; `None` beyond the last lane.
    pub fn centre(&self, lane: LaneIx) -> Option<&Polyline> {
        self.centres.get(lane).and_then(Option::as_ref)
    }

    /// Length of a lane, metres; 0 for a lane that is not there.
    pub fn length_m(&self, lane: LaneIx) -> f64 {
        self.centre(lane).map_or(0.0, Polyline::length_m)
    }

    /// Lanes that a lane leads into.
    pub fn exits(&self, lane: LaneIx) -> &[LaneIx] {
        self.exits.get(lane).map_or(&[], Vec::as_slice)
    }

    /// Lanes that lead into a lane.
    pub fn entries(&self, lane: LaneIx) -> &[LaneIx] {
        self.entries.get(lane).map_or(&[], Vec::as_slice)
    }

    /// Left, then right neighbours of the same driving direction, each somewhere beside the lane.
    pub fn beside(&self, lane: LaneIx) -> impl Iterator<Item = LaneIx> {
        self.neighbours.get(lane).into_iter().flatten().flatten().copied()
    }

    /// Returns the same at a point: of several neighbours on a side the nearest one.
    pub fn beside_at(&self, lane: LaneIx, point: Vec2) -> impl Iterator<Item = LaneIx> {
        let away = move |lane: &LaneIx| {
            self.centre(*lane).map_or(f64::INFINITY, |line| line.at(line.project(point).s_m).distance(point))
        };
        let nearest = move |side: &Vec<LaneIx>| match side.as_slice() {
            [one] => Some(*one),
            side => side.iter().copied().min_by(|a, b| away(a).total_cmp(&away(b))),
        };
        self.neighbours.get(lane).into_iter().flatten().filter_map(nearest)
    }

    /// Streets and freeways; not bike lanes, shoulders, sidewalks.
    pub fn is_through(&self, lane: LaneIx) -> bool {
        self.through.get(lane).copied().unwrap_or(false)
    }

    /// The street or freeway lane whose centre line is nearest, among those heading the same way (within 45 degrees)
    /// and at most `within_m` away. If two are equally near, the one with the lower index.
    pub fn nearest_lane(&self, point: Vec2, heading_rad: f64, within_m: f64) -> Option<LanePlace> {
        let heading = Vec2::from_heading(heading_rad);
        let least = num::cos(HEADING_DIFFERENCE_MAX_RAD);
        self.nearest(point, within_m, |direction| direction.dot(heading) > least)
    }

    /// Like [`LaneGraph::nearest_lane`] for lanes of any heading.
    pub fn nearest_lane_any_heading(&self, point: Vec2, within_m: f64) -> Option<LanePlace> {
        self.nearest(point, within_m, |_| true)
    }

    /// All street and freeway lanes heading the same way (within 45 degrees) with a centre line at most `within_m` away,
    /// nearest first, then by index. Allocates.
    pub fn lanes_near(&self, point: Vec2, heading_rad: f64, within_m: f64) -> Vec<LanePlace> {
        let mut lanes = Vec::new();
        self.pieces.outward(point, within_m, |_, piece| {
            lanes.push(piece.lane());
            within_m
        });
        lanes.sort_unstable();
        lanes.dedup();
        let fits =
            |place: &LanePlace| num::wrap_angle(place.heading_rad - heading_rad).abs() < HEADING_DIFFERENCE_MAX_RAD;
        let through = lanes.into_iter().filter(|&lane| self.is_through(lane));
        let places = through.filter_map(|lane| self.place_in(lane, point));
        let mut places: Vec<LanePlace> = places.filter(|p| p.distance_m <= within_m).filter(fits).collect();
        places.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m).then(a.lane.cmp(&b.lane)));
        places
    }

    /// Direction of the nearest street or freeway lane within `within_m`, radians.
    pub fn heading_at(&self, point: Vec2, within_m: f64) -> Option<f64> {
        self.nearest_lane_any_heading(point, within_m).map(|place| place.heading_rad)
    }

    fn nearest(&self, point: Vec2, within_m: f64, fits: impl Fn(Vec2) -> bool) -> Option<LanePlace> {
        let (distance, ix, along) = self.nearest_piece(point, within_m, fits)?;
        let piece = &self.pieces.all()[ix as usize];
        let side = piece.direction.cross(point - piece.from);
        let distance_m = distance.sqrt();
        Some(LanePlace {
            lane: piece.lane(),
            s_m: piece.start_s_m + along,
            offset_m: side,
            heading_rad: piece.direction.heading(),
            distance_m,
        })
    }

    /// Squared distance, place among the pieces, and arc length on the piece.
    fn nearest_piece(&self, point: Vec2, within_m: f64, fits: impl Fn(Vec2) -> bool) -> Option<(f64, u32, f64)> {
        if !point.is_finite() {
            return None;
        }
        let mut best: Option<(f64, u32, f64)> = None;
        let mut bound_squared = within_m * within_m;
        self.pieces.outward(point, within_m, |ix, piece| {
            if piece.is_through() && piece.length_m > 0.0 && fits(piece.direction) {
                let (along, distance) = piece.nearest(point);
                // Pieces stand by lane, then along it.
                let nearer = best.is_none_or(|b| (distance, ix) < (b.0, b.1));
                if distance <= bound_squared && nearer {
                    best = Some((distance, ix, along));
                    bound_squared = distance;
                }
            }
            bound_squared.sqrt()
        });
        best
    }

    /// Returns the place of a point on one lane's centre line.
    pub fn place_in(&self, lane: LaneIx, point: Vec2) -> Option<LanePlace> {
        let projected = self.centre(lane)?.project(point);
        Some(LanePlace {
            lane,
            s_m: projected.s_m,
            offset_m: projected.offset_m,
            heading_rad: projected.heading_rad,
            distance_m: projected.offset_m.abs(),
        })
    }

    /// Pose on a lane's centre line.
    pub fn pose_at(&self, lane: LaneIx, s_m: f64) -> Option<Pose> {
        let centre = self.centre(lane)?;
        let segment = centre.segment_at(s_m);
        let along = centre.points()[segment + 1] - centre.points()[segment];
        Some(Pose { position: centre.at(s_m), heading_rad: along.heading() })
    }

    /// Returns `true` if a point lies on the surface of a lane of any kind.
    pub fn is_drivable(&self, point: Vec2) -> bool {
        self.pieces.touching(point).any(|(_, piece)| piece.contains(point))
    }

    /// Distance from a point to the surface of the nearest lane, metres: 0 on the road, at most
    /// [`OFF_ROAD_MAX_M`]; 0 everywhere for a road without lanes.
    ///
    /// Over the same pieces as `sim::drivable`, which answers another question (the largest distance of a rollout, capped
    /// at 50 m, with a floor below which nothing is searched) and measures along each edge from its other end. Both are
    /// exact to rounding; they differ in last bits on which recorded results rest, so neither takes the other's place.
    pub fn off_road_m(&self, point: Vec2) -> f64 {
        self.off_road_within_m(point, OFF_ROAD_MAX_M)
    }

    /// Returns the smaller of [`LaneGraph::off_road_m`] and `within_m`, for callers that need no larger value.
    pub fn off_road_within_m(&self, point: Vec2, within_m: f64) -> f64 {
        if self.pieces.all().is_empty() || self.is_drivable(point) {
            return 0.0;
        }
        let mut best = within_m * within_m;
        let mut best_m = within_m;
        self.pieces.outward(point, within_m, |_, piece| {
            if piece.bound_distance_squared(point) < best {
                let distance = piece.rim_distance_squared(point);
                if distance < best {
                    best = distance;
                    best_m = distance.sqrt();
                }
            }
            best_m
        });
        best_m
    }

    /// Returns the larger of `least_m` and [`LaneGraph::off_road_within_m`], to find the largest along a way: a place no farther than
    /// what is already known needs no search. `near` is the piece that the last place lay on or near, any number at
    /// first; a good guess saves time and changes no bit.
    pub fn off_road_beyond_m(&self, point: Vec2, least_m: f64, within_m: f64, near: &mut u32) -> f64 {
        let guess = self.pieces.all().get(*near as usize);
        if self.pieces.all().is_empty() || guess.is_some_and(|piece| piece.contains(point)) {
            return least_m;
        }
        if let Some((under, _)) = self.pieces.touching(point).find(|(_, piece)| piece.contains(point)) {
            *near = under;
            return least_m;
        }
        if guess.is_some_and(|piece| piece.rim_distance_squared(point).sqrt() <= least_m) {
            return least_m;
        }
        least_m.max(self.off_road_within_m(point, within_m))
    }

    /// The larger of `least_m` and the distance to the nearest street or freeway lane of any heading, at most `within_m`. `near`
    /// is as for [`LaneGraph::off_road_beyond_m`].
    pub fn lane_distance_beyond_m(&self, point: Vec2, least_m: f64, within_m: f64, near: &mut u32) -> f64 {
        let guess = self.pieces.all().get(*near as usize).filter(|piece| piece.is_through() && piece.length_m > 0.0);
        if guess.is_some_and(|piece| piece.nearest(point).1.sqrt() <= least_m) {
            return least_m;
        }
        match self.nearest_piece(point, within_m, |_| true) {
            Some((distance, ix, _)) => {
                *near = ix;
                least_m.max(distance.sqrt())
            }
            None => least_m.max(within_m),
        }
    }

    /// Lanes that can be driven to from `s_m` on `lane` within `budget_m`: over exits, and sideways into neighbours of
    /// the same direction. Each lane once, with the fewest lane changes, then the shortest way; in that order.
    pub fn reachable(&self, lane: LaneIx, s_m: f64, budget_m: f64) -> Vec<Reached> {
        let mut reached: Vec<Reached> = Vec::new();
        let mut done = vec![false; self.lane_count()];
        let mut open = BinaryHeap::new();
        if self.centre(lane).is_some() {
            open.push(Reverse(Open(Reached { lane, start_m: -s_m, lane_changes: 0, via: None })));
        }
        while let Some(Reverse(Open(next))) = open.pop() {
            if std::mem::replace(&mut done[next.lane], true) {
                continue;
            }
            reached.push(next);
            let end_m = next.start_m + self.length_m(next.lane);
            let onward = self.exits(next.lane).iter().filter(|_| end_m <= budget_m).map(|&to| (to, end_m, 0));
            let aside = self.beside(next.lane).map(|to| (to, self.start_beside(&next, to), 1));
            for (to, start_m, change) in onward.chain(aside) {
                if !done[to] && self.centre(to).is_some() {
                    let lane_changes = next.lane_changes + change;
                    open.push(Reverse(Open(Reached { lane: to, start_m, lane_changes, via: Some(next.lane) })));
                }
            }
        }
        reached
    }

    /// Way to the first point of a neighbour: equal progress at equal places across the road.
    fn start_beside(&self, from: &Reached, to: LaneIx) -> f64 {
        let start = self.centre(to).map(|line| line.points()[0]);
        let place = start.and_then(|p| self.centre(from.lane).map(|line| line.project(p).s_m));
        let back = self.centre(from.lane).map(|line| line.points()[0]);
        let behind = back.and_then(|p| self.centre(to).map(|line| line.project(p).s_m));
        // One of the two is 0 if the neighbour starts behind this lane or ahead of it.
        from.start_m + place.unwrap_or(0.0) - behind.unwrap_or(0.0)
    }
}

/// Order of the search: fewest lane changes, then shortest way, then lane index.
struct Open(Reached);

impl Open {
    fn key(&self) -> (usize, f64, LaneIx, Option<LaneIx>) {
        (self.0.lane_changes, self.0.start_m, self.0.lane, self.0.via)
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Open) -> Ordering {
        let (a, b) = (self.key(), other.key());
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)).then(a.3.cmp(&b.3))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Open) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Open) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::LaneKind;
    use crate::scene::fixture::two_lane_scene;
    use proptest::prelude::*;

    fn graph() -> LaneGraph {
        LaneGraph::of(&two_lane_scene().road)
    }

    #[test]
    fn the_nearest_lane_heads_the_same_way() {
        let east = graph().nearest_lane(Vec2::new(42.0, 2.0), 0.1, 10.0).unwrap();
        assert_eq!((east.lane, east.s_m, east.heading_rad), (1, 42.0, 0.0));
        assert!((east.offset_m - -1.5).abs() < 1e-12 && (east.distance_m - 1.5).abs() < 1e-12);
        assert_eq!(graph().nearest_lane(Vec2::new(42.0, 2.0), 2.0, 10.0), None);
        assert_eq!(graph().nearest_lane(Vec2::new(114.0, 30.0), 1.5, 10.0).map(|p| p.lane), Some(3));
        assert_eq!(graph().nearest_lane(Vec2::new(42.0, 30.0), 0.0, 10.0), None);
    }

    #[test]
    fn bike_lanes_are_drivable_surface_but_no_lane_to_drive_in() {
        let mut road = two_lane_scene().road;
        road.lanes[1].kind = LaneKind::Bike;
        let graph = LaneGraph::of(&road);
        let beside = Vec2::new(42.0, 3.5);
        assert_eq!(graph.nearest_lane(beside, 0.0, 10.0).map(|p| p.lane), Some(0));
        assert!(graph.is_drivable(beside));
    }

    #[test]
    fn distance_from_the_road_is_zero_on_it_and_exact_beside_it() {
        let graph = graph();
        assert_eq!(graph.off_road_m(Vec2::new(50.0, 4.0)), 0.0);
        assert!((graph.off_road_m(Vec2::new(50.0, -4.75)) - 3.0).abs() < 1e-12);
        assert!((graph.off_road_m(Vec2::new(-3.0, -5.75)) - 5.0).abs() < 1e-12);
        assert_eq!(graph.off_road_m(Vec2::new(1e5, -1e5)), OFF_ROAD_MAX_M);
        assert_eq!(LaneGraph::of(&Road::default()).off_road_m(Vec2::ZERO), 0.0);
    }

    #[test]
    fn reachable_lanes_follow_exits_and_lane_changes_within_the_budget() {
        let short = graph().reachable(0, 40.0, 50.0);
        assert_eq!(
            short.iter().map(|r| (r.lane, r.start_m, r.lane_changes)).collect::<Vec<_>>(),
            [(0, -40.0, 0), (1, -40.0, 1)]
        );
        let long = graph().reachable(1, 40.0, 80.0);
        let projected: Vec<_> = long.iter().map(|r| (r.lane, r.start_m, r.lane_changes, r.via)).collect();
        assert_eq!(
            projected,
            [(1, -40.0, 0, None), (0, -40.0, 1, Some(1)), (2, 60.0, 1, Some(0)), (3, 60.0, 1, Some(0))]
        );
    }

    #[test]
    fn of_several_neighbours_the_one_at_the_place_is_beside_it() {
        let mut road = two_lane_scene().road;
        // Lane 1 ends halfway, and its continuation is beside the second half of lane 0.
        let mut second = road.lanes[1].clone();
        let first = &mut road.lanes[1];
        for line in [&mut first.centre, &mut first.left, &mut first.right] {
            line.truncate(6);
        }
        for line in [&mut second.centre, &mut second.left, &mut second.right] {
            line.drain(..5);
        }
        second.id = "b2".into();
        road.lanes.push(second);
        road.lanes[0].left_neighbours.push(Neighbour { lane: 4, same_direction: true });
        let graph = LaneGraph::of(&road);
        assert_eq!(graph.beside(0).collect::<Vec<_>>(), [1, 4]);
        let beside = |x: f64| graph.beside_at(0, Vec2::new(x, 0.0)).collect::<Vec<_>>();
        assert_eq!((beside(20.0), beside(80.0)), (vec![1], vec![4]));
        let starts: Vec<_> = graph.reachable(0, 10.0, 30.0).iter().map(|r| (r.lane, r.start_m)).collect();
        assert_eq!(starts, [(0, -10.0), (1, -10.0), (4, 40.0)]);
    }

    #[test]
    fn a_circle_of_lanes_ends_the_search() {
        let mut road = two_lane_scene().road;
        road.lanes[2].exits = vec![0];
        road.lanes[0].entries = vec![2];
        assert_eq!(LaneGraph::of(&road).reachable(0, 0.0, 1e9).len(), 4);
    }

    proptest! {
        #[test]
        fn the_grid_finds_what_a_search_through_all_pieces_finds(
            x in -60.0..220.0f64, y in -60.0..120.0f64, heading in -3.1..3.1f64,
        ) {
            let (graph, point) = (graph(), Vec2::new(x, y));
            let cos = num::cos(HEADING_DIFFERENCE_MAX_RAD);
            let fits = |p: &&super::super::pieces::Piece| p.direction.dot(Vec2::from_heading(heading)) > cos;
            let best = graph.pieces.all().iter().filter(fits).map(|p| p.nearest(point).1).fold(f64::INFINITY, f64::min);
            let projected = graph.nearest_lane(point, heading, 30.0).map(|p| p.distance_m);
            prop_assert_eq!(projected, Some(best.sqrt()).filter(|d| *d <= 30.0));
            let rim = graph.pieces.all().iter().map(|p| if p.contains(point) { 0.0 } else { p.rim_distance_squared(point) });
            let off = rim.fold(f64::INFINITY, f64::min).sqrt().min(OFF_ROAD_MAX_M);
            prop_assert_eq!(graph.off_road_m(point), off);
        }

        #[test]
        fn the_largest_distances_along_a_way_are_the_same_whatever_was_guessed(
            way in prop::collection::vec((-30.0..190.0f64, -15.0..25.0f64), 1..12),
            guess in 0u32..60, within_m in 0.5..40.0f64,
        ) {
            let graph = graph();
            let (mut near_road, mut near_lane) = (guess, guess);
            let (mut off, mut aside) = ((0.0f64, 0.0f64), (0.0f64, 0.0f64));
            for (x, y) in way {
                let point = Vec2::new(x, y);
                // A caller that has reached the bound asks no further.
                if off.0 < within_m {
                    off.0 = graph.off_road_beyond_m(point, off.0, within_m, &mut near_road);
                }
                off.1 = off.1.max(graph.off_road_within_m(point, within_m));
                if aside.0 < within_m {
                    aside.0 = graph.lane_distance_beyond_m(point, aside.0, within_m, &mut near_lane);
                }
                let place = graph.nearest_lane_any_heading(point, within_m);
                aside.1 = aside.1.max(place.map_or(within_m, |place| place.distance_m));
                prop_assert_eq!((off.0.to_bits(), aside.0.to_bits()), (off.1.to_bits(), aside.1.to_bits()));
            }
        }
    }
}
