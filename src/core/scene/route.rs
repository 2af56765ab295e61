//! A route for an ego that has no logged path: the shortest way through the lane graph, with lane changes, as one
//! smooth line from the ego's place.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::LaneIx;
use super::lanes::{LaneGraph, LanePlace};
use super::validate::WAY_MAX_M;
use crate::kernel::{Polyline, Vec2, num};

/// Cost of a lane change in the search, metres of way. A lane is changed only where that saves more.
const LANE_CHANGE_COST_M: f64 = 20.0;
/// Distance between points of a route, metres.
const SPACING_M: f64 = 1.0;
/// No line becomes longer than this, metres. It is far beyond the limit of a scene's route, so a longer line would be
/// refused anyway.
const LINE_MAX_M: f64 = 2.0 * WAY_MAX_M;
/// Most lanes that a search visits before it gives up.
const LANES_MAX: usize = 20_000;

/// A place through which a route must lead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoalPlace {
    /// Which lane.
    pub lane: LaneIx,
    /// Arc length on that lane, metres; 0 asks only for the lane.
    pub s_m: f64,
}

/// A way through the lanes: each leg from its entry to where the next begins.
#[derive(Clone, Debug, PartialEq)]
struct Leg {
    lane: LaneIx,
    from_m: f64,
    to_m: f64,
    /// True if the next leg is a neighbour lane rather than an exit.
    changes_lane: bool,
}

/// The line from `position` (which lies at `start` in its lane) to the nearest of `goals`, then straight on until it is
/// `length_m` long or the lanes end, twice [`WAY_MAX_M`] at most. Without goals it follows the lane. Over the length
/// `transition_m` it moves from the ego's lateral offset to the centre line. `None` if no way leads to a goal.
pub fn plan(
    graph: &LaneGraph,
    position: Vec2,
    start: LanePlace,
    goals: &[GoalPlace],
    length_m: f64,
    transition_m: f64,
) -> Option<Vec<Vec2>> {
    let mut legs = if goals.is_empty() {
        vec![Leg { lane: start.lane, from_m: start.s_m, to_m: start.s_m, changes_lane: false }]
    } else {
        search(graph, start, goals, transition_m)?
    };
    cut(&mut legs);
    extend(graph, &mut legs, length_m.min(LINE_MAX_M));
    let line = drawn(graph, position, &legs, transition_m);
    let line = Polyline::new(line).ok()?;
    // Lanes that follow each other need not meet: the gaps between them are no part of the legs.
    let points = if line.length_m() <= LINE_MAX_M { line.resampled(SPACING_M) } else { line };
    Some(Vec::from(points))
}

#[derive(Clone, Copy)]
struct Visit {
    lane: LaneIx,
    entry_m: f64,
    cost_m: f64,
    /// Index of the visit before, and whether a lane change led here.
    from: Option<(usize, bool)>,
}

fn search(graph: &LaneGraph, start: LanePlace, goals: &[GoalPlace], transition_m: f64) -> Option<Vec<Leg>> {
    let mut visits = vec![Visit { lane: start.lane, entry_m: start.s_m, cost_m: 0.0, from: None }];
    let mut done = vec![false; graph.lane_count()];
    // Costs are never negative, so their bit patterns sort in the same order.
    let mut open = BinaryHeap::from([Reverse((0u64, 0usize))]);
    let mut best: Option<(f64, usize, f64)> = None;
    while let Some(Reverse((_, index))) = open.pop() {
        let visit = visits[index];
        if best.is_some_and(|(cost, _, _)| cost <= visit.cost_m) || visits.len() > LANES_MAX {
            break;
        }
        if std::mem::replace(&mut done[visit.lane], true) {
            continue;
        }
        for goal in goals.iter().filter(|g| g.lane == visit.lane && (g.s_m <= 0.0 || g.s_m >= visit.entry_m)) {
            let to_m = goal.s_m.max(visit.entry_m);
            let cost = visit.cost_m + to_m - visit.entry_m;
            if best.is_none_or(|(least, _, _)| cost < least) {
                best = Some((cost, index, to_m));
            }
        }
        let left = (graph.length_m(visit.lane) - visit.entry_m).max(0.0);
        let mut push = |lane: LaneIx, entry_m: f64, way_m: f64, change: bool| {
            let cost_m = visit.cost_m + way_m;
            visits.push(Visit { lane, entry_m, cost_m, from: Some((index, change)) });
            open.push(Reverse((cost_m.to_bits(), visits.len() - 1)));
        };
        for &exit in graph.exits(visit.lane) {
            push(exit, 0.0, left, false);
        }
        let way = transition_m.min(left);
        let after = graph.centre(visit.lane).map(|line| line.at(visit.entry_m + way));
        for (beside, point) in
            after.iter().flat_map(|point| graph.beside_at(visit.lane, *point).map(|lane| (lane, *point)))
        {
            let there = graph.place_in(beside, point);
            if let Some(place) = there.filter(|_| graph.is_through(beside)) {
                push(beside, place.s_m, way + LANE_CHANGE_COST_M, true);
            }
        }
    }
    let (_, mut index, mut to_m) = best?;
    let mut legs = Vec::new();
    let mut changes_lane = false;
    loop {
        let visit = visits[index];
        legs.push(Leg { lane: visit.lane, from_m: visit.entry_m, to_m, changes_lane });
        let Some((before, change)) = visit.from else { break };
        changes_lane = change;
        let previous = visits[before];
        let end = graph.length_m(previous.lane);
        to_m = if change { (previous.entry_m + transition_m).min(end) } else { end };
        index = before;
    }
    legs.reverse();
    Some(legs)
}

