//! Finds the ego's way over lanes from two to four sparse waypoints. Among all lanes near each waypoint it takes those
//! with the shortest connection, so that a waypoint in a junction does not select a lane that leads elsewhere.

use crate::kernel::{Pose, Vec2};
use crate::scene::{LaneGraph, LaneIx, LanePlace, Reached};

/// A waypoint lies on a lane whose centre line is at most this far, metres.
const LANE_WITHIN_M: f64 = 2.5;
/// Waypoints closer together than this are merged, metres.
const SAME_M: f64 = 0.5;
/// A way between two waypoints is at most this much longer than twice the distance, metres.
const DETOUR_M: f64 = 60.0;
/// A metre beside a waypoint costs as much as this many metres of way.
const ASIDE_COST: f64 = 10.0;
/// A lane change costs as much as this many metres of way, and takes this many, metres.
const CHANGE_COST_M: f64 = 50.0;
const CHANGE_M: f64 = 12.0;
/// Points of a way closer together than this are merged, metres.
const SPACING_M: f64 = 0.2;

/// A lane at a waypoint with the cheapest way to it: its cost, the lane before it, the lanes in between.
struct Candidate {
    place: LanePlace,
    cost: f64,
    from: usize,
    chain: Vec<LaneIx>,
}

/// The way along `waypoints`, or which of them cannot be reached.
pub(super) fn along(graph: &LaneGraph, waypoints: &[Pose]) -> Result<Vec<Vec2>, String> {
    let mut kept: Vec<Pose> = Vec::new();
    for waypoint in waypoints {
        if kept.last().is_none_or(|last| last.position.distance(waypoint.position) > SAME_M) {
            kept.push(*waypoint);
        }
    }
    if kept.len() < 2 {
        return Err("its waypoints lie in one place".into());
    }
    let mut layers: Vec<Vec<Candidate>> = Vec::new();
    for (k, waypoint) in kept.iter().enumerate() {
        let places = graph.lanes_near(waypoint.position, waypoint.heading_rad, LANE_WITHIN_M);
        let layer = match layers.last() {
            None => places.into_iter().map(first).collect(),
            Some(before) => {
                let budget_m = 2.0 * kept[k - 1].position.distance(waypoint.position) + DETOUR_M;
                next(graph, before, &places, budget_m)
            }
        };
        if layer.is_empty() {
            let Vec2 { x, y } = waypoint.position;
            let what = if k == 0 { "no lane of its direction lies at" } else { "no way over lanes leads to" };
            return Err(format!("{what} waypoint {k} (x = {x:.1}, y = {:.1} in CARLA's frame)", -y));
        }
        layers.push(layer);
    }
    Ok(points(graph, &layers))
}

fn first(place: LanePlace) -> Candidate {
    Candidate { cost: ASIDE_COST * place.distance_m, place, from: 0, chain: vec![] }
}

/// The candidates at a waypoint that can be reached from those before.
fn next(graph: &LaneGraph, before: &[Candidate], places: &[LanePlace], budget_m: f64) -> Vec<Candidate> {
    let mut candidates: Vec<Option<Candidate>> = places.iter().map(|_| None).collect();
    for (from, start) in before.iter().enumerate() {
        let reached = graph.reachable(start.place.lane, start.place.s_m, budget_m);
        for (place, best) in places.iter().zip(&mut candidates) {
            let Some(there) = reached.iter().find(|r| r.lane == place.lane) else { continue };
            let way_m = there.start_m + place.s_m;
            if way_m <= 0.0 || way_m > budget_m {
                continue;
            }
            let cost = start.cost + way_m + CHANGE_COST_M * there.lane_changes as f64 + ASIDE_COST * place.distance_m;
            if best.as_ref().is_none_or(|b| cost < b.cost) {
                *best = Some(Candidate { place: *place, cost, from, chain: chain(&reached, there) });
            }
        }
    }
    candidates.into_iter().flatten().collect()
}

/// The lanes from the start of a search to a reached one.
fn chain(reached: &[Reached], last: &Reached) -> Vec<LaneIx> {
    let mut lanes = vec![last.lane];
    let mut at = last;
    while let Some(via) = at.via
        && let Some(before) = reached.iter().find(|r| r.lane == via)
        && lanes.len() <= reached.len()
    {
        lanes.push(via);
        at = before;
    }
    lanes.reverse();
    lanes
}

fn points(graph: &LaneGraph, layers: &[Vec<Candidate>]) -> Vec<Vec2> {
    let last = layers.len() - 1;
    let cheapest = (0..layers[last].len()).min_by(|&a, &b| layers[last][a].cost.total_cmp(&layers[last][b].cost));
    let mut picks = vec![cheapest.unwrap_or(0)];
    for layer in layers.iter().skip(1).rev() {
        picks.push(layer[picks[picks.len() - 1]].from);
    }
    picks.reverse();
    let mut line = Line { graph, points: vec![] };
    for k in 1..layers.len() {
        let (from, to) = (&layers[k - 1][picks[k - 1]], &layers[k][picks[k]]);
        line.stretch(&to.chain, from.place.s_m, to.place.s_m);
    }
    line.points
}

struct Line<'g> {
    graph: &'g LaneGraph,
    points: Vec<Vec2>,
}

impl Line<'_> {
    fn push(&mut self, point: Vec2) {
        if self.points.last().is_none_or(|last| last.distance(point) > SPACING_M) {
            self.points.push(point);
        }
    }

    /// Over a chain of lanes from a place on the first to a place on the last.
    fn stretch(&mut self, chain: &[LaneIx], from_s_m: f64, to_s_m: f64) {
        let mut start_m = from_s_m;
        for (k, &lane) in chain.iter().enumerate() {
            let Some(centre) = self.graph.centre(lane) else { continue };
            let onward = chain.get(k + 1).copied();
            let end_m = match onward {
                None => to_s_m,
                Some(next) if self.graph.exits(lane).contains(&next) => centre.length_m(),
                // A lane change begins at once.
                Some(_) => start_m,
            };
            self.push(centre.at(start_m));
            for (&s_m, &point) in centre.lengths().iter().zip(centre.points()) {
                if s_m > start_m && s_m < end_m {
                    self.push(point);
                }
            }
            self.push(centre.at(end_m));
            start_m = match onward {
                Some(next) if !self.graph.exits(lane).contains(&next) => {
                    self.graph.place_in(next, centre.at(end_m)).map_or(0.0, |place| place.s_m + CHANGE_M)
                }
                _ => 0.0,
            };
        }
    }
}
