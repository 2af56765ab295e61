//! Lanes and crosswalks as lanelets, then the signs and lights that they refer to.

use super::ids::Ids;
use super::point;
use crate::formats::export_error::Note;
use crate::formats::xml_write::Xml;
use crate::kernel::Vec2;
use crate::scene::{Lane, LaneIx, LaneKind, Light, LightState, Neighbour, Scene};

/// A boundary this near to an edge over its whole length is a curb, metres.
const CURB_M: f64 = 0.3;

pub(super) fn write(xml: &mut Xml, scene: &Scene, ids: &Ids, notes: &mut Vec<Note>) {
    let edges: Vec<Edge<'_>> = scene.road.edges.iter().map(|line| Edge::of(line)).collect();
    for ix in 0..scene.road.lanes.len() {
        lanelet(xml, scene, ids, ix, &edges);
    }
    for (polygon, id) in scene.crosswalks.iter().zip(&ids.crosswalks) {
        if let Some(id) = id {
            crosswalk(xml, polygon, *id);
        }
    }
    for &(limit, id) in &ids.limits {
        xml.within("trafficSign", &[("id", &id)], |xml| {
            xml.within("trafficSignElement", &[], |xml| {
                xml.leaf("trafficSignID", "274");
                xml.leaf("additionalValue", f64::from_bits(limit));
            });
            // Readers that look for the first lane with a sign find none where such lanes form a ring.
            let lane = scene.road.lanes.iter().find(|lane| lane.speed_limit_mps.map(f64::to_bits) == Some(limit));
            if let Some(lane) = lane {
                xml.within("position", &[], |xml| point(xml, "point", lane.right[0]));
            }
            xml.leaf("virtual", true);
        });
    }
    for (ix, (sign, id)) in scene.stop_signs.iter().zip(&ids.stop_signs).enumerate() {
        if sign.lanes.is_empty() {
            // The format knows no sign without a lanelet that refers to it.
            let reason = "a stop sign for no lane stands in <?evodrive?> alone";
            notes.push(Note::new(format!("stop_signs[{ix}]"), reason));
            continue;
        }
        xml.within("trafficSign", &[("id", id)], |xml| {
            xml.within("trafficSignElement", &[], |xml| xml.leaf("trafficSignID", "206"));
            xml.within("position", &[], |xml| point(xml, "point", sign.position));
        });
        if sign.lanes.len() > 1 {
            let reason = "a sign for several lanes is, lanelet by lanelet, a sign of each";
            notes.push(Note::new(format!("stop_signs[{ix}]"), reason));
        }
    }
    for (light, id) in scene.lights.iter().zip(&ids.lights) {
        traffic_light(xml, light, *id, scene.ego.start_step);
    }
    if scene.ego.start_step > 0 && !scene.lights.is_empty() {
        notes.push(Note::new("lights", "their states before the ego's start stand in <?evodrive?> alone"));
    }
}

