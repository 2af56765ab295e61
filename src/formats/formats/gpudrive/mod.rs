//! GPUDrive, PufferDrive and Nocturne JSON, both generations. The newer one names ids and the self-driving car and
//! has radians; the older one has neither, and headings in degrees that may run over a full turn.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;
use serde_json::value::RawValue;

use super::centreline::Across;
use super::conventions::Conventions;
use super::derived::kind_named;
use super::import_error::{ImportError, shown};
use super::imported::Imported;
use super::json_numbers::{flags, number, numbers, without_nan};
use super::log::{Log, LogLane, LogLight, LogTrack};
use super::scenarionet::read::finish;
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

/// Its lists as they stand in the file: each element is read by itself, so that a bad one is left out alone.
#[derive(Deserialize)]
struct File<'f> {
    name: Option<String>,
    scenario_id: Option<String>,
    #[serde(borrow)]
    objects: Vec<&'f RawValue>,
    #[serde(borrow)]
    roads: Vec<&'f RawValue>,
    #[serde(borrow, default)]
    tl_states: BTreeMap<String, &'f RawValue>,
    #[serde(borrow)]
    metadata: Option<&'f RawValue>,
}

#[derive(Default, Deserialize)]
struct Metadata {
    sdc_track_index: Option<i64>,
    #[serde(default)]
    objects_of_interest: Vec<serde_json::Value>,
}

/// A place; a coordinate that is no number is NaN.
#[derive(Clone, Copy, Deserialize)]
struct Point {
    #[serde(deserialize_with = "number")]
    x: f64,
    #[serde(deserialize_with = "number")]
    y: f64,
    #[serde(default = "unknown", deserialize_with = "number")]
    z: f64,
}

fn unknown() -> f64 {
    f64::NAN
}

impl From<Point> for Vec2 {
    fn from(p: Point) -> Vec2 {
        Vec2::new(p.x, p.y)
    }
}

fn place(point: Option<&Option<Point>>) -> Vec2 {
    point.copied().flatten().map_or(Vec2::new(f64::NAN, f64::NAN), Vec2::from)
}

#[derive(Deserialize)]
struct Object {
    id: Option<i64>,
    position: Vec<Option<Point>>,
    #[serde(default)]
    velocity: Option<Vec<Option<Point>>>,
    #[serde(default, deserialize_with = "numbers")]
    heading: Vec<f64>,
    #[serde(deserialize_with = "flags")]
    valid: Vec<bool>,
    #[serde(default, deserialize_with = "number")]
    length: f64,
    #[serde(default, deserialize_with = "number")]
    width: f64,
    #[serde(default, rename = "type")]
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
    Line(Vec<Option<Point>>),
    Place(Point),
}

impl Geometry {
    fn points(&self) -> Vec<Vec2> {
        match self {
            Geometry::Line(points) => points.iter().map(|p| place(Some(p))).collect(),
            Geometry::Place(point) => vec![Vec2::from(*point)],
        }
    }
}

#[derive(Deserialize)]
struct Light {
    #[serde(default)]
    state: Vec<Option<State>>,
    #[serde(default, deserialize_with = "numbers")]
    x: Vec<f64>,
    #[serde(default, deserialize_with = "numbers")]
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

/// The scene in a JSON file. Objects, roads and lights that cannot be read are left out.
///
/// # Errors The text is not JSON of this schema, the ego's samples have unequal counts, or no vehicle can be the ego.
pub fn import(file_name: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    import_as(file_name, bytes, Conventions::default())
}

/// [`import`] with fields read in these conventions.
///
/// # Errors
/// As [`import`].
pub fn import_as(file_name: &str, bytes: &[u8], conventions: Conventions) -> Result<Imported, ImportError> {
    if bytes.len() > BYTES_MAX {
        return Err(ImportError::new(file_name, "byte 0", "at most 128 MiB of JSON", "split the file"));
    }
    let bytes = without_nan(bytes);
    let remedy = "write the file again or leave it out";
    let file: File<'_> = serde_json::from_slice(&bytes).map_err(|error| {
        let place = format!("line {}, column {}", error.line(), error.column());
        ImportError::new(file_name, place, format!("GPUDrive or Nocturne JSON ({error})"), remedy)
    })?;
    let mut imported = Imported::default();
    let is_new = file.metadata.is_some() || file.scenario_id.is_some();
    // Without its mark the ego would be another one.
    let metadata =
        file.metadata.map(|raw| part::<Metadata>(file_name, "metadata", raw)).transpose()?.unwrap_or_default();
    let marked = metadata.sdc_track_index.map(|ix| usize::try_from(ix).unwrap_or(usize::MAX));
    let (tracks, chosen) = tracks(file_name, &file, marked, is_new, &mut imported)?;
    let steps = tracks.first().map_or(0, |track| track.samples.len());
    if file.tl_states.len().saturating_mul(steps) > LIGHT_STATES_MAX {
        let expected = format!("at most {LIGHT_STATES_MAX} states of lights");
        return Err(ImportError::new(file_name, "tl_states", expected, remedy));
    }
    let names = [&file.scenario_id, &file.name].into_iter().flatten().find(|name| !name.trim().is_empty());
    let stem = file_name.split('.').next().unwrap_or(file_name);
    let id = names.map_or(stem, |name| name.strip_suffix(".json").unwrap_or(name)).to_string();
    let ego = chosen.ok_or_else(|| {
        let expected = "the index of an object as sdc_track_index, or a vehicle observed at step 10";
        ImportError::new(file_name, "objects", expected, "no ego can be chosen; leave the file out")
    })?;
    let mut log = Log {
        id,
        origin: Origin { format: if is_new { "gpudrive" } else { "nocturne" }.into(), name: file_name.into() },
        times_s: (0..steps).map(|k| k as f64 * DT_S).collect(),
        current: CURRENT.min(steps.saturating_sub(1)),
        tracks,
        ego,
        objects_of_interest: metadata.objects_of_interest.iter().map(serde_json::Value::to_string).collect(),
        ..Log::default()
    };
    roads(file_name, &file.roads, &mut log, &mut imported);
    log.lights = signals(file_name, &file.tl_states, &log, steps, &mut imported);
    let chosen = log.tracks[ego].id.clone();
    finish(file_name, log, conventions, &mut imported);
    if marked.is_none() {
        let reason =
            "the file marks no ego; taken is the vehicle observed for most steps, of equals the farthest driven";
        imported.leave_out(file_name, || (format!("mark of the ego (object {chosen} chosen)"), reason.into()));
    }
    Ok(imported)
}

