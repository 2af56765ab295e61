//! Lanelets with their topology, the signs and lights at them, stop lines and crosswalks.

use std::collections::BTreeMap;

use super::signs::{Cycle, Sign, cycles, signs, speed};
use super::{File, named, point, shifted};
use crate::formats::import_error::{ImportError, shown};
use crate::formats::imported::Imported;
use crate::formats::xml_read::Element;
use crate::kernel::Vec2;
use crate::scene::validate::LINKS_MAX;
use crate::scene::{DT_S, Lane, LaneGraph, LaneIx, LaneKind, Light, LightState, Neighbour, Road, StopSign};

/// Words on the rest that is kept where a part of a lanelet is left out.
const LANELET_KEPT: &str = "the lanelet is kept without it";
/// Most references from lanelets to lights in a file.
const LIGHT_REFS_MAX: usize = 20_000;

/// The road in the file's coordinates.
pub(super) struct Network {
    road: Road,
    pub graph: LaneGraph,
    pub index: BTreeMap<String, LaneIx>,
    pub crosswalks: Vec<Vec<Vec2>>,
    lights: Vec<LaneLights>,
    light_refs: usize,
    stop_signs: Vec<StopSign>,
}

/// All lights that a lanelet refers to.
struct LaneLights {
    lane: LaneIx,
    stop_point: Vec2,
    cycles: Vec<Cycle>,
}

/// Returns the lanelets that can be read, with the signs and lights at them. Unreadable parts are left out in `imported`.
///
/// # Errors No lanelet can be read.
pub(super) fn read(file: &File<'_>, imported: &mut Imported) -> Result<Network, ImportError> {
    if file.root.child("lanelet").is_none() {
        return Err(file.root.refuse("at least one <lanelet>"));
    }
    let signs = signs(file, imported);
    let cycles = cycles(file, imported);
    let mut road = Road::default();
    let (mut index, mut elements) = (BTreeMap::new(), Vec::new());
    for element in file.root.named("lanelet") {
        let what = named(&element);
        let taken = |id: &String| index.contains_key(id).then(|| element.refuse("an id that no lanelet before it has"));
        let lane = lane(file, &element, &what, &signs, imported).and_then(|lane| taken(&lane.id).map_or(Ok(lane), Err));
        if let Some(lane) = imported.read(&what, lane, "the other lanelets are kept") {
            index.insert(lane.id.clone(), road.lanes.len());
            road.lanes.push(lane);
            elements.push(element);
        }
    }
    if elements.is_empty() {
        let first = imported.left_out.iter().find(|left| left.what.starts_with("lanelet"));
        let why = first.map_or(String::new(), |left| format!(" (the first: {})", left.reason));
        return Err(file.root.refuse(format!("at least one <lanelet> that can be read{why}")));
    }
    for (ix, element) in elements.iter().enumerate() {
        for child in element.children() {
            if let Err(error) = link(&mut road, ix, &child, &index) {
                let what = format!("{} of {}", child.name(), named(element));
                imported.leave_out_for(what, &error, "the lanelet is kept without this link");
            }
        }
    }
    let mut network = Network {
        graph: LaneGraph::of(&road),
        crosswalks: vec![],
        lights: vec![],
        light_refs: 0,
        stop_signs: vec![],
        road,
        index,
    };
    for (ix, element) in elements.iter().enumerate() {
        network.furnish(ix, element, &signs, &cycles, imported)?;
    }
    Ok(network)
}

