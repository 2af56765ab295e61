//! Lanelets with their topology, what signs and lights say about them, stop lines and crosswalks.

use std::collections::{BTreeMap, BTreeSet};

use super::{File, point, shifted};
use crate::formats::import_error::{ImportError, shown};
use crate::formats::xml_read::Element;
use crate::kernel::{Vec2, num};
use crate::scene::validate::LINKS_MAX;
use crate::scene::{DT_S, Lane, LaneGraph, LaneIx, LaneKind, Light, LightState, Neighbour, Road, StopSign};

/// Maximum-speed signs in the schema's catalogues (Germany and Zamunda, USA, Spain); the value is in m/s. Other
/// countries' files use the German numbers.
const SPEED_SIGNS: [&str; 4] = ["274", "274.1", "R2-1", "r301"];
/// Stop signs of the same catalogues, and the American one.
const STOP_SIGNS: [&str; 3] = ["206", "r2", "R1-1"];

/// Phases of a light's cycle.
const PHASES_MAX: usize = 100;
/// References from lanelets to lights in a file.
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

#[derive(Clone)]
struct Cycle {
    active: bool,
    offset_steps: f64,
    /// Duration in steps of the file, state.
    phases: Vec<(f64, LightState)>,
}

impl Cycle {
    /// State at a step of the file: the first phase begins at the offset and the cycle repeats both ways.
    fn state_at(&self, step: f64) -> LightState {
        let total = num::sum(self.phases.iter().map(|p| p.0));
        if !self.active || total <= 0.0 {
            return LightState::Unknown;
        }
        let mut left = step - self.offset_steps;
        left -= (left / total).floor() * total;
        for (duration, state) in &self.phases {
            // Resampling may put a step just before a change by a rounding error; it then belongs after the change.
            if left < duration - 1e-6 {
                return *state;
            }
            left -= duration;
        }
        self.phases[0].1
    }
}

pub(super) fn read(file: &File<'_>) -> Result<Network, ImportError> {
    unique_ids(file)?;
    let elements: Vec<Element<'_>> = file.root.named("lanelet").collect();
    if elements.is_empty() {
        return Err(file.root.refuse("at least one <lanelet>"));
    }
    let mut index = BTreeMap::new();
    for (ix, element) in elements.iter().enumerate() {
        index.insert(element.needed_attribute("id")?.to_string(), ix);
    }
    let signs = signs(file)?;
    let mut road = Road { lanes: elements.iter().map(|e| lane(e, &signs)).collect::<Result<_, _>>()?, edges: vec![] };
    for (ix, element) in elements.iter().enumerate() {
        link(&mut road, ix, element, &index)?;
    }
    let cycles = cycles(file)?;
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
        network.furnish(ix, element, &signs, &cycles)?;
    }
    Ok(network)
}

/// Ids are unique among all elements of a file.
fn unique_ids(file: &File<'_>) -> Result<(), ImportError> {
    let mut seen = BTreeSet::new();
    for element in file.root.children() {
        if let Some(id) = element.attribute("id").filter(|id| !seen.insert(*id)) {
            return Err(element.refuse(format!("an id of its own; {:?} is already taken", shown(id))));
        }
    }
    Ok(())
}

