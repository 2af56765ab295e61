//! The map around the ego as polylines, for planners that ask for it when they greet.

use serde::Serialize;

use crate::kernel::Vec2;
use crate::scene::Road;

/// Least and largest radius that a planner may ask for, metres.
pub const REACH_M: (f64, f64) = (1.0, 200.0);

/// The map within reach: pieces of lines in the scene's metres, each of two points or more.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MapNear {
    /// Lanes of which something lies within reach.
    pub lanes: Vec<LaneNear>,
    /// Pieces of the road's edges.
    pub edges: Vec<Vec<Vec2>>,
}

/// The pieces of one lane, in driving direction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LaneNear {
    /// Index of the lane in the lanes of `begin`.
    pub lane: usize,
    pub centre: Vec<Vec<Vec2>>,
    pub left: Vec<Vec<Vec2>>,
    pub right: Vec<Vec<Vec2>>,
}

impl MapNear {
    /// Returns everything of a road within reach of a point.
    pub fn around(road: &Road, at: Vec2, reach_m: f64) -> MapNear {
        let near = |line: &[Vec2]| pieces(line, at, reach_m);
        let lane = |(lane, of): (usize, &crate::scene::Lane)| {
            let (centre, left, right) = (near(&of.centre), near(&of.left), near(&of.right));
            let is_there = !(centre.is_empty() && left.is_empty() && right.is_empty());
            is_there.then_some(LaneNear { lane, centre, left, right })
        };
        MapNear {
            lanes: road.lanes.iter().enumerate().filter_map(lane).collect(),
            edges: road.edges.iter().flat_map(|edge| near(edge)).collect(),
        }
    }
}

/// Returns the longest runs of segments that all come within reach.
fn pieces(line: &[Vec2], at: Vec2, reach_m: f64) -> Vec<Vec<Vec2>> {
    let mut pieces: Vec<Vec<Vec2>> = Vec::new();
    let mut follows = false;
    for pair in line.windows(2) {
        let is_near = distance(pair[0], pair[1], at) <= reach_m;
        match (is_near, follows, pieces.last_mut()) {
            (true, true, Some(piece)) => piece.push(pair[1]),
            (true, ..) => pieces.push(pair.to_vec()),
            (false, ..) => {}
        }
        follows = is_near;
    }
    pieces
}

/// Returns the distance from a point to the nearest one of a segment, metres.
fn distance(from: Vec2, to: Vec2, at: Vec2) -> f64 {
    let along = to - from;
    let share = (at - from).dot(along) / along.norm_squared().max(f64::MIN_POSITIVE);
    from.lerp(to, share.clamp(0.0, 1.0)).distance(at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::scenes::crossing;

    fn points(places: &[(f64, f64)]) -> Vec<Vec2> {
        places.iter().map(|(x, y)| Vec2::new(*x, *y)).collect()
    }

    #[test]
    fn a_line_that_leaves_and_comes_back_is_two_pieces_and_a_far_one_is_nothing() {
        let line = points(&[(0.0, 0.0), (5.0, 0.0), (50.0, 0.0), (50.0, 50.0), (5.0, 50.0), (5.0, 5.0), (0.0, 5.0)]);
        // The second segment begins within reach, the one that comes back ends there.
        let near = pieces(&line, Vec2::new(0.0, 0.0), 10.0);
        assert_eq!(
            near,
            [points(&[(0.0, 0.0), (5.0, 0.0), (50.0, 0.0)]), points(&[(5.0, 50.0), (5.0, 5.0), (0.0, 5.0)])]
        );
        // A segment whose ends are both far passes near.
        assert_eq!(pieces(&points(&[(-90.0, 3.0), (90.0, 3.0)]), Vec2::new(0.0, 0.0), 10.0).len(), 1);
        assert!(pieces(&line, Vec2::new(500.0, 0.0), 10.0).is_empty());
        assert!(pieces(&points(&[(0.0, 0.0)]), Vec2::new(0.0, 0.0), 10.0).is_empty());
    }

    #[test]
    fn what_is_near_is_named_by_its_lane_and_grows_with_the_reach() {
        let scene = crossing(3, 6, 91);
        let at = scene.ego.track.samples.iter().flatten().next().unwrap().position;
        let count = |reach_m: f64| MapNear::around(&scene.road, at, reach_m).lanes.len();
        assert!(count(2.0) >= 1 && count(2.0) <= count(200.0), "{} {}", count(2.0), count(200.0));
        for lane in MapNear::around(&scene.road, at, 200.0).lanes {
            let own = &scene.road.lanes[lane.lane];
            assert!(lane.centre.iter().flatten().all(|point| own.centre.contains(point)));
            assert!(lane.left.iter().flatten().all(|point| own.left.contains(point)));
        }
    }
}