fn lane(
    file: &File<'_>,
    element: &Element<'_>,
    what: &str,
    signs: &BTreeMap<&str, Sign>,
    imported: &mut Imported,
) -> Result<Lane, ImportError> {
    let id = element.needed_attribute("id")?.to_string();
    let bound = |name: &str| -> Result<(Element<'_>, Vec<Result<Vec2, ImportError>>), ImportError> {
        let bound = element.needed_child(name)?;
        Ok((bound, bound.named("point").map(|p| file.near_point(&p)).collect()))
    };
    let ((left_bound, left), (_, right)) = (bound("leftBound")?, bound("rightBound")?);
    if left.len() != right.len() {
        let counts = format!("as many left as right points, found {} and {}", left.len(), right.len());
        return Err(element.refuse(counts));
    }
    // If a point cannot be read, the one across from it is left out, too, so that the bounds stay beside each other.
    let (mut pairs, mut lost, mut first) = (Vec::with_capacity(left.len()), 0, None);
    for pair in left.into_iter().zip(right) {
        match pair {
            (Ok(left), Ok(right)) => pairs.push((left, right)),
            (Err(error), _) | (_, Err(error)) => {
                lost += 1;
                first = first.or(Some(error));
            }
        }
    }
    if pairs.len() < 2 {
        return Err(first.unwrap_or_else(|| left_bound.refuse(format!("at least 2 points, found {}", pairs.len()))));
    }
    if let Some(error) = first {
        imported.leave_out_for(format!("{lost} points of {what}"), &error, "its other points are kept");
    }
    let (left, right): (Vec<Vec2>, Vec<Vec2>) = pairs.into_iter().unzip();
    let own = element.child("speedLimit").map(|limit| speed(&limit)).transpose();
    let mut speed_limit_mps = imported.read(&format!("speedLimit of {what}"), own, LANELET_KEPT).flatten();
    for sign in refs(element, "trafficSignRef", signs, what, imported) {
        speed_limit_mps = sign.speed_limit_mps.or(speed_limit_mps);
    }
    let centre: Vec<Vec2> = left.iter().zip(&right).map(|(l, r)| l.lerp(*r, 0.5)).collect();
    if centre.iter().all(|point| point.distance(centre[0]) <= 1e-6) {
        return Err(element.refuse("a centre line of some length"));
    }
    Ok(Lane {
        id,
        kind: kind(element),
        centre,
        left,
        right,
        entries: vec![],
        exits: vec![],
        left_neighbours: vec![],
        right_neighbours: vec![],
        speed_limit_mps,
    })
}

fn kind(element: &Element<'_>) -> LaneKind {
    let types: Vec<&str> = element.named("laneletType").map(|e| e.text()).collect();
    let is = |names: &[&str]| types.iter().any(|t| names.contains(t));
    if is(&["crosswalk", "sidewalk", "shoulder", "border", "parking", "restricted", "restricted_area"]) {
        LaneKind::Other
    } else if is(&["bicycleLane"]) {
        LaneKind::Bike
    } else if is(&["highway", "interstate", "mainCarriageWay", "accessRamp", "exitRamp"]) {
        LaneKind::Freeway
    } else {
        LaneKind::Street
    }
}

/// Returns the targets of all `<name ref="..."/>` of an element. References to nothing are left out by name.
fn refs<'m, T>(
    element: &Element<'_>,
    name: &str,
    known: &'m BTreeMap<&str, T>,
    what: &str,
    imported: &mut Imported,
) -> Vec<&'m T> {
    let mut targets = Vec::new();
    for reference in element.children().filter(|child| child.name() == name) {
        let target = reference.needed_attribute("ref").and_then(|id| {
            let expected = || format!("a reference to something that can be read, found {:?}", shown(id));
            known.get(id).ok_or_else(|| reference.refuse(expected()))
        });
        targets.extend(imported.read(&format!("{name} of {what}"), target, LANELET_KEPT));
    }
    targets
}

/// Adds the link that a child of a lanelet gives, if it is one.
fn link(road: &mut Road, ix: LaneIx, child: &Element<'_>, index: &BTreeMap<String, LaneIx>) -> Result<(), ImportError> {
    let name = child.name();
    if !matches!(name, "predecessor" | "successor" | "adjacentLeft" | "adjacentRight") {
        return Ok(());
    }
    let id = child.needed_attribute("ref")?;
    let there = index.get(id).copied();
    let other =
        there.ok_or_else(|| child.refuse(format!("the id of a lanelet that can be read, found {:?}", shown(id))))?;
    if other == ix {
        return Err(child.refuse("another lanelet than itself"));
    }
    // It is enough that one of the two names the other; the missing half of a link is added.
    let (from, to) = if name == "predecessor" { (other, ix) } else { (ix, other) };
    match name {
        "predecessor" | "successor" => {
            if road.lanes[from].exits.contains(&to) {
                return Ok(());
            }
            if road.lanes[from].exits.len() >= LINKS_MAX || road.lanes[to].entries.len() >= LINKS_MAX {
                return Err(child.refuse(format!("at most {LINKS_MAX} links of one kind at a lanelet")));
            }
            road.lanes[from].exits.push(to);
            road.lanes[to].entries.push(from);
        }
        _ => {
            let same_direction = match child.needed_attribute("drivingDir")? {
                "same" => true,
                "opposite" => false,
                other => return Err(child.refuse(format!("drivingDir same or opposite, found {:?}", shown(other)))),
            };
            let lane = &mut road.lanes[ix];
            let left = name == "adjacentLeft";
            let side = if left { &mut lane.left_neighbours } else { &mut lane.right_neighbours };
            *side = vec![Neighbour { lane: other, same_direction }];
        }
    }
    Ok(())
}

