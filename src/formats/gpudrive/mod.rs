//! GPUDrive, PufferDrive and Nocturne JSON, both generations. The newer one names ids and the self-driving car and
//! has radians; the older one has neither, and headings in degrees that may run over a full turn.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;

use super::assemble::{Log, LogLane, LogLight, LogTrack};
use super::centreline::Across;
use super::import_error::ImportError;
use super::imported::Imported;
use super::scenarionet::read::finished;
use crate::kernel::{Vec2, num};
use crate::scene::validate::STEPS_MAX;
use crate::scene::{AgentKind, DT_S, LaneKind, LightState, Origin, Sample};

/// The number that stands for a value that was not observed.
const NOT_OBSERVED: f64 = -10_000.0;
/// "Now", as in Waymo's data, from which all these files come.
const CURRENT: usize = 10;
/// A light without a lane id belongs to the lane that has a point within this distance, metres.
const LIGHT_WITHIN_M: f64 = 3.0;
const BYTES_MAX: usize = 128 << 20;
/// Most lights times steps.
const LIGHT_STATES_MAX: usize = 4_000_000;
/// Most lights times lane points for a search by place.
const SEARCH_MAX: usize = 100_000_000;

#[derive(Deserialize)]
struct File {
    name: Option<String>,
    scenario_id: Option<String>,
    objects: Vec<Object>,
    roads: Vec<Road>,
    #[serde(default)]
    tl_states: BTreeMap<String, Light>,
    metadata: Option<Metadata>,
}

#[derive(Deserialize)]
struct Metadata {
    sdc_track_index: Option<i64>,
    #[serde(default)]
    objects_of_interest: Vec<i64>,
}

#[derive(Clone, Copy, Deserialize)]
struct Point {
    x: f64,
    y: f64,
}

impl From<Point> for Vec2 {
    fn from(p: Point) -> Vec2 {
        Vec2::new(p.x, p.y)
    }
}

#[derive(Deserialize)]
struct Object {
    id: Option<i64>,
    position: Vec<Point>,
    #[serde(default)]
    velocity: Vec<Point>,
    heading: Vec<f64>,
    valid: Vec<bool>,
    length: f64,
    width: f64,
    #[serde(rename = "type")]
    kind: String,
}

