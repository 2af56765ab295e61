//! ScenarioNet's ScenarioDescription as JSON: what this project exports, and what `json.dump` makes of the pickles'
//! dictionaries (arrays as lists). Coordinates become metres from the ego's place at the current step, unless the
//! file is an export of this project, which is in a local frame already.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, Visitor};

use super::error::{ImportError, shown};
use super::summary::Imported;
use crate::kernel::{Vec2, num};
use crate::scene::remainder::Remainder;
use crate::scene::validate::{SIDE_MAX_M, SIDE_MIN_M, STEPS_MAX};
use crate::scene::{
    AgentKind, DT_S, Ego, Lane, LaneIx, LaneKind, LeftOut, Light, LightState, Neighbour, Origin, Road, Sample, Scene,
    StopSign, Track,
};

const BYTES_MAX: usize = 512 << 20;
/// Stamps may be off by this much, seconds; the Waymo data stay below a millisecond.
const STAMP_OFF_S_MAX: f64 = 0.005;
/// Half widths of a lane: where it is not known, and the bounds of what is believed, metres.
const HALF_WIDTH_M: f64 = 1.75;
const HALF_WIDTH_M_RANGE: (f64, f64) = (1.3, 2.5);
/// Points of a driven path nearer than this are one, metres.
const SAME_PLACE_M: f64 = 0.05;

#[derive(Deserialize)]
struct Description {
    id: Option<Name>,
    length: usize,
    metadata: Metadata,
    tracks: Entries<TrackIn>,
    #[serde(default)]
    dynamic_map_states: Entries<LightIn>,
    map_features: Entries<FeatureIn>,
}

#[derive(Deserialize)]
struct Metadata {
    #[serde(alias = "timestep")]
    ts: Option<Vec<f64>>,
    #[serde(default)]
    current_time_index: usize,
    sdc_id: Option<Name>,
    scenario_id: Option<Name>,
    #[serde(default)]
    objects_of_interest: Vec<Name>,
    evodrive: Option<Remainder>,
}

#[derive(Deserialize)]
struct TrackIn {
    r#type: String,
    state: StateIn,
}

#[derive(Deserialize)]
struct StateIn {
    position: Vec<Vec<f64>>,
    heading: Vec<Cell>,
    velocity: Option<Vec<Vec<f64>>>,
    length: Option<Column>,
    width: Option<Column>,
    valid: Option<Vec<Cell>>,
}

#[derive(Deserialize)]
struct LightIn {
    lane: Option<Name>,
    stop_point: Option<Vec<f64>>,
    state: LightStates,
}

#[derive(Deserialize)]
struct LightStates {
    object_state: Vec<Option<String>>,
}

#[derive(Deserialize)]
struct FeatureIn {
    r#type: String,
    polyline: Option<Vec<Vec<f64>>>,
    polygon: Option<Vec<Vec<f64>>>,
    position: Option<Vec<f64>>,
    lane: Option<Names>,
    width: Option<Vec<Vec<f64>>>,
    #[serde(default)]
    entry_lanes: Vec<Name>,
    #[serde(default)]
    exit_lanes: Vec<Name>,
    #[serde(default)]
    left_neighbor: Vec<NeighbourIn>,
    #[serde(default)]
    right_neighbor: Vec<NeighbourIn>,
    speed_limit_mps: Option<f64>,
    speed_limit_mph: Option<f64>,
    speed_limit_kmh: Option<f64>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum NeighbourIn {
    Described { feature_id: Name, same_direction: Option<bool> },
    Named(Name),
}

/// An id, which some writers leave a number.
#[derive(Deserialize, Clone, PartialEq)]
#[serde(untagged)]
enum Name {
    Text(String),
    Number(i64),
}

impl Name {
    fn text(&self) -> String {
        match self {
            Name::Text(text) => text.clone(),
            Name::Number(number) => number.to_string(),
        }
    }
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Names {
    Many(Vec<Name>),
    One(Name),
}

/// A value of one step: a number, a flag, or a row of one number.
#[derive(Deserialize)]
#[serde(untagged)]
enum Cell {
    Number(f64),
    Flag(bool),
    Row(Vec<f64>),
}

impl Cell {
    fn number(&self) -> Option<f64> {
        match self {
            Cell::Number(number) => Some(*number),
            Cell::Flag(flag) => Some(f64::from(u8::from(*flag))),
            Cell::Row(row) => row.first().copied(),
        }
    }
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Column {
    Many(Vec<Cell>),
    One(f64),
}

/// A dictionary in the order of the file; keys that occur twice stay two entries.
struct Entries<V>(Vec<(String, V)>);

impl<V> Default for Entries<V> {
    fn default() -> Self {
        Entries(Vec::new())
    }
}

impl<'de, V: Deserialize<'de>> Deserialize<'de> for Entries<V> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct InOrder<V>(PhantomData<V>);
        impl<'de, V: Deserialize<'de>> Visitor<'de> for InOrder<V> {
            type Value = Entries<V>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a dictionary")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Entries<V>, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Entries(entries))
            }
        }
        deserializer.deserialize_map(InOrder(PhantomData))
    }
}