impl Network {
    fn furnish(
        &mut self,
        ix: LaneIx,
        element: &Element<'_>,
        signs: &BTreeMap<&str, Sign>,
        cycles: &BTreeMap<&str, Cycle>,
        imported: &mut Imported,
    ) -> Result<(), ImportError> {
        let what = named(element);
        let line = element.child("stopLine");
        let lane = &self.road.lanes[ix];
        let end = lane.centre[lane.centre.len() - 1];
        let ends: Result<Vec<Vec2>, ImportError> =
            line.iter().flat_map(|line| line.named("point")).map(|p| point(&p)).collect();
        let ends = imported.read(&format!("stopLine of {what}"), ends, "it is taken to lie at the lanelet's end");
        let ends = ends.unwrap_or_default();
        // A stop line without points lies at the end of its lanelet.
        let stop_point = if ends.len() == 2 { ends[0].lerp(ends[1], 0.5) } else { end };
        let both = || std::iter::once(*element).chain(line);
        let mut lights: BTreeMap<&str, Cycle> = BTreeMap::new();
        for place in both() {
            refs(&place, "trafficLightRef", cycles, &what, imported);
            for id in place.named("trafficLightRef").filter_map(|reference| reference.attribute("ref")) {
                lights.extend(cycles.get(id).map(|cycle| (id, cycle.clone())));
            }
            // The targets of a lanelet's own references are noted where its limit is read.
            let mut named_before = Imported::default();
            let is_own = place.name() == "lanelet";
            let signs = refs(&place, "trafficSignRef", signs, &what, if is_own { &mut named_before } else { imported });
            if signs.iter().any(|sign| sign.is_stop) {
                let position = signs.iter().find_map(|sign| sign.position);
                let position = if line.is_some() { stop_point } else { position.unwrap_or(end) };
                self.stop_signs.push(StopSign { position, lanes: vec![ix] });
            }
        }
        if self.light_count() + lights.len() > LIGHT_REFS_MAX {
            return Err(element.refuse(format!("at most {LIGHT_REFS_MAX} references to lights")));
        }
        if !lights.is_empty() {
            self.light_refs += lights.len();
            self.lights.push(LaneLights { lane: ix, stop_point, cycles: lights.into_values().collect() });
        }
        if element.named("laneletType").any(|kind| kind.text() == "crosswalk") {
            self.crosswalks.push(lane.left.iter().chain(lane.right.iter().rev()).copied().collect());
        }
        Ok(())
    }

    pub fn speed_limit_mps(&self, lane: LaneIx) -> Option<f64> {
        self.road.lanes.get(lane).and_then(|lane| lane.speed_limit_mps)
    }

    /// Returns the number of points of all lanes and crosswalks, and of the stop signs.
    pub fn size(&self) -> usize {
        let lanes: usize = self.road.lanes.iter().map(|lane| 3 * lane.centre.len()).sum();
        lanes + self.crosswalks.iter().map(Vec::len).sum::<usize>() + self.stop_signs.len()
    }

    /// Returns the number of references from lanelets to lights.
    pub fn light_count(&self) -> usize {
        self.light_refs
    }

    pub fn shifted(&self, origin: Vec2) -> Road {
        let mut road = self.road.clone();
        for lane in &mut road.lanes {
            for line in [&mut lane.centre, &mut lane.left, &mut lane.right] {
                *line = shifted(line, origin);
            }
        }
        road
    }

    /// Returns one light per lanelet. Of several (for different turns) the most permissive counts.
    pub fn lights_over(&self, steps: usize, start_s: f64, dt_s: f64, origin: Vec2) -> Vec<Light> {
        let rank = |state: &LightState| match state {
            LightState::Unknown => 0,
            LightState::Stop => 1,
            LightState::Caution => 2,
            LightState::Go => 3,
        };
        let state = |cycles: &[Cycle], step: usize| {
            let at = (start_s + step as f64 * DT_S) / dt_s + 1e-6;
            cycles.iter().map(|cycle| cycle.state_at(at.floor())).max_by_key(rank).unwrap_or(LightState::Unknown)
        };
        let lights = self.lights.iter();
        lights
            .map(|light| Light {
                lane: light.lane,
                stop_point: light.stop_point - origin,
                states: (0..steps).map(|step| state(&light.cycles, step)).collect(),
            })
            .collect()
    }

    pub fn stop_signs_from(&self, origin: Vec2) -> Vec<StopSign> {
        let signs = self.stop_signs.iter();
        signs.map(|sign| StopSign { position: sign.position - origin, lanes: sign.lanes.clone() }).collect()
    }
}