#[derive(Deserialize)]
struct Road {
    id: Option<i64>,
    map_element_id: Option<i64>,
    geometry: Geometry,
    #[serde(rename = "type")]
    kind: String,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Geometry {
    Line(Vec<Point>),
    Place(Point),
}

impl Geometry {
    fn points(&self) -> Vec<Vec2> {
        match self {
            Geometry::Line(points) => points.iter().map(|p| Vec2::from(*p)).collect(),
            Geometry::Place(point) => vec![Vec2::from(*point)],
        }
    }
}

#[derive(Deserialize)]
struct Light {
    #[serde(default)]
    state: Vec<Option<State>>,
    #[serde(default)]
    x: Vec<f64>,
    #[serde(default)]
    y: Vec<f64>,
    #[serde(default)]
    time_index: Vec<usize>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum State {
    Name(String),
    Code(i64),
}

/// The scene in a JSON file.
///
/// # Errors The text is not JSON of this schema, the samples have unequal counts, or no vehicle can be the ego.
pub fn import(file_name: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    if bytes.len() > BYTES_MAX {
        return Err(ImportError::new(file_name, "byte 0", "at most 128 MiB of JSON", "split the file"));
    }
    let file: File = serde_json::from_slice(bytes).map_err(|error| {
        let place = format!("line {}, column {}", error.line(), error.column());
        let expected = format!("GPUDrive or Nocturne JSON ({error})");
        ImportError::new(file_name, place, expected, "write the file again or leave it out")
    })?;
    let steps = steps(file_name, &file)?;
    if file.tl_states.len().saturating_mul(steps) > LIGHT_STATES_MAX {
        let expected = format!("at most {LIGHT_STATES_MAX} states of lights");
        return Err(ImportError::new(file_name, "tl_states", expected, "write the file again or leave it out"));
    }
    let is_new = file.metadata.is_some() || file.scenario_id.is_some();
    let tracks = file.objects.iter().enumerate().map(|(ix, object)| track(ix, object, is_new)).collect::<Vec<_>>();
    let names = [&file.scenario_id, &file.name].into_iter().flatten().find(|name| !name.trim().is_empty());
    let stem = file_name.split('.').next().unwrap_or(file_name);
    let id = names.map_or(stem, |name| name.strip_suffix(".json").unwrap_or(name)).to_string();
    let marked =
        file.metadata.as_ref().and_then(|m| m.sdc_track_index).map(|ix| usize::try_from(ix).unwrap_or(usize::MAX));
    let chosen = marked.or_else(|| likely_ego(&tracks)).filter(|&ix| ix < tracks.len());
    let ego = chosen.ok_or_else(|| {
        let expected = "the index of an object as sdc_track_index, or a vehicle observed at step 10";
        ImportError::new(file_name, "objects", expected, "no ego can be chosen; leave the file out")
    })?;
    let interest = file.metadata.as_ref().map(|m| m.objects_of_interest.as_slice()).unwrap_or_default();
    let mut log = Log {
        id,
        origin: Origin { format: if is_new { "gpudrive" } else { "nocturne" }.into(), name: file_name.into() },
        times_s: (0..steps).map(|k| k as f64 * DT_S).collect(),
        current: CURRENT.min(steps - 1),
        tracks,
        ego,
        objects_of_interest: interest.iter().map(i64::to_string).collect(),
        ..Log::default()
    };
    roads(&file.roads, &mut log);
    log.lights = signals(&file.tl_states, &log, steps);
    let mut imported = finished(file_name, log);
    if marked.is_none() {
        let reason =
            "the file marks no ego; taken is the vehicle observed for most steps, of equals the farthest driven";
        let what = format!("mark of the ego (object {ego} chosen)");
        imported.left_out.push(crate::scene::LeftOut { file: file_name.into(), what, reason: reason.into() });
    }
    Ok(imported)
}

fn steps(file_name: &str, file: &File) -> Result<usize, ImportError> {
    let refuse = |place: String, expected: String| {
        Err(ImportError::new(file_name, place, expected, "write the file again or leave it out"))
    };
    let Some(first) = file.objects.first() else { return refuse("objects".into(), "at least one object".into()) };
    let steps = first.valid.len();
    if !(2..=STEPS_MAX).contains(&steps) {
        return refuse("objects[0].valid".into(), format!("2 to 1200 samples, found {steps}"));
    }
    for (ix, object) in file.objects.iter().enumerate() {
        let velocity = if object.velocity.is_empty() { steps } else { object.velocity.len() };
        let counts = [object.valid.len(), object.position.len(), object.heading.len(), velocity];
        if counts.iter().any(|&n| n != steps) {
            let found = format!("{steps} samples of valid, position, heading, velocity, found {counts:?}");
            return refuse(format!("objects[{ix}]"), found);
        }
    }
    Ok(steps)
}

fn track(ix: usize, object: &Object, is_new: bool) -> LogTrack {
    let unit = if is_new { 1.0 } else { num::PI / 180.0 };
    let sample = |k: usize| {
        let position = Vec2::from(object.position[k]);
        let observed = object.valid[k] && position.x != NOT_OBSERVED && position.y != NOT_OBSERVED;
        observed.then(|| Sample {
            position,
            heading_rad: num::wrap_angle(object.heading[k] * unit),
            velocity: object.velocity.get(k).map_or(Vec2::ZERO, |v| Vec2::from(*v)),
        })
    };
    LogTrack {
        id: object.id.map_or_else(|| format!("object{ix}"), |id| id.to_string()),
        kind: match object.kind.as_str() {
            "vehicle" => AgentKind::Vehicle,
            "pedestrian" => AgentKind::Pedestrian,
            "cyclist" => AgentKind::Cyclist,
            _ => AgentKind::Static,
        },
        length_m: object.length,
        width_m: object.width,
        samples: (0..object.valid.len()).map(sample).collect(),
    }
}

/// If no ego is marked: the vehicle observed at "now" that is observed for most steps; among equals the one that drives
/// farthest, then the first.
fn likely_ego(tracks: &[LogTrack]) -> Option<usize> {
    let mut best: Option<(usize, f64, usize)> = None;
    for (ix, track) in tracks.iter().enumerate() {
        let now = CURRENT.min(track.samples.len().saturating_sub(1));
        if track.kind != AgentKind::Vehicle || track.samples.get(now).is_none_or(Option::is_none) {
            continue;
        }
        let places: Vec<Vec2> = track.samples.iter().flatten().map(|s| s.position).collect();
        let driven = num::sum(places.windows(2).map(|w| w[0].distance(w[1])));
        let better = best.is_none_or(|(steps, way, _)| (places.len(), driven) > (steps, way));
        if better {
            best = Some((places.len(), driven, ix));
        }
    }
    best.map(|(_, _, ix)| ix)
}

fn roads(roads: &[Road], log: &mut Log) {
    for (ix, road) in roads.iter().enumerate() {
        let points = road.geometry.points();
        match road.kind.as_str() {
            "lane" => log.lanes.push(LogLane {
                id: road.id.map_or_else(|| format!("road{ix}"), |id| id.to_string()),
                kind: match road.map_element_id {
                    Some(1) => LaneKind::Freeway,
                    Some(3) => LaneKind::Bike,
                    _ => LaneKind::Street,
                },
                points: points.into_iter().map(|p| Across::new(p, 0.0, 0.0)).collect(),
                entries: vec![],
                exits: vec![],
                left: vec![],
                right: vec![],
                speed_limit_mps: None,
            }),
            "road_edge" => log.edges.push(points),
            "crosswalk" => log.crosswalks.push(points),
            "stop_sign" => log.stop_signs.extend(points.first().map(|p| (*p, vec![]))),
            // Painted lines, bumps and driveways are left out, because a rollout does not see them.
            _ => {}
        }
    }
}

fn signals(given: &BTreeMap<String, Light>, log: &Log, steps: usize) -> Vec<LogLight> {
    let ids: BTreeSet<&str> = log.lanes.iter().map(|lane| lane.id.as_str()).collect();
    let points: usize = log.lanes.iter().map(|lane| lane.points.len()).sum();
    // A far too large file gets no search by place.
    let searched = given.len().saturating_mul(points) <= SEARCH_MAX;
    let mut lights = Vec::with_capacity(given.len().min(10_000));
    for (id, light) in given {
        let place = light.x.first().zip(light.y.first()).map(|(x, y)| Vec2::new(*x, *y));
        let near = place.filter(|_| searched && !ids.contains(id.as_str())).and_then(|p| lane_near(p, &log.lanes));
        let mut states = vec![LightState::Unknown; steps];
        for (k, state) in light.state.iter().enumerate() {
            let step = light.time_index.get(k).copied().unwrap_or(k);
            if let (Some(place), Some(state)) = (states.get_mut(step), state) {
                *place = light_state(state);
            }
        }
        lights.push(LogLight { lane: near.unwrap_or_else(|| id.clone()), stop_point: place, states });
    }
    lights
}

/// Id of the lane with the point nearest to a place.
fn lane_near(place: Vec2, lanes: &[LogLane]) -> Option<String> {
    let nearest = |lane: &LogLane| lane.points.iter().map(|p| p.centre.distance(place)).fold(f64::INFINITY, f64::min);
    let distances = lanes.iter().map(|lane| (nearest(lane), &lane.id));
    let best = distances.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 <= LIGHT_WITHIN_M).then(|| best.1.clone())
}

fn light_state(state: &State) -> LightState {
    match state {
        State::Code(code) => waymo_light_state(*code),
        State::Name(name) => match name.to_ascii_lowercase() {
            name if name.contains("stop") => LightState::Stop,
            name if name.contains("caution") => LightState::Caution,
            name if name.contains("go") => LightState::Go,
            _ => LightState::Unknown,
        },
    }
}

/// Waymo's codes: unknown; arrow stop, caution, go; stop, caution, go; flashing stop, caution.
pub(super) fn waymo_light_state(code: i64) -> LightState {
    match code {
        1 | 4 | 7 => LightState::Stop,
        2 | 5 | 8 => LightState::Caution,
        3 | 6 => LightState::Go,
        _ => LightState::Unknown,
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// A car crossing the path of another, in the newer form.
    pub fn new_form() -> Value {
        let car = |id: i64, x: f64, y: f64, vx: f64, vy: f64, heading: f64, kind: &str| {
            let at = |k: usize| json!({"x": x + vx * 0.1 * k as f64, "y": y + vy * 0.1 * k as f64, "z": 0.0});
            json!({
                "id": id, "type": kind, "length": 4.6, "width": 1.9, "height": 1.5, "mark_as_expert": false,
                "goalPosition": {"x": 0.0, "y": 0.0, "z": 0.0},
                "position": (0..91).map(at).collect::<Vec<_>>(),
                "velocity": (0..91).map(|_| json!({"x": vx, "y": vy})).collect::<Vec<_>>(),
                "heading": vec![heading; 91], "valid": vec![true; 91],
            })
        };
        let east = |from: f64, to: f64| {
            let points =
                (0..=((to - from) * 2.0) as usize).map(|k| json!({"x": from + 0.5 * k as f64, "y": 500.0, "z": 0.0}));
            points.collect::<Vec<_>>()
        };
        json!({
            "name": "tfrecord-0.json", "scenario_id": "abc",
            "objects": [car(7, 2060.0, 460.0, 0.0, 8.0, 1.5, "vehicle"), car(9, 2000.0, 500.0, 10.0, 0.0, 0.0, "vehicle"),
                        car(11, 2030.0, 508.0, 0.0, 0.0, 0.0, "pedestrian")],
            "roads": [
                {"id": 50, "map_element_id": 2, "type": "lane", "geometry": east(1990.0, 2050.0)},
                {"id": 51, "map_element_id": 1, "type": "lane", "geometry": east(2050.2, 2120.0)},
                {"id": 52, "map_element_id": 15, "type": "road_edge", "geometry": [{"x": 1990.0, "y": 490.0}, {"x": 2100.0, "y": 490.0}]},
                {"id": 53, "map_element_id": 17, "type": "stop_sign", "geometry": [{"x": 2058.0, "y": 494.0}]},
                {"id": 54, "map_element_id": 3, "type": "lane", "geometry": [{"x": 1.0, "y": 2.0}]},
            ],
            "tl_states": {"50": {"state": ["stop", "go"], "x": [2049.0, 2049.0], "y": [500.0, 500.0], "z": [0.0, 0.0],
                                 "time_index": [3, 4], "lane_id": [50, 50]}},
            "metadata": {"sdc_track_index": 1, "objects_of_interest": [9, 7], "tracks_to_predict": []},
        })
    }

    fn imported(value: &Value) -> Imported {
        import("f.json", value.to_string().as_bytes()).unwrap()
    }

    #[test]
    fn the_newer_form_names_the_ego_and_has_radians() {
        let imported = imported(&new_form());
        let scene = &imported.scenes[0];
        assert_eq!((scene.id.as_str(), scene.ego.track.id.as_str(), scene.current_step), ("abc", "9", 10));
        assert_eq!(scene.objects_of_interest, [0]);
        assert!((scene.tracks[0].at(0).unwrap().heading_rad - 1.5).abs() < 1e-9);
        assert_eq!(scene.ego.track.at(10).unwrap().position, Vec2::ZERO);
        assert_eq!((scene.road.lanes[0].exits.clone(), scene.road.lanes[1].kind), (vec![1], LaneKind::Freeway));
        let light = &scene.lights[0];
        assert_eq!(
            (light.lane, light.states[3], light.states[4], light.states[5]),
            (0, LightState::Stop, LightState::Go, LightState::Unknown)
        );
        assert_eq!((scene.stop_signs.len(), scene.road.edges.len()), (1, 1));
        assert!(imported.left_out.iter().any(|l| l.what == "lane 54"));
        assert_eq!(crate::scene::usable(scene), Ok(()));
    }

    #[test]
    fn the_older_form_has_degrees_over_a_turn_and_an_ego_chosen_by_rule() {
        let mut value = new_form();
        let root = value.as_object_mut().unwrap();
        root.remove("metadata");
        root.remove("scenario_id");
        for object in root["objects"].as_array_mut().unwrap() {
            let object = object.as_object_mut().unwrap();
            object.remove("id");
            object["heading"] = json!(vec![-630.0; 91]);
        }
        root["objects"][0]["valid"][90] = json!(false);
        root["objects"][0]["position"][90] = json!({"x": -10000.0, "y": -10000.0});
        for road in root["roads"].as_array_mut().unwrap() {
            road.as_object_mut().unwrap().remove("id");
        }
        let imported = imported(&value);
        let scene = &imported.scenes[0];
        assert_eq!((scene.id.as_str(), scene.ego.track.id.as_str()), ("tfrecord-0", "object1"));
        assert!((scene.tracks[0].at(0).unwrap().heading_rad - num::FRAC_PI_2).abs() < 1e-9);
        assert_eq!(scene.tracks[0].at(90), None);
        assert_eq!(scene.lights.len(), 1, "found by its place");
        assert!(imported.left_out.iter().any(|l| l.reason.contains("marks no ego")));
    }

    #[test]
    fn damaged_and_hostile_json_is_refused_by_place() {
        let refusal = |text: &str| import("f.json", text.as_bytes()).unwrap_err().to_string();
        assert!(refusal("{\"objects\": [").contains("line 1, column"));
        let deep = "[".repeat(100_000);
        assert!(refusal(&format!("{{\"x\":{deep}")).contains("EOF"), "what nobody asks for is passed over flat");
        assert!(refusal(&format!("{{\"roads\":[{{\"geometry\":{deep}")).contains("recursion"));
        assert!(refusal("{\"objects\": [], \"roads\": []}").contains("at least one object"));
        assert!(refusal("{\"objects\": [], \"roads\": NaN}").contains("column"));
        let mut value = new_form();
        value["objects"][2]["heading"] = json!([1.0]);
        assert!(refusal(&value.to_string()).contains("objects[2]"));
        let mut value = new_form();
        value["metadata"]["sdc_track_index"] = json!(-1);
        assert!(refusal(&value.to_string()).contains("sdc_track_index"));
        let whole = new_form().to_string();
        for end in (0..whole.len()).step_by(977) {
            assert!(import("cut.json", &whole.as_bytes()[..end]).is_err(), "{end}");
        }
    }

    #[test]
    fn a_far_off_sample_breaks_a_rule_and_leaves_the_scene_out() {
        let mut value = new_form();
        value["objects"][0]["position"][4]["x"] = json!(1e300);
        let imported = imported(&value);
        assert!(imported.scenes.is_empty());
        assert!(imported.left_out[imported.left_out.len() - 1].reason.contains("samples_are_finite"));
    }
}