/// An element of a list.
fn part<'f, T: Deserialize<'f>>(file_name: &str, place: &str, raw: &'f RawValue) -> Result<T, ImportError> {
    serde_json::from_str(raw.get()).map_err(|error| {
        let expected = format!("an element of GPUDrive or Nocturne JSON ({})", shown(&error.to_string()));
        ImportError::new(file_name, place, expected, "write the file again or leave it out")
    })
}

/// The road users that can be read, and which of them is the ego: the marked one, which must be readable, or a likely one.
fn tracks(
    file_name: &str,
    file: &File<'_>,
    marked: Option<usize>,
    is_new: bool,
    imported: &mut Imported,
) -> Result<(Vec<LogTrack>, Option<usize>), ImportError> {
    let refuse = |place: String, expected: String| {
        ImportError::new(file_name, place, expected, "write the file again or leave it out")
    };
    if file.objects.is_empty() {
        return Err(refuse("objects".into(), "at least one object".into()));
    }
    let read = |(ix, raw): (usize, &&RawValue)| part::<Object>(file_name, &format!("objects[{ix}]"), raw);
    let objects: Vec<Result<Object, ImportError>> =
        file.objects.iter().enumerate().map(|(ix, raw)| read((ix, raw))).collect();
    // The ego says how many samples there are, or else most of the others do.
    let counts = objects.iter().flatten().map(|object| object.valid.len());
    let ego = marked.and_then(|ix| objects.get(ix)).and_then(|object| object.as_ref().ok());
    let steps = ego.map(|object| object.valid.len()).or(usual(counts)).unwrap_or(0);
    if !(2..=STEPS_MAX).contains(&steps) {
        return Err(refuse("objects, valid".into(), format!("2 to 1200 samples, found {steps}")));
    }
    if objects.len().saturating_mul(steps) > LIGHT_STATES_MAX {
        return Err(refuse("objects".into(), format!("at most {LIGHT_STATES_MAX} samples")));
    }
    let (mut tracks, mut chosen) = (Vec::with_capacity(objects.len()), None);
    for (ix, object) in objects.into_iter().enumerate() {
        match object.and_then(|object| whole(file_name, ix, object, steps)) {
            Ok(object) => {
                chosen = if marked == Some(ix) { Some(tracks.len()) } else { chosen };
                tracks.push(track(ix, &object, is_new));
            }
            Err(error) if marked == Some(ix) => return Err(error),
            Err(error) => imported.leave_out_for(format!("object {ix}"), &error, "the other objects are kept"),
        }
    }
    let chosen = if marked.is_some() { chosen } else { likely_ego(&tracks) };
    Ok((tracks, chosen))
}

/// The number that comes most often; of equals the greatest.
fn usual(counts: impl Iterator<Item = usize>) -> Option<usize> {
    let mut often: BTreeMap<usize, usize> = BTreeMap::new();
    counts.for_each(|count| *often.entry(count).or_default() += 1);
    often.into_iter().max_by_key(|(count, times)| (*times, *count)).map(|(count, _)| count)
}