fn lane(element: &Element<'_>, signs: &BTreeMap<&str, Sign>) -> Result<Lane, ImportError> {
    let bound = |name: &str| -> Result<Vec<Vec2>, ImportError> {
        let bound = element.needed_child(name)?;
        let points = bound.named("point").map(|p| point(&p)).collect::<Result<Vec<_>, _>>()?;
        if points.len() < 2 {
            return Err(bound.refuse(format!("at least 2 points, found {}", points.len())));
        }
        Ok(points)
    };
    let (left, right) = (bound("leftBound")?, bound("rightBound")?);
    if left.len() != right.len() {
        let counts = format!("as many left as right points, found {} and {}", left.len(), right.len());
        return Err(element.refuse(counts));
    }
    let mut speed_limit_mps = element.child("speedLimit").map(|e| e.number()).transpose()?;
    for sign in refs(element, "trafficSignRef", signs)? {
        speed_limit_mps = sign.speed_limit_mps.or(speed_limit_mps);
    }
    Ok(Lane {
        id: element.needed_attribute("id")?.to_string(),
        kind: kind(element),
        centre: left.iter().zip(&right).map(|(l, r)| l.lerp(*r, 0.5)).collect(),
        left,
        right,
        entries: vec![],
        exits: vec![],
        left_neighbours: vec![],
        right_neighbours: vec![],
        speed_limit_mps: speed_limit_mps.filter(|limit| *limit > 0.0),
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

/// The targets of all `<name ref="..."/>` of an element.
fn refs<'m, T>(element: &Element<'_>, name: &str, known: &'m BTreeMap<&str, T>) -> Result<Vec<&'m T>, ImportError> {
    let mut lanelets = Vec::new();
    for reference in element.children().filter(|child| child.name() == name) {
        let id = reference.needed_attribute("ref")?;
        let there = known.get(id);
        lanelets
            .push(there.ok_or_else(|| reference.refuse(format!("a reference to something, found {:?}", shown(id))))?);
    }
    Ok(lanelets)
}

fn link(
    road: &mut Road,
    ix: LaneIx,
    element: &Element<'_>,
    index: &BTreeMap<String, LaneIx>,
) -> Result<(), ImportError> {
    for child in element.children() {
        let name = child.name();
        if !matches!(name, "predecessor" | "successor" | "adjacentLeft" | "adjacentRight") {
            continue;
        }
        let id = child.needed_attribute("ref")?;
        let there = index.get(id).copied();
        let other = there.ok_or_else(|| child.refuse(format!("a lanelet's id, found {:?}", shown(id))))?;
        if other == ix {
            return Err(child.refuse("another lanelet than itself"));
        }
        // It is enough that one of the two names the other; the missing half of a link is added.
        let (from, to) = if name == "predecessor" { (other, ix) } else { (ix, other) };
        match name {
            "predecessor" | "successor" => {
                if road.lanes[from].exits.len() >= LINKS_MAX || road.lanes[to].entries.len() >= LINKS_MAX {
                    return Err(child.refuse(format!("at most {LINKS_MAX} links of one kind at a lanelet")));
                }
                if !road.lanes[from].exits.contains(&to) {
                    road.lanes[from].exits.push(to);
                    road.lanes[to].entries.push(from);
                }
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
    }
    Ok(())
}

#[derive(Default)]
struct Sign {
    speed_limit_mps: Option<f64>,
    is_stop: bool,
    position: Option<Vec2>,
}

fn signs<'d>(file: &File<'d>) -> Result<BTreeMap<&'d str, Sign>, ImportError> {
    let mut signs = BTreeMap::new();
    for element in file.root.named("trafficSign") {
        let mut sign = Sign::default();
        for part in element.named("trafficSignElement") {
            let id = part.needed_child("trafficSignID")?.text();
            if SPEED_SIGNS.contains(&id) {
                let value = part.named("additionalValue").next();
                sign.speed_limit_mps = value.map(|v| v.number()).transpose()?.or(sign.speed_limit_mps);
            }
            sign.is_stop |= STOP_SIGNS.contains(&id);
        }
        sign.position = position(&element)?;
        signs.insert(element.needed_attribute("id")?, sign);
    }
    Ok(signs)
}

fn position(element: &Element<'_>) -> Result<Option<Vec2>, ImportError> {
    element.child("position").and_then(|p| p.child("point")).map(|p| point(&p)).transpose()
}

fn cycles<'d>(file: &File<'d>) -> Result<BTreeMap<&'d str, Cycle>, ImportError> {
    let mut cycles = BTreeMap::new();
    for element in file.root.named("trafficLight") {
        let active = element.child("active").is_none_or(|active| active.text() != "false");
        let mut cycle = Cycle { active, offset_steps: 0.0, phases: vec![] };
        if let Some(given) = element.child("cycle") {
            cycle.offset_steps = given.child("timeOffset").map(|e| super::step(&e)).transpose()?.unwrap_or(0.0);
            for phase in given.named("cycleElement") {
                if cycle.phases.len() >= PHASES_MAX {
                    return Err(phase.refuse(format!("at most {PHASES_MAX} phases in a cycle")));
                }
                let duration = super::step(&phase.needed_child("duration")?)?;
                cycle.phases.push((duration, colour(&phase.needed_child("color")?)?));
            }
        }
        cycles.insert(element.needed_attribute("id")?, cycle);
    }
    Ok(cycles)
}

fn colour(element: &Element<'_>) -> Result<LightState, ImportError> {
    Ok(match element.text() {
        "red" | "redYellow" => LightState::Stop,
        "yellow" => LightState::Caution,
        "green" => LightState::Go,
        "inactive" => LightState::Unknown,
        other => return Err(element.refuse(format!("a light's colour, found {:?}", shown(other)))),
    })
}

impl Network {
    fn furnish(
        &mut self,
        ix: LaneIx,
        element: &Element<'_>,
        signs: &BTreeMap<&str, Sign>,
        cycles: &BTreeMap<&str, Cycle>,
    ) -> Result<(), ImportError> {
        let line = element.child("stopLine");
        let lane = &self.road.lanes[ix];
        let end = lane.centre[lane.centre.len() - 1];
        let mut ends = Vec::new();
        for p in line.iter().flat_map(|line| line.named("point")) {
            ends.push(point(&p)?);
        }
        // A stop line without points lies at the end of its lanelet.
        let stop_point = if ends.len() == 2 { ends[0].lerp(ends[1], 0.5) } else { end };
        let both = || std::iter::once(*element).chain(line);
        let mut lights: BTreeMap<&str, Cycle> = BTreeMap::new();
        for place in both() {
            refs(&place, "trafficLightRef", cycles)?;
            for reference in place.named("trafficLightRef") {
                let id = reference.needed_attribute("ref")?;
                lights.extend(cycles.get(id).map(|cycle| (id, cycle.clone())));
            }
            if refs(&place, "trafficSignRef", signs)?.iter().any(|sign| sign.is_stop) {
                let position = refs(&place, "trafficSignRef", signs)?.iter().find_map(|sign| sign.position);
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

    /// Points of all lanes and crosswalks, and the stop signs.
    pub fn size(&self) -> usize {
        let lanes: usize = self.road.lanes.iter().map(|lane| 3 * lane.centre.len()).sum();
        lanes + self.crosswalks.iter().map(Vec::len).sum::<usize>() + self.stop_signs.len()
    }

    /// References from lanelets to lights.
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

    /// One light per lanelet. Of several (for different turns) the most permissive counts.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cycle_repeats_from_its_offset_both_ways() {
        use LightState::{Caution, Go, Stop};
        let cycle = Cycle { active: true, offset_steps: 5.0, phases: vec![(10.0, Stop), (4.0, Go), (2.0, Caution)] };
        let states: Vec<LightState> = [4.0, 5.0, 14.0, 15.0, 18.0, 19.0, 21.0].map(|s| cycle.state_at(s)).into();
        assert_eq!(states, [Caution, Stop, Stop, Go, Go, Caution, Stop]);
        assert_eq!(Cycle { active: false, ..cycle }.state_at(6.0), LightState::Unknown);
    }
}