/// Cuts the legs at the greatest length of a line.
fn cut(legs: &mut Vec<Leg>) {
    let mut left = LINE_MAX_M;
    let whole = legs.iter().position(|leg| {
        left -= (leg.to_m - leg.from_m).max(0.0);
        left < 0.0
    });
    if let Some(last) = whole {
        legs.truncate(last + 1);
        legs[last].to_m += left;
        legs[last].changes_lane = false;
    }
}

/// Follows the lanes until the legs are `length_m` long. At a fork it takes the straightest lane.
fn extend(graph: &LaneGraph, legs: &mut Vec<Leg>, length_m: f64) {
    let mut left = length_m - num::sum(legs.iter().map(|leg| (leg.to_m - leg.from_m).max(0.0)));
    while left > 1e-6 && legs.len() < LANES_MAX {
        let Some(last) = legs.last_mut() else { return };
        let room = (graph.length_m(last.lane) - last.to_m).max(0.0);
        let more = room.min(left);
        last.to_m += more;
        left -= more;
        if left <= 1e-6 {
            return;
        }
        let lane = last.lane;
        let Some(next) = straightest(graph, lane) else { return };
        legs.push(Leg { lane: next, from_m: 0.0, to_m: 0.0, changes_lane: false });
    }
}

fn straightest(graph: &LaneGraph, lane: LaneIx) -> Option<LaneIx> {
    let heading = |lane: LaneIx, s: f64| graph.pose_at(lane, s).map(|pose| pose.heading_rad);
    let end = heading(lane, graph.length_m(lane))?;
    let turn = |&exit: &LaneIx| {
        let far = heading(exit, graph.length_m(exit)).unwrap_or(end);
        num::wrap_angle(far - end).abs()
    };
    graph.exits(lane).iter().copied().filter(|&e| graph.length_m(e) > 0.0).min_by(|a, b| {
        let lower = graph.is_through(*b).cmp(&graph.is_through(*a));
        lower.then(turn(a).total_cmp(&turn(b))).then(a.cmp(b))
    })
}

fn drawn(graph: &LaneGraph, position: Vec2, legs: &[Leg], transition_m: f64) -> Vec<Vec2> {
    let mut points = Vec::new();
    for (index, leg) in legs.iter().enumerate() {
        let Some(centre) = graph.centre(leg.lane) else { continue };
        let length = (leg.to_m - leg.from_m).max(0.0);
        let pieces = (length / SPACING_M).ceil() as usize;
        let target = legs.get(index + 1).filter(|_| leg.changes_lane).and_then(|next| graph.centre(next.lane));
        for k in 0..=pieces {
            let along = if pieces == 0 { 0.0 } else { length * k as f64 / pieces as f64 };
            let own = centre.at(leg.from_m + along);
            points.push(match target {
                Some(line) => own.lerp(line.at(line.project(own).s_m), smooth(along / length.max(1e-9))),
                None => own,
            });
        }
    }
    if let Some(&first) = points.first() {
        let offset = position - first;
        for point in &mut points {
            let share = 1.0 - smooth(point.distance(first) / transition_m.max(1e-9));
            *point = *point + offset * share;
        }
    }
    points
}