fn lanelet(xml: &mut Xml, scene: &Scene, ids: &Ids, ix: LaneIx, edges: &[Edge<'_>]) {
    let lane = &scene.road.lanes[ix];
    let refer = |xml: &mut Xml, name: &'static str, to: u32| xml.empty(name, &[("ref", &to)]);
    xml.open("lanelet", &[("id", &ids.lanes[ix])]);
    for (name, line) in [("leftBound", &lane.left), ("rightBound", &lane.right)] {
        xml.within(name, &[], |xml| {
            line.iter().for_each(|p| point(xml, "point", *p));
            if edges.iter().any(|edge| edge.runs_along(line)) {
                xml.leaf("lineMarking", "curb");
            }
        });
    }
    lane.entries.iter().for_each(|&from| refer(xml, "predecessor", ids.lanes[from]));
    lane.exits.iter().for_each(|&to| refer(xml, "successor", ids.lanes[to]));
    for (name, side) in [("adjacentLeft", &lane.left_neighbours), ("adjacentRight", &lane.right_neighbours)] {
        // A lanelet has room for one on a side.
        if let Some(&Neighbour { lane: other, same_direction }) = side.first() {
            let direction = if same_direction { "same" } else { "opposite" };
            xml.empty(name, &[("ref", &ids.lanes[other]), ("drivingDir", &direction)]);
        }
    }
    let light = scene.lights.iter().find(|light| light.lane == ix).map(|light| light.stop_point);
    let sign = scene.stop_signs.iter().find(|sign| sign.lanes.contains(&ix)).map(|sign| sign.position);
    if let Some(place) = light.or(sign) {
        stop_line(xml, lane, place);
    }
    let outline = || lane.left.iter().chain(lane.right.iter().rev());
    let kind = match lane.kind {
        _ if scene.crosswalks.iter().any(|polygon| outline().eq(polygon)) => "crosswalk",
        LaneKind::Street => "urban",
        LaneKind::Freeway => "highway",
        LaneKind::Bike => "bicycleLane",
        LaneKind::Other => "shoulder",
    };
    xml.leaf("laneletType", kind);
    let limit = lane.speed_limit_mps.map(f64::to_bits);
    let limits = ids.limits.iter().filter(|(bits, _)| Some(*bits) == limit);
    limits.for_each(|(_, id)| refer(xml, "trafficSignRef", *id));
    let signs = scene.stop_signs.iter().zip(&ids.stop_signs).filter(|(sign, _)| sign.lanes.contains(&ix));
    signs.for_each(|(_, id)| refer(xml, "trafficSignRef", *id));
    let lights = scene.lights.iter().zip(&ids.lights).filter(|(light, _)| light.lane == ix);
    lights.for_each(|(_, id)| refer(xml, "trafficLightRef", *id));
    xml.close();
}

/// Across the lane: through the given place where that lies within it, else through the nearest point of the centre.
fn stop_line(xml: &mut Xml, lane: &Lane, place: Vec2) {
    let nearest = |k: &usize| lane.centre[*k].distance(place);
    let nearest = (0..lane.centre.len()).min_by(|a, b| nearest(a).total_cmp(&nearest(b))).unwrap_or(0);
    let across = (lane.left[nearest] - lane.right[nearest]) * 0.5;
    let along = lane.centre[(nearest + 1).min(lane.centre.len() - 1)] - lane.centre[nearest.saturating_sub(1)];
    let offset = place - lane.centre[nearest];
    let outside = along.norm() > 0.0 && (offset.cross(along) / along.norm()).abs() > across.norm();
    let middle = if outside { lane.centre[nearest] } else { place };
    xml.within("stopLine", &[], |xml| {
        point(xml, "point", middle + across);
        point(xml, "point", middle - across);
        xml.leaf("lineMarking", "solid");
    });
}

fn crosswalk(xml: &mut Xml, polygon: &[Vec2], id: u32) {
    let half = polygon.len().div_ceil(2);
    let (left, right) = polygon.split_at(half);
    // Both bounds need the same number of points; the last point of an odd outline counts twice.
    let right = right.iter().rev().chain(left.last()).take(half);
    xml.within("lanelet", &[("id", &id)], |xml| {
        xml.within("leftBound", &[], |xml| left.iter().for_each(|p| point(xml, "point", *p)));
        xml.within("rightBound", &[], |xml| right.for_each(|p| point(xml, "point", *p)));
        xml.leaf("laneletType", "crosswalk");
        xml.leaf("userBidirectional", "pedestrian");
    });
}

/// One cycle, as long as the light's known states. The format repeats it afterwards.
fn traffic_light(xml: &mut Xml, light: &Light, id: u32, start: usize) {
    let mut phases: Vec<(usize, LightState)> = Vec::new();
    for &state in light.states.iter().skip(start) {
        match phases.last_mut() {
            Some((steps, last)) if *last == state => *steps += 1,
            _ => phases.push((1, state)),
        }
    }
    xml.within("trafficLight", &[("id", &id)], |xml| {
        xml.within("cycle", &[], |xml| {
            for (steps, state) in &phases {
                xml.within("cycleElement", &[], |xml| {
                    xml.leaf("duration", steps);
                    xml.leaf("color", colour(*state));
                });
            }
        });
        xml.within("position", &[], |xml| point(xml, "point", light.stop_point));
        xml.leaf("active", true);
    });
}

fn colour(state: LightState) -> &'static str {
    match state {
        LightState::Unknown => "inactive",
        LightState::Stop => "red",
        LightState::Caution => "yellow",
        LightState::Go => "green",
    }
}

/// An edge with the box around it.
struct Edge<'s> {
    line: &'s [Vec2],
    low: Vec2,
    high: Vec2,
}

impl Edge<'_> {
    fn of(line: &[Vec2]) -> Edge<'_> {
        let low = line.iter().fold(line[0], |m, p| Vec2::new(m.x.min(p.x), m.y.min(p.y)));
        let high = line.iter().fold(line[0], |m, p| Vec2::new(m.x.max(p.x), m.y.max(p.y)));
        Edge { line, low, high }
    }

    fn runs_along(&self, bound: &[Vec2]) -> bool {
        bound.iter().all(|p| self.is_near(*p))
    }

    fn is_near(&self, p: Vec2) -> bool {
        let reach = CURB_M;
        let within = p.x >= self.low.x - reach && p.x <= self.high.x + reach;
        within
            && p.y >= self.low.y - reach
            && p.y <= self.high.y + reach
            && self.line.windows(2).any(|w| distance_to_segment(p, w[0], w[1]) <= reach)
    }
}

fn distance_to_segment(p: Vec2, a: Vec2, b: Vec2) -> f64 {
    let along = b - a;
    let length = along.norm_squared();
    let share = if length > 0.0 { ((p - a).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
    p.distance(a + along * share)
}