/// An object with as many values as there are steps. Velocities and headings may be missing as a whole.
fn whole(file_name: &str, ix: usize, object: Object, steps: usize) -> Result<Object, ImportError> {
    let or_none = |count: usize| if count == 0 { steps } else { count };
    let velocity = or_none(object.velocity.as_ref().map_or(0, Vec::len));
    let counts = [object.valid.len(), object.position.len(), or_none(object.heading.len()), velocity];
    if counts.iter().all(|&n| n == steps) {
        return Ok(object);
    }
    let expected = format!("{steps} samples of valid, position, heading, velocity, found {counts:?}");
    let remedy = "write the file again or leave it out";
    Err(ImportError::new(file_name, format!("objects[{ix}]"), expected, remedy))
}

fn track(ix: usize, object: &Object, is_new: bool) -> LogTrack {
    let unit = if is_new { 1.0 } else { num::PI / 180.0 };
    let sample = |k: usize| {
        let position = place(object.position.get(k));
        let observed = object.valid[k] && position.x != NOT_OBSERVED && position.y != NOT_OBSERVED;
        observed.then(|| Sample {
            position,
            heading_rad: object.heading.get(k).map_or(f64::NAN, |heading| heading * unit),
            velocity: place(object.velocity.as_ref().and_then(|velocity| velocity.get(k))),
        })
    };
    LogTrack {
        id: object.id.map_or_else(|| format!("object{ix}"), |id| id.to_string()),
        kind: kind_named(&object.kind).ok_or_else(|| object.kind.clone()),
        length_m: object.length,
        width_m: object.width,
        samples: (0..object.valid.len()).map(sample).collect(),
        heights_m: object.position.iter().map(|point| point.map_or(f64::NAN, |point| point.z)).collect(),
    }
}

/// If no ego is marked: the vehicle observed at "now" that is observed for most steps; among equals the one that drives
/// farthest, then the first.
fn likely_ego(tracks: &[LogTrack]) -> Option<usize> {
    let mut best: Option<(usize, f64, usize)> = None;
    for (ix, track) in tracks.iter().enumerate() {
        let now = CURRENT.min(track.samples.len().saturating_sub(1));
        if track.kind != Ok(AgentKind::Vehicle) || track.samples.get(now).is_none_or(Option::is_none) {
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

fn roads(file_name: &str, roads: &[&RawValue], log: &mut Log, imported: &mut Imported) {
    for (ix, raw) in roads.iter().enumerate() {
        let what = format!("road {ix}");
        let read = part::<Road>(file_name, &format!("roads[{ix}]"), raw);
        let Some(road) = imported.read(&what, read, "the other roads are kept") else { continue };
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

fn signals(
    file_name: &str,
    given: &BTreeMap<String, &RawValue>,
    log: &Log,
    steps: usize,
    imported: &mut Imported,
) -> Vec<LogLight> {
    let ids: BTreeSet<&str> = log.lanes.iter().map(|lane| lane.id.as_str()).collect();
    let points: usize = log.lanes.iter().map(|lane| lane.points.len()).sum();
    // A far too large file gets no search by place.
    let searched = given.len().saturating_mul(points) <= SEARCH_MAX;
    let mut lights = Vec::with_capacity(given.len().min(10_000));
    for (id, raw) in given {
        let read = part::<Light>(file_name, &format!("tl_states {}", shown(id)), raw);
        let what = format!("light {}", shown(id));
        let Some(light) = imported.read(&what, read, "the other lights are kept") else { continue };
        let place = light.x.first().zip(light.y.first()).map(|(x, y)| Vec2::new(*x, *y)).filter(|p| p.is_finite());
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
        assert!(refusal(&format!("{{\"roads\":[{{\"geometry\":{deep}")).contains("EOF"));
        assert!(refusal("{\"objects\": [], \"roads\": []}").contains("at least one object"));
        assert!(refusal("{\"objects\": [], \"roads\": NaN}").contains("column"));
        let mut value = new_form();
        value["objects"][1]["heading"] = json!([1.0]);
        assert!(refusal(&value.to_string()).contains("objects[1]"), "the ego");
        let mut value = new_form();
        value["metadata"]["sdc_track_index"] = json!(-1);
        assert!(refusal(&value.to_string()).contains("sdc_track_index"));
        let whole = new_form().to_string();
        for end in (0..whole.len()).step_by(977) {
            assert!(import("cut.json", &whole.as_bytes()[..end]).is_err(), "{end}");
        }
    }

    #[test]
    fn a_far_off_sample_is_left_out_alone() {
        let mut value = new_form();
        value["objects"][0]["position"][4]["x"] = json!(1e300);
        let imported = imported(&value);
        let track = &imported.scenes[0].tracks[0];
        assert_eq!((track.at(3).is_some(), track.at(4).is_some(), track.at(5).is_some()), (true, false, true));
        assert!(imported.left_out.iter().any(|left| left.what == "1 samples of track 7"), "{:?}", imported.left_out);
    }
}