/// Rises smoothly from 0 at 0 to 1 at 1, with slope 0 at both ends.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fixture::two_lane_scene;

    fn planned(from: Vec2, goals: &[GoalPlace], length_m: f64) -> Option<Polyline> {
        let graph = LaneGraph::of(&two_lane_scene().road);
        let start = graph.nearest_lane(from, 0.0, 5.0)?;
        plan(&graph, from, start, goals, length_m, 30.0).and_then(|points| Polyline::new(points).ok())
    }

    #[test]
    fn without_a_goal_the_route_follows_the_straightest_lane_for_its_length() {
        let route = planned(Vec2::new(20.0, 0.5), &[], 100.0).unwrap();
        assert_eq!(route.points()[0], Vec2::new(20.0, 0.5));
        assert!((route.length_m() - 100.0).abs() < 0.1);
        assert!(route.project(Vec2::new(115.0, 0.0)).offset_m.abs() < 1e-9, "straight on into lane c");
    }

    #[test]
    fn a_goal_in_a_branch_beside_takes_a_lane_change_and_the_turn() {
        let route = planned(Vec2::new(20.0, 3.5), &[GoalPlace { lane: 3, s_m: 40.0 }], 0.0).unwrap();
        let end = route.points()[route.points().len() - 1];
        assert!(end.distance(Vec2::new(114.0, 32.0)) < 2.0, "{end:?}");
        let steepest = route.points().windows(2).map(|w| (w[1] - w[0]).heading()).take(70);
        assert!(steepest.fold(0.0, |m: f64, h| m.max(h.abs())) < 0.2, "no jump sideways");
        assert!(route.project(Vec2::new(60.0, 0.0)).offset_m.abs() < 0.05, "the change is over after 30 m");
    }

    #[test]
    fn a_ring_is_not_followed_for_ever() {
        let mut road = two_lane_scene().road;
        road.lanes.truncate(1);
        (road.lanes[0].exits, road.lanes[0].entries) = (vec![0], vec![0]);
        let graph = LaneGraph::of(&road);
        let start = LanePlace { lane: 0, s_m: 0.0, offset_m: 0.0, heading_rad: 0.0, distance_m: 0.0 };
        for length_m in [1e9, f64::INFINITY] {
            let mut legs = vec![Leg { lane: 0, from_m: 0.0, to_m: start.s_m, changes_lane: false }];
            extend(&graph, &mut legs, LINE_MAX_M.min(length_m));
            let followed_m: f64 = legs.iter().map(|leg| leg.to_m - leg.from_m).sum();
            assert!((followed_m - LINE_MAX_M).abs() < 1e-3, "{followed_m}");
            // Each lap jumps back from the lane's end to its start, and the jumps are not filled with points.
            let line = plan(&graph, Vec2::ZERO, start, &[], length_m, 30.0).unwrap();
            assert!(line.len() <= LINE_MAX_M as usize + 2 * legs.len(), "{}", line.len());
            assert!(line.windows(2).any(|w| w[0].distance(w[1]) > 10.0 * SPACING_M));
        }
    }

    #[test]
    fn a_way_to_a_goal_beyond_all_measure_is_cut_before_it_is_drawn() {
        let leg = |to_m| Leg { lane: 0, from_m: 0.0, to_m, changes_lane: true };
        let mut legs = vec![leg(LINE_MAX_M - 10.0), leg(1e9), leg(5.0)];
        cut(&mut legs);
        assert_eq!(legs, [leg(LINE_MAX_M - 10.0), Leg { changes_lane: false, ..leg(10.0) }]);
        let mut sound = vec![leg(WAY_MAX_M), leg(3.0)];
        cut(&mut sound);
        assert_eq!(sound, [leg(WAY_MAX_M), leg(3.0)]);
    }

    #[test]
    fn where_no_way_leads_there_is_no_route() {
        assert_eq!(planned(Vec2::new(120.0, 0.0), &[GoalPlace { lane: 3, s_m: 10.0 }], 0.0), None);
    }
}