/// The scene of a ScenarioDescription in JSON. An export of this project gives the very scene it was made of; if it
/// was edited since, what its standard keys say, with that said in `left_out`.
///
/// # Errors
/// No JSON, no ScenarioDescription, no self-driving car, or another rate than 10 Hz.
pub fn import(file: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    let description = parsed(file, bytes)?;
    let origin = Origin { format: "scenarionet-json".into(), name: file.into() };
    let mut left_out = Vec::new();
    let is_local = description.metadata.evodrive.is_some();
    let read = Reading { file, description: &description, is_local }.scene(origin.clone(), &mut left_out)?;
    let scene = match &description.metadata.evodrive {
        None => read,
        Some(remainder) => remainder.laid_over(&read, &origin).unwrap_or_else(|| {
            let reason = "the file was edited after its export, or exported by another version; what its standard \
                          keys say was read, without the exact lane boundaries, start and route";
            left_out.push(LeftOut { file: file.into(), what: "metadata.evodrive".into(), reason: reason.into() });
            read
        }),
    };
    Ok(Imported { scenes: vec![scene], left_out })
}

/// What the standard keys of an export of this project say, without what stands beside them.
pub(in crate::scene) fn read_plainly(file: &str, bytes: &[u8]) -> Result<Scene, ImportError> {
    let description = parsed(file, bytes)?;
    Reading { file, description: &description, is_local: true }.scene(Origin::default(), &mut Vec::new())
}

fn parsed(file: &str, bytes: &[u8]) -> Result<Description, ImportError> {
    if bytes.len() > BYTES_MAX {
        return Err(ImportError::new(file, "byte 0", "at most 512 MiB of JSON", "split the file"));
    }
    serde_json::from_slice(bytes).map_err(|error| {
        let place = format!("line {} column {}", error.line(), error.column());
        let expected = format!("a ScenarioDescription as JSON ({})", shown(&error.to_string()));
        ImportError::new(file, place, expected, "write the dictionary of a ScenarioNet pickle as JSON, arrays as lists")
    })
}

struct Reading<'d> {
    file: &'d str,
    description: &'d Description,
    /// Coordinates are to stay as they are.
    is_local: bool,
}

