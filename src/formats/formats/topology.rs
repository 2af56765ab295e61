//! Links between lanes where a format names none: ends that meet beginnings, and lanes side by side.

use crate::kernel::{Polyline, Vec2, num};
use crate::scene::{LaneGraph, LaneIx, Neighbour, Road};

/// A lane leads into another one that begins within this distance of its end, metres, ...
const MEET_WITHIN_M: f64 = 0.6;
/// ... and whose direction differs by at most this, radians (20 degrees).
const MEET_HEADING_MAX_RAD: f64 = 0.349;
/// Most exits that are recovered for one lane; no real lane has more.
const EXITS_MAX: usize = 16;

/// Roughly the most lane pieces that a search for neighbours may look at; a more crowded road gets no neighbours.
const SEARCH_MAX: usize = 1_000_000_000;

/// Adds exits and entries by matching ends with beginnings.
pub fn link_by_ends(road: &mut Road) {
    let ends: Vec<Option<(Vec2, f64, Vec2, f64)>> =
        road.lanes.iter().map(|lane| first_and_last(&lane.centre)).collect();
    let mut starts: Vec<(f64, LaneIx)> =
        ends.iter().enumerate().filter_map(|(ix, end)| end.map(|e| (e.0.x, ix))).collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for (ix, end) in ends.iter().enumerate() {
        let Some((_, _, end, heading)) = *end else { continue };
        let first = starts.partition_point(|s| s.0 < end.x - MEET_WITHIN_M);
        for &(_, to) in starts[first..].iter().take_while(|s| s.0 <= end.x + MEET_WITHIN_M) {
            let Some((start, start_heading, _, _)) = ends[to] else { continue };
            let turn = num::wrap_angle(start_heading - heading).abs();
            let meets = to != ix && start.distance(end) < MEET_WITHIN_M && turn < MEET_HEADING_MAX_RAD;
            if meets && road.lanes[ix].exits.len() < EXITS_MAX && road.lanes[to].entries.len() < EXITS_MAX {
                road.lanes[ix].exits.push(to);
                road.lanes[to].entries.push(ix);
            }
            if road.lanes[ix].exits.len() >= EXITS_MAX {
                break;
            }
        }
    }
}

/// Place and heading of the first and the last point.
fn first_and_last(centre: &[Vec2]) -> Option<(Vec2, f64, Vec2, f64)> {
    let count = centre.len();
    let (first, second) = (centre.first()?, centre.get(1)?);
    let (before, last) = (centre[count - 2], centre[count - 1]);
    Some((*first, (*second - *first).heading(), last, (last - before).heading()))
}

/// Adds neighbours of the same direction where one lane runs beside another at a third and at two thirds of its way.
pub fn link_side_by_side(road: &mut Road) {
    let graph = LaneGraph::of(road);
    // Two searches for each side, each in the cells around a place.
    let looked_at = (4 * 9 * road.lanes.len()).saturating_mul(graph.pieces().fullest_cell());
    if looked_at > SEARCH_MAX {
        return;
    }
    for ix in 0..road.lanes.len() {
        if road.lanes[ix].left_neighbours.is_empty() {
            road.lanes[ix].left_neighbours = beside(road, &graph, ix, true).into_iter().collect();
        }
        if road.lanes[ix].right_neighbours.is_empty() {
            road.lanes[ix].right_neighbours = beside(road, &graph, ix, false).into_iter().collect();
        }
    }
}

fn beside(road: &Road, graph: &LaneGraph, ix: LaneIx, left: bool) -> Option<Neighbour> {
    let lane = &road.lanes[ix];
    let border = Polyline::new(if left { lane.left.clone() } else { lane.right.clone() }).ok()?;
    let length = graph.length_m(ix);
    let at = |share: f64| {
        let pose = graph.pose_at(ix, length * share)?;
        // As far beyond the border as the border is from the centre: there lies the middle of a lane of equal width.
        let half = border.project(pose.position).offset_m.abs();
        let side = Vec2::from_heading(pose.heading_rad).left() * (2.0 * half * if left { 1.0 } else { -1.0 });
        graph.nearest_lane(pose.position + side, pose.heading_rad, half).map(|place| place.lane)
    };
    let lane_beside = at(1.0 / 3.0).filter(|found| at(2.0 / 3.0) == Some(*found))?;
    let follows = lane.exits.contains(&lane_beside) || lane.entries.contains(&lane_beside);
    (lane_beside != ix && !follows).then_some(Neighbour { lane: lane_beside, same_direction: true })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fixture::two_lane_scene;

    #[test]
    fn links_that_were_taken_away_are_found_again() {
        let whole = two_lane_scene().road;
        let mut road = whole.clone();
        for lane in &mut road.lanes {
            (lane.exits, lane.entries, lane.left_neighbours, lane.right_neighbours) = (vec![], vec![], vec![], vec![]);
        }
        // The branch leaves at 22 degrees in the fixture; a road that forks more gently is a fork.
        road.lanes[3].centre[1].y = 2.0;
        link_by_ends(&mut road);
        link_side_by_side(&mut road);
        for (found, known) in road.lanes.iter().zip(&whole.lanes) {
            assert_eq!((&found.exits, &found.entries), (&known.exits, &known.entries), "{}", known.id);
            assert_eq!(found.left_neighbours, known.left_neighbours, "{}", known.id);
            assert_eq!(found.right_neighbours, known.right_neighbours, "{}", known.id);
        }
    }
}
