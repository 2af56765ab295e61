//! The map of a log as a road in the local frame: lanes with their links, edges, signs. Points, lanes and links that cannot be
//! used are left out by name.

use std::collections::BTreeMap;

use super::centreline::{Across, lines, thinned, thinned_line};
use super::import_error::shown;
use super::log::{Log, Parts};
use super::topology::{link_by_ends, link_side_by_side};
use crate::kernel::Vec2;
use crate::scene::validate::{COORDINATE_MAX_M, LINKS_MAX};
use crate::scene::{Lane, LaneIx, Neighbour, Road, StopSign};

/// Reason for leaving out single points of the map.
const POINTS_LEFT_OUT: &str = "not finite, or farther than 100 km; the other points are kept";

fn shifted(line: &[Vec2], origin: Vec2) -> Vec<Vec2> {
    line.iter().map(|p| *p - origin).collect()
}

/// Index in the road of each lane of a log, by the lane's id.
pub(super) type Index = BTreeMap<String, LaneIx>;

/// Returns the road, and the index in it of each lane of the log.
pub(super) fn road(log: &Log, origin: Vec2, left_out: &mut Parts) -> (Road, Index) {
    let mut road = Road::default();
    let mut index = Index::new();
    let mut links = Vec::new();
    for lane in &log.lanes {
        let name = || format!("lane {}", shown(&lane.id));
        let points: Vec<Across> = lane.points.iter().copied().filter(|p| on_the_map(p.centre - origin)).collect();
        if points.len() < lane.points.len() {
            let bad = lane.points.len() - points.len();
            left_out.push((format!("{bad} points of {}", name()), POINTS_LEFT_OUT.into()));
        }
        let thin = thinned(&points);
        if thin.len() < 2 {
            let reason = format!("its centre line needs 2 points that differ, found {}", points.len());
            left_out.push((name(), reason));
            continue;
        }
        if index.contains_key(&lane.id) {
            left_out.push((name(), "its id is already taken; the first lane of that id is kept".into()));
            continue;
        }
        let (centre, left, right) = lines(&thin);
        index.insert(lane.id.clone(), road.lanes.len());
        links.push(lane);
        road.lanes.push(Lane {
            id: lane.id.clone(),
            kind: lane.kind,
            centre: shifted(&centre, origin),
            left: shifted(&left, origin),
            right: shifted(&right, origin),
            entries: vec![],
            exits: vec![],
            left_neighbours: vec![],
            right_neighbours: vec![],
            speed_limit_mps: lane.speed_limit_mps.filter(|v| *v > 0.0),
        });
    }
    let known = |id: &String| index.get(id).copied();
    for (ix, lane) in links.iter().enumerate() {
        let out = lane.exits.iter().filter_map(known).map(|to| (ix, to));
        let into = lane.entries.iter().filter_map(known).map(|from| (from, ix));
        for (from, to) in out.chain(into).filter(|(from, to)| from != to) {
            let room = road.lanes[from].exits.len() < LINKS_MAX && road.lanes[to].entries.len() < LINKS_MAX;
            if room && !road.lanes[from].exits.contains(&to) {
                road.lanes[from].exits.push(to);
                road.lanes[to].entries.push(from);
            }
        }
        road.lanes[ix].left_neighbours = beside(&lane.left, ix, &index);
        road.lanes[ix].right_neighbours = beside(&lane.right, ix, &index);
        if [&lane.exits, &lane.entries, &lane.left, &lane.right].iter().any(|ids| ids.contains(&lane.id)) {
            left_out.push((
                format!("link of lane {}", shown(&lane.id)),
                "it leads to its own lane; the lane is kept".into(),
            ));
        }
    }
    if road.lanes.iter().all(|lane| lane.exits.is_empty()) {
        link_by_ends(&mut road);
    }
    if road.lanes.iter().all(|lane| lane.left_neighbours.is_empty() && lane.right_neighbours.is_empty()) {
        link_side_by_side(&mut road);
    }
    let edges = outlines("edge", &log.edges, origin, left_out);
    road.edges = edges.iter().map(|edge| thinned_line(edge)).filter(|e| e.len() >= 2).collect();
    (road, index)
}

/// Returns the lanes of a side that the map holds, each once.
fn beside(ids: &[String], own: LaneIx, index: &Index) -> Vec<Neighbour> {
    let mut side: Vec<Neighbour> = Vec::new();
    for &lane in ids.iter().filter_map(|id| index.get(id)) {
        if lane != own && side.iter().all(|n| n.lane != lane) {
            side.push(Neighbour { lane, same_direction: true });
        }
    }
    side
}

/// Returns lines in the local frame without the points that are no places.
pub(super) fn outlines(what: &str, lines: &[Vec<Vec2>], origin: Vec2, left_out: &mut Parts) -> Vec<Vec<Vec2>> {
    let mut bad = 0;
    let line = |line: &Vec<Vec2>| -> Vec<Vec2> {
        let line = shifted(line, origin);
        let kept: Vec<Vec2> = line.iter().copied().filter(|point| on_the_map(*point)).collect();
        bad += line.len() - kept.len();
        kept
    };
    let lines: Vec<Vec<Vec2>> = lines.iter().map(line).collect();
    if bad > 0 {
        left_out.push((format!("{bad} points of {what}s"), POINTS_LEFT_OUT.into()));
    }
    lines
}

/// Returns `true` if a scene may hold a point.
pub(super) fn on_the_map(point: Vec2) -> bool {
    point.is_finite() && point.x.abs() <= COORDINATE_MAX_M && point.y.abs() <= COORDINATE_MAX_M
}

/// Returns the stop signs that have a place.
pub(super) fn stop_signs(
    given: &[(Vec2, Vec<String>)],
    index: &Index,
    origin: Vec2,
    left_out: &mut Parts,
) -> Vec<StopSign> {
    let mut signs = Vec::with_capacity(given.len());
    for (position, ids) in given {
        if !on_the_map(*position - origin) {
            let reason = "its place is not finite, or farther than 100 km; the other signs are kept";
            left_out.push((format!("stop sign of lanes {}", shown(&ids.join(", "))), reason.into()));
            continue;
        }
        let lanes = ids.iter().filter_map(|id| index.get(id).copied()).collect();
        signs.push(StopSign { position: *position - origin, lanes });
    }
    signs
}