impl Reading<'_> {
    fn refuse(&self, place: &str, expected: impl Into<String>) -> ImportError {
        ImportError::new(self.file, place, expected, "mend the file or leave it out")
    }

    fn scene(&self, origin: Origin, left_out: &mut Vec<LeftOut>) -> Result<Scene, ImportError> {
        let Description { length: steps, metadata, .. } = self.description;
        let steps = *steps;
        self.check_times(steps)?;
        let mut leave = |what: &str, reason: String| {
            left_out.push(LeftOut { file: self.file.into(), what: shown(what), reason });
        };
        let sdc = metadata.sdc_id.as_ref().map(Name::text);
        let sdc = sdc.ok_or_else(|| self.refuse("metadata.sdc_id", "the id of the self-driving car's track"))?;
        let mut ego = None;
        let mut tracks: Vec<Track> = Vec::new();
        for (id, given) in &self.description.tracks.0 {
            match track(id, given, steps) {
                Ok(track) if *id == sdc && ego.is_none() => ego = Some(track),
                Ok(track) if track.span().is_some() => tracks.push(track),
                Ok(_) => leave(id, "no sample of it is valid".into()),
                Err(reason) => leave(id, reason),
            }
        }
        let ego = ego.ok_or_else(|| self.refuse("tracks", format!("a readable track {:?}, the ego", shown(&sdc))))?;
        let current_step = metadata.current_time_index;
        let here = ego.at(current_step).map(|sample| sample.position);
        let here = here.ok_or_else(|| self.refuse("tracks", "the ego's sample at current_time_index"))?;
        let (mut road, index) = self.road(&mut leave);
        let lights = self.lights(steps, &road, &index, &mut leave);
        let named = metadata.objects_of_interest.iter().map(Name::text);
        let objects_of_interest = named.filter_map(|id| tracks.iter().position(|track| track.id == id)).collect();
        road.edges = self.lines(&["ROAD_EDGE_BOUNDARY", "ROAD_EDGE_MEDIAN"], 2, |f| f.polyline.as_ref());
        let id = self.description.id.as_ref().or(metadata.scenario_id.as_ref());
        let mut scene = Scene {
            id: id.map_or_else(|| self.file.to_string(), Name::text),
            origin,
            steps,
            current_step,
            road,
            tracks,
            ego: Ego {
                route: driven(&ego, current_step),
                track: ego,
                start_step: current_step,
                target_speed_mps: None,
            },
            objects_of_interest,
            lights,
            stop_signs: self.stop_signs(&index),
            crosswalks: self.lines(&["CROSSWALK"], 3, |f| f.polygon.as_ref()),
        };
        if !self.is_local {
            shift(&mut scene, here);
        }
        Ok(scene)
    }

    fn check_times(&self, steps: usize) -> Result<(), ImportError> {
        if !(2..=STEPS_MAX).contains(&steps) {
            return Err(self.refuse("length", format!("2 to {STEPS_MAX} steps, found {steps}")));
        }
        let Some(stamps) = &self.description.metadata.ts else {
            return Err(self.refuse("metadata.ts", "the time of every step, seconds"));
        };
        let first = stamps.first().copied().unwrap_or(0.0);
        let off = |(k, stamp): (usize, &f64)| (stamp - first - k as f64 * DT_S).abs() > STAMP_OFF_S_MAX;
        if stamps.len() != steps || stamps.iter().enumerate().any(off) {
            return Err(self.refuse("metadata.ts", format!("{steps} times, 0.1 s apart (resample the scene to 10 Hz)")));
        }
        Ok(())
    }

    /// Lanes with mutual links, and their places by id.
    fn road(&self, leave: &mut impl FnMut(&str, String)) -> (Road, BTreeMap<String, LaneIx>) {
        let mut lanes: Vec<Lane> = Vec::new();
        let mut index = BTreeMap::new();
        let mut sources = Vec::new();
        for (id, feature) in &self.description.map_features.0 {
            let Some(kind) = lane_kind(&feature.r#type) else { continue };
            match lane(id, kind, feature) {
                _ if index.contains_key(id) => leave(id, "a lane of the same id came before".into()),
                None => leave(id, "its centre line has no two points that differ".into()),
                Some(lane) => {
                    index.insert(id.clone(), lanes.len());
                    lanes.push(lane);
                    sources.push(feature);
                }
            }
        }
        for (ix, feature) in sources.iter().enumerate() {
            let place = |name: &Name| index.get(&name.text()).copied().filter(|&other| other != ix);
            // Lanes beyond the cut-out of the map are named but not there.
            let entries = feature.entry_lanes.iter().filter_map(place).map(|from| (from, ix));
            let exits = feature.exit_lanes.iter().filter_map(place).map(|to| (ix, to));
            for (from, to) in entries.chain(exits) {
                if !lanes[from].exits.contains(&to) {
                    lanes[from].exits.push(to);
                    lanes[to].entries.push(from);
                }
            }
            lanes[ix].left_neighbour = beside(&lanes, ix, &feature.left_neighbor, &index);
            lanes[ix].right_neighbour = beside(&lanes, ix, &feature.right_neighbor, &index);
        }
        (Road { lanes, edges: vec![] }, index)
    }

    fn lights(
        &self,
        steps: usize,
        road: &Road,
        index: &BTreeMap<String, LaneIx>,
        leave: &mut impl FnMut(&str, String),
    ) -> Vec<Light> {
        let mut lights = Vec::new();
        for (id, given) in &self.description.dynamic_map_states.0 {
            let lane = index.get(&given.lane.as_ref().map_or_else(|| id.clone(), Name::text));
            let Some(&lane) = lane else {
                leave(id, "its lane is not in the map".into());
                continue;
            };
            let mut states: Vec<LightState> = given.state.object_state.iter().take(steps).map(light_state).collect();
            states.resize(steps, LightState::Unknown);
            let end = road.lanes[lane].centre[0];
            let stop_point = given.stop_point.as_deref().and_then(point).unwrap_or(end);
            lights.push(Light { lane, stop_point, states });
        }
        lights
    }

    fn stop_signs(&self, index: &BTreeMap<String, LaneIx>) -> Vec<StopSign> {
        let signs = self.description.map_features.0.iter().filter(|(_, feature)| feature.r#type == "STOP_SIGN");
        let read = |(_, feature): &(String, FeatureIn)| {
            let names = match &feature.lane {
                Some(Names::Many(names)) => names.clone(),
                Some(Names::One(name)) => vec![name.clone()],
                None => vec![],
            };
            let lanes = names.iter().filter_map(|name| index.get(&name.text()).copied()).collect();
            Some(StopSign { position: point(feature.position.as_deref()?)?, lanes })
        };
        signs.filter_map(read).collect()
    }

    fn lines<'f>(
        &'f self,
        types: &[&str],
        least: usize,
        of: impl Fn(&'f FeatureIn) -> Option<&'f Vec<Vec<f64>>>,
    ) -> Vec<Vec<Vec2>> {
        let features = self.description.map_features.0.iter().filter(|(_, f)| types.contains(&f.r#type.as_str()));
        let lines = features.filter_map(|(_, f)| of(f).or(f.polygon.as_ref()).or(f.polyline.as_ref()));
        lines.map(|line| line.iter().filter_map(|p| point(p)).collect()).filter(|l: &Vec<_>| l.len() >= least).collect()
    }
}

fn track(id: &str, given: &TrackIn, steps: usize) -> Result<Track, String> {
    let state = &given.state;
    let whole = state.position.len() == steps
        && state.heading.len() == steps
        && state.velocity.as_ref().is_none_or(|v| v.len() == steps)
        && state.valid.as_ref().is_none_or(|v| v.len() == steps);
    if !whole {
        return Err(format!("its state has other than {steps} entries"));
    }
    let seen = |step: usize| match &state.valid {
        None => true,
        Some(valid) => valid[step].number().is_some_and(|v| v != 0.0),
    };
    let place = |step: usize| point(&state.position[step]);
    let sample = |step: usize| {
        let velocity = match &state.velocity {
            Some(given) => point(&given[step])?,
            None => {
                let (from, to) = (step.saturating_sub(1), (step + 1).min(steps - 1));
                (place(to)? - place(from)?) * (1.0 / ((to - from) as f64 * DT_S))
            }
        };
        let heading_rad = state.heading[step].number().filter(|h| h.is_finite())?;
        Some(Sample { position: place(step)?, heading_rad: num::wrap_angle(heading_rad), velocity })
    };
    let kind = match given.r#type.as_str() {
        "VEHICLE" => AgentKind::Vehicle,
        "PEDESTRIAN" => AgentKind::Pedestrian,
        "CYCLIST" => AgentKind::Cyclist,
        _ => AgentKind::Static,
    };
    let usual = match kind {
        AgentKind::Vehicle => (4.5, 1.9),
        AgentKind::Cyclist => (1.8, 0.7),
        AgentKind::Pedestrian | AgentKind::Static => (0.6, 0.6),
    };
    let side = |column: &Option<Column>, usual: f64| match column {
        None => Some(usual),
        Some(Column::One(one)) => Some(*one),
        Some(Column::Many(cells)) => {
            let while_seen = cells.iter().take(steps).enumerate().filter(|(step, _)| seen(*step));
            let values: Vec<f64> = while_seen.filter_map(|(_, cell)| cell.number()).collect();
            num::quantile(&values, 0.5)
        }
    };
    let (length_m, width_m) = (side(&state.length, usual.0), side(&state.width, usual.1));
    let sound = |side: &f64| (SIDE_MIN_M..=SIDE_MAX_M).contains(side);
    let (Some(length_m), Some(width_m)) = (length_m.filter(sound), width_m.filter(sound)) else {
        return Err("its box has no sides of 0.05 to 60 m".into());
    };
    let samples = (0..steps).map(|step| if seen(step) { sample(step) } else { None }).collect();
    Ok(Track { id: id.into(), kind, length_m, width_m, samples })
}

/// The path that the ego drove from its start on; straight ahead where it stood.
fn driven(ego: &Track, start: usize) -> Vec<Vec2> {
    let mut route: Vec<Vec2> = Vec::new();
    for sample in ego.samples.iter().skip(start).flatten() {
        if route.last().is_none_or(|last| last.distance(sample.position) > SAME_PLACE_M) {
            route.push(sample.position);
        }
    }
    if let (1, Some(sample)) = (route.len(), ego.at(start)) {
        route.push(sample.position + Vec2::from_heading(sample.heading_rad) * 10.0);
    }
    route
}

fn lane_kind(name: &str) -> Option<LaneKind> {
    Some(match name {
        "LANE_FREEWAY" => LaneKind::Freeway,
        "LANE_BIKE_LANE" => LaneKind::Bike,
        "LANE_SURFACE_STREET" | "LANE_UNKNOWN" => LaneKind::Street,
        "LANE_SURFACE_UNSTRUCTURE" => LaneKind::Other,
        _ => return None,
    })
}

fn lane(id: &str, kind: LaneKind, feature: &FeatureIn) -> Option<Lane> {
    let given = feature.polyline.as_ref()?;
    let centre: Vec<Vec2> = given.iter().filter_map(|p| point(p)).collect();
    if !centre.windows(2).any(|w| w[0].distance(w[1]) > 1e-6) {
        return None;
    }
    let (low, high) = HALF_WIDTH_M_RANGE;
    let half = |k: usize, side: usize| {
        let rows = feature.width.as_ref().filter(|rows| rows.len() == given.len() && given.len() == centre.len());
        let width = rows.and_then(|rows| rows[k].get(side)).filter(|width| **width > 0.0);
        width.map_or(HALF_WIDTH_M, |width| width.clamp(low, high))
    };
    let side = |side: usize, sign: f64| {
        (0..centre.len()).map(|k| centre[k] + aside(&centre, k) * (sign * half(k, side))).collect()
    };
    let (left, right) = (side(0, 1.0), side(1, -1.0));
    let limit = feature.speed_limit_mps.or(feature.speed_limit_mph.map(|mph| mph * 0.44704));
    let limit = limit.or(feature.speed_limit_kmh.map(|kmh| kmh / 3.6)).filter(|limit| *limit > 0.0);
    Some(Lane {
        id: id.into(),
        kind,
        centre,
        left,
        right,
        entries: vec![],
        exits: vec![],
        left_neighbour: None,
        right_neighbour: None,
        speed_limit_mps: limit,
    })
}

/// Unit vector to the left of a line at one of its points.
fn aside(line: &[Vec2], k: usize) -> Vec2 {
    let ahead = line[k..].iter().find(|p| p.distance(line[k]) > 1e-6).copied().unwrap_or(line[k]);
    let behind = line[..k].iter().rev().find(|p| p.distance(line[k]) > 1e-6).copied().unwrap_or(line[k]);
    let along = ahead - behind;
    if along.norm() > 1e-9 { along.left() * (1.0 / along.norm()) } else { (ahead - line[k]).left() }
}

fn beside(lanes: &[Lane], ix: LaneIx, given: &[NeighbourIn], index: &BTreeMap<String, LaneIx>) -> Option<Neighbour> {
    let place = |neighbour: &NeighbourIn| {
        let (name, direction) = match neighbour {
            NeighbourIn::Described { feature_id, same_direction } => (feature_id, *same_direction),
            NeighbourIn::Named(name) => (name, None),
        };
        index.get(&name.text()).copied().filter(|&other| other != ix).map(|other| (other, direction))
    };
    let (lane, direction) = given.iter().find_map(place)?;
    let along = |lane: &Lane| lane.centre[lane.centre.len() - 1] - lane.centre[0];
    let same_direction = direction.unwrap_or_else(|| along(&lanes[ix]).dot(along(&lanes[lane])) >= 0.0);
    Some(Neighbour { lane, same_direction })
}

fn light_state(name: &Option<String>) -> LightState {
    match name.as_deref().unwrap_or("") {
        name if name.ends_with("STOP") || name.ends_with("RED") => LightState::Stop,
        name if name.ends_with("CAUTION") || name.ends_with("YELLOW") => LightState::Caution,
        name if name.ends_with("GO") || name.ends_with("GREEN") => LightState::Go,
        _ => LightState::Unknown,
    }
}

/// The first two numbers, if they are finite.
fn point(row: &[f64]) -> Option<Vec2> {
    let p = Vec2::new(*row.first()?, *row.get(1)?);
    p.is_finite().then_some(p)
}

fn shift(scene: &mut Scene, origin: Vec2) {
    let move_line = |line: &mut Vec<Vec2>| line.iter_mut().for_each(|p| *p = *p - origin);
    for lane in &mut scene.road.lanes {
        [&mut lane.centre, &mut lane.left, &mut lane.right].into_iter().for_each(move_line);
    }
    scene.road.edges.iter_mut().for_each(move_line);
    scene.crosswalks.iter_mut().for_each(move_line);
    move_line(&mut scene.ego.route);
    for track in scene.tracks.iter_mut().chain([&mut scene.ego.track]) {
        track.samples.iter_mut().flatten().for_each(|s| s.position = s.position - origin);
    }
    scene.lights.iter_mut().for_each(|light| light.stop_point = light.stop_point - origin);
    scene.stop_signs.iter_mut().for_each(|sign| sign.position = sign.position - origin);
}
