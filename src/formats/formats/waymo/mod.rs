//! Waymo Open Motion: `Scenario` messages in TFRecord files. The messages below hold the part of the published schema
//! that a scene needs; lidar, camera tokens and painted lines are ignored.

pub mod tfrecord;

use std::collections::BTreeMap;

use prost::Message;

use self::tfrecord::Records;
use super::centreline::{Across, thinned};
use super::conventions::Conventions;
use super::gpudrive::waymo_light_state;
use super::import_error::ImportError;
use super::imported::Imported;
use super::log::{Log, LogLane, LogLight, LogTrack};
use super::scenarionet::read::finish;
use crate::kernel::{Vec2, num};
use crate::scene::validate::STEPS_MAX;
use crate::scene::{AgentKind, LaneKind, LightState, Origin, Sample, Scene};

/// Most bytes of a record. Published records have up to 4 MiB without their lidar.
const RECORD_BYTES_MAX: usize = 16 << 20;
/// Most parts of a record by field: tracks, light states over time, map features. Two bytes in the file can become 200
/// bytes in memory.
const PARTS_MAX: [(u64, usize, &str); 3] =
    [(2, 20_000, "tracks"), (7, STEPS_MAX, "dynamic_map_states"), (8, 50_000, "map_features")];
/// Most light states of a record.
const LIGHT_STATES_MAX: usize = 4_000_000;
/// Most samples, light states and map points of all records of a file together; a published file has a tenth.
const FILE_PARTS_MAX: usize = 32_000_000;
/// Smallest amount that a record, track or light counts against that limit, however little it holds.
const PART_MIN: usize = 16;
/// Most lanes that one element names.
const LINKS_MAX: usize = 64;
/// Most distances from lane points to border points that are computed for one scenario; beyond it widths stay unknown.
const WIDTH_EFFORT_MAX: usize = 100_000_000;
const MPH_IN_MPS: f64 = 0.44704;

/// `Scenario` of the Waymo Open Motion Dataset.
#[derive(Clone, PartialEq, Message)]
pub struct Scenario {
    #[prost(double, repeated, tag = "1")]
    timestamps_seconds: Vec<f64>,
    #[prost(message, repeated, tag = "2")]
    pub(super) tracks: Vec<Track>,
    #[prost(int32, repeated, packed = "false", tag = "4")]
    objects_of_interest: Vec<i32>,
    #[prost(string, tag = "5")]
    scenario_id: String,
    #[prost(int32, tag = "6")]
    pub(super) sdc_track_index: i32,
    #[prost(message, repeated, tag = "7")]
    pub(super) dynamic_map_states: Vec<DynamicMapState>,
    #[prost(message, repeated, tag = "8")]
    pub(super) map_features: Vec<MapFeature>,
    #[prost(int32, tag = "10")]
    current_time_index: i32,
}

/// `Track`: one road user.
#[derive(Clone, PartialEq, Message)]
pub struct Track {
    #[prost(int32, tag = "1")]
    id: i32,
    /// unset, vehicle, pedestrian, cyclist, other
    #[prost(int32, tag = "2")]
    object_type: i32,
    #[prost(message, repeated, tag = "3")]
    pub(super) states: Vec<ObjectState>,
}

/// `ObjectState`: one road user at one step.
#[derive(Clone, PartialEq, Message)]
pub struct ObjectState {
    #[prost(double, tag = "2")]
    pub(super) center_x: f64,
    #[prost(double, tag = "3")]
    center_y: f64,
    #[prost(double, optional, tag = "4")]
    pub(super) center_z: Option<f64>,
    #[prost(float, tag = "5")]
    length: f32,
    #[prost(float, tag = "6")]
    width: f32,
    #[prost(float, tag = "8")]
    heading: f32,
    #[prost(float, optional, tag = "9")]
    velocity_x: Option<f32>,
    #[prost(float, optional, tag = "10")]
    velocity_y: Option<f32>,
    #[prost(bool, tag = "11")]
    valid: bool,
}

/// `DynamicMapState`: all signals at one step.
#[derive(Clone, PartialEq, Message)]
pub struct DynamicMapState {
    #[prost(message, repeated, tag = "1")]
    pub(super) lane_states: Vec<LaneState>,
}

/// `TrafficSignalLaneState`: one lane's signal at one step.
#[derive(Clone, PartialEq, Message)]
pub struct LaneState {
    #[prost(int64, tag = "1")]
    lane: i64,
    #[prost(int32, tag = "2")]
    state: i32,
    #[prost(message, optional, tag = "3")]
    stop_point: Option<MapPoint>,
}

/// `MapPoint`, metres.
#[derive(Clone, PartialEq, Message)]
pub struct MapPoint {
    #[prost(double, tag = "1")]
    pub(super) x: f64,
    #[prost(double, tag = "2")]
    y: f64,
}

/// At most one of the parts is there.
#[derive(Clone, PartialEq, Message)]
pub struct MapFeature {
    #[prost(int64, tag = "1")]
    id: i64,
    #[prost(message, optional, boxed, tag = "3")]
    pub(super) lane: Option<Box<LaneCenter>>,
    #[prost(message, optional, tag = "4")]
    road_line: Option<Line>,
    #[prost(message, optional, tag = "5")]
    road_edge: Option<Line>,
    #[prost(message, optional, tag = "7")]
    stop_sign: Option<StopSign>,
    #[prost(message, optional, tag = "8")]
    crosswalk: Option<Area>,
}

/// A feature that is a line.
#[derive(Clone, PartialEq, Message)]
pub struct Line {
    #[prost(message, repeated, tag = "2")]
    polyline: Vec<MapPoint>,
}

/// A feature that is an outline.
#[derive(Clone, PartialEq, Message)]
pub struct Area {
    #[prost(message, repeated, tag = "1")]
    polygon: Vec<MapPoint>,
}

/// `StopSign`.
#[derive(Clone, PartialEq, Message)]
pub struct StopSign {
    #[prost(int64, repeated, packed = "false", tag = "1")]
    lane: Vec<i64>,
    #[prost(message, optional, tag = "2")]
    position: Option<MapPoint>,
}

/// `LaneCenter`: a lane by its centre line.
#[derive(Clone, PartialEq, Message)]
pub struct LaneCenter {
    #[prost(double, tag = "1")]
    speed_limit_mph: f64,
    /// undefined, freeway, street, bike
    #[prost(int32, tag = "2")]
    kind: i32,
    #[prost(message, repeated, tag = "8")]
    pub(super) polyline: Vec<MapPoint>,
    #[prost(int64, repeated, tag = "9")]
    entry_lanes: Vec<i64>,
    #[prost(int64, repeated, tag = "10")]
    pub(super) exit_lanes: Vec<i64>,
    #[prost(message, repeated, tag = "11")]
    left_neighbors: Vec<LaneNeighbor>,
    #[prost(message, repeated, tag = "12")]
    right_neighbors: Vec<LaneNeighbor>,
    #[prost(message, repeated, tag = "13")]
    left_boundaries: Vec<BoundarySegment>,
    #[prost(message, repeated, tag = "14")]
    right_boundaries: Vec<BoundarySegment>,
}

/// `LaneNeighbor`.
#[derive(Clone, PartialEq, Message)]
pub struct LaneNeighbor {
    #[prost(int64, tag = "1")]
    feature_id: i64,
    #[prost(int32, tag = "2")]
    self_start_index: i32,
    #[prost(int32, tag = "3")]
    self_end_index: i32,
}

/// `BoundarySegment`: a stretch of a lane's border.
#[derive(Clone, PartialEq, Message)]
pub struct BoundarySegment {
    #[prost(int32, tag = "1")]
    lane_start_index: i32,
    #[prost(int32, tag = "2")]
    lane_end_index: i32,
    #[prost(int64, tag = "3")]
    boundary_feature_id: i64,
}

/// Returns all scenarios of a record file. A record that is not a valid scenario is left out. Where the file's structure is
/// damaged, reading ends, and the records before are kept.
///
/// # Errors
/// The first record is already damaged, or there is none.
pub fn import(file_name: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    import_as(file_name, bytes, Conventions::default())
}

/// Does the same as [`import`] with fields read in these conventions.
///
/// # Errors
/// As [`import`].
pub fn import_as(file_name: &str, bytes: &[u8], conventions: Conventions) -> Result<Imported, ImportError> {
    if bytes.is_empty() {
        return Err(ImportError::new(file_name, "byte 0", "a record", "the file is empty; fetch it again"));
    }
    read(file_name, bytes, conventions, FILE_PARTS_MAX)
}

fn read(file_name: &str, bytes: &[u8], conventions: Conventions, parts_max: usize) -> Result<Imported, ImportError> {
    let mut imported = Imported::default();
    let mut parts = 0usize;
    for (index, record) in Records::of(file_name, bytes).enumerate() {
        if parts > parts_max {
            imported.leave_out(file_name, || {
                let reason = format!(
                    "it and what follows: expected at most {parts_max} samples, light states and map points in the \
                     records of a file; split the file"
                );
                (format!("record {index}"), reason)
            });
            break;
        }
        parts = parts.saturating_add(PART_MIN);
        let data = match record {
            Err(error) if index == 0 => return Err(error),
            record => record,
        };
        if index == 0 && data.as_ref().is_ok_and(|data| is_tf_example(data)) {
            let expected = "a Scenario message, found a tf.Example: the older form of the same data set";
            let remedy = "fetch the files of its folder `scenario` in place of `tf_example`, which has no whole lanes";
            return Err(ImportError::new(file_name, "record 0", expected, remedy));
        }
        let mut one = Imported::default();
        match data.and_then(|data| scenario(file_name, index, data, &mut one)) {
            Ok(log) => {
                let (steps, things) = (log.times_s.len(), log.tracks.len() + log.lights.len());
                finish(file_name, log, conventions, &mut one);
                parts = parts.saturating_add(one.scenes.iter().map(map_points).sum());
                let steps = one.scenes.iter().map(|scene| scene.steps).fold(steps.max(PART_MIN), usize::max);
                parts = parts.saturating_add(steps.saturating_mul(things));
            }
            Err(error) => one.leave_out_for(format!("record {index}"), &error, "the other records are kept"),
        }
        imported.absorb(one);
    }
    Ok(imported)
}

/// Returns `true` if a record is of Waymo's older form, a map from names of features to lists.
fn is_tf_example(data: &[u8]) -> bool {
    const NAMES: [&[u8]; 3] = [b"roadgraph_samples/", b"state/current/", b"scenario/id"];
    data.first() == Some(&0x0a) && NAMES.iter().any(|name| data.windows(name.len()).any(|window| window == *name))
}

fn map_points(scene: &Scene) -> usize {
    let road = &scene.road;
    let lines = road.edges.iter().chain(&scene.crosswalks);
    lines.map(Vec::len).sum::<usize>() + road.lanes.iter().map(|lane| 3 * lane.centre.len()).sum::<usize>()
}

fn scenario(file: &str, index: usize, data: &[u8], imported: &mut Imported) -> Result<Log, ImportError> {
    let refuse = |place: String, expected: String| {
        ImportError::new(file, format!("record {index}{place}"), expected, "fetch the file again or leave it out")
    };
    if data.len() > RECORD_BYTES_MAX {
        return Err(refuse(String::new(), "at most 16 MiB".into()));
    }
    for (field, most, name) in PARTS_MAX {
        let whole = "a Scenario message, whole to its end and without groups";
        let count = count_of(data, field).ok_or_else(|| refuse(String::new(), whole.into()))?;
        if count > most {
            return Err(refuse(format!(", {name}"), format!("at most {most}, found {count}")));
        }
    }
    let message = Scenario::decode(data).map_err(|e| refuse(String::new(), format!("a Scenario message ({e})")))?;
    let steps = message.timestamps_seconds.len();
    if !(2..=STEPS_MAX).contains(&steps) {
        return Err(refuse(", timestamps_seconds".into(), format!("2 to 1200 samples, found {steps}")));
    }
    let ego = usize::try_from(message.sdc_track_index).ok().and_then(|ix| message.tracks.get(ix));
    let ego = ego.ok_or_else(|| refuse(", sdc_track_index".into(), "the index of a track".into()))?;
    let (mut tracks, mut ego_at) = (Vec::with_capacity(message.tracks.len()), 0);
    for (k, given) in message.tracks.iter().enumerate() {
        if given.states.len() == steps {
            ego_at = if std::ptr::eq(given, ego) { tracks.len() } else { ego_at };
            tracks.push(track(given));
            continue;
        }
        let expected = format!("{steps} states, found {}", given.states.len());
        let error = refuse(format!(", tracks[{k}] {}", given.id), expected);
        if std::ptr::eq(given, ego) {
            return Err(error);
        }
        imported.leave_out_for(format!("track {}", given.id), &error, "the other tracks are kept");
    }
    let current = usize::try_from(message.current_time_index).ok().filter(|&ix| ix < steps);
    let current = current.ok_or_else(|| refuse(", current_time_index".into(), "the index of a sample".into()))?;
    let mut log = Log {
        id: message.scenario_id.clone(),
        origin: Origin { format: "waymo-motion".into(), name: file.into() },
        times_s: message.timestamps_seconds.clone(),
        current,
        tracks,
        ego: ego_at,
        objects_of_interest: message.objects_of_interest.iter().take(LINKS_MAX).map(i32::to_string).collect(),
        lights: lights(&message.dynamic_map_states, steps)
            .map_err(|expected| refuse(", dynamic_map_states".into(), expected))?,
        ..Log::default()
    };
    features(&message.map_features, &mut log);
    Ok(log)
}

/// Returns how often a field of length-delimited content occurs in a message. `None` if the message is malformed or has a
/// group, which no published message has.
fn count_of(message: &[u8], wanted: u64) -> Option<usize> {
    let mut rest = message;
    let mut count = 0;
    while !rest.is_empty() {
        let key = prost::encoding::decode_varint(&mut rest).ok()?;
        let length = match key & 7 {
            0 => prost::encoding::decode_varint(&mut rest).map(|_| 0),
            1 => Ok(8),
            2 => prost::encoding::decode_varint(&mut rest),
            5 => Ok(4),
            _ => return None,
        };
        count += usize::from(key == (wanted << 3 | 2));
        rest = length.ok().and_then(|n| usize::try_from(n).ok()).and_then(|n| rest.get(n..))?;
    }
    Some(count)
}

fn track(track: &Track) -> LogTrack {
    let number = |given: Option<f32>| given.map_or(f64::NAN, f64::from);
    let sample = |state: &ObjectState| {
        state.valid.then(|| Sample {
            position: Vec2::new(state.center_x, state.center_y),
            heading_rad: f64::from(state.heading),
            velocity: Vec2::new(number(state.velocity_x), number(state.velocity_y)),
        })
    };
    let median = |side: fn(&ObjectState) -> f32| {
        let observed = track.states.iter().filter(|state| state.valid).map(|state| f64::from(side(state)));
        let sizes: Vec<f64> = observed.filter(|size| size.is_finite() && *size > 0.0).collect();
        num::quantile(&sizes, 0.5).unwrap_or(0.0)
    };
    LogTrack {
        id: track.id.to_string(),
        kind: match track.object_type {
            1 => Ok(AgentKind::Vehicle),
            2 => Ok(AgentKind::Pedestrian),
            3 => Ok(AgentKind::Cyclist),
            4 => Err("TYPE_OTHER".into()),
            other => Err(format!("object_type {other}")),
        },
        length_m: median(|state| state.length),
        width_m: median(|state| state.width),
        samples: track.states.iter().map(sample).collect(),
        heights_m: track.states.iter().map(|state| state.center_z.unwrap_or(f64::NAN)).collect(),
    }
}

/// Reads the lights. The error says what was expected.
fn lights(given: &[DynamicMapState], steps: usize) -> Result<Vec<LogLight>, String> {
    let mut lights: BTreeMap<i64, LogLight> = BTreeMap::new();
    for (step, state) in given.iter().take(steps).enumerate() {
        for lane in &state.lane_states {
            let light = lights.entry(lane.lane).or_insert_with(|| LogLight {
                lane: lane.lane.to_string(),
                stop_point: None,
                states: vec![],
            });
            light.stop_point = light.stop_point.or(lane.stop_point.as_ref().map(place));
            light.states.resize(step, LightState::Unknown);
            light.states.push(waymo_light_state(i64::from(lane.state)));
            if lights.len().saturating_mul(steps) > LIGHT_STATES_MAX {
                return Err("at most 4 million states of lights".into());
            }
        }
    }
    Ok(lights.into_values().collect())
}

fn place(point: &MapPoint) -> Vec2 {
    Vec2::new(point.x, point.y)
}

fn line(points: &[MapPoint]) -> Vec<Vec2> {
    points.iter().map(place).collect()
}

fn features(given: &[MapFeature], log: &mut Log) {
    let borders: BTreeMap<i64, &[MapPoint]> = given
        .iter()
        .filter_map(|f| Some((f.id, f.road_line.as_ref().or(f.road_edge.as_ref())?.polyline.as_slice())))
        .collect();
    let mut effort = WIDTH_EFFORT_MAX;
    for feature in given {
        if let Some(given) = &feature.lane {
            log.lanes.push(lane(feature.id, given, &borders, &mut effort));
        }
        log.edges.extend(feature.road_edge.as_ref().map(|edge| line(&edge.polyline)));
        log.crosswalks.extend(feature.crosswalk.as_ref().map(|area| line(&area.polygon)));
        if let Some((sign, position)) = feature.stop_sign.as_ref().and_then(|s| Some((s, s.position.as_ref()?))) {
            log.stop_signs.push((place(position), sign.lane.iter().take(LINKS_MAX).map(i64::to_string).collect()));
        }
    }
}

fn lane(id: i64, lane: &LaneCenter, borders: &BTreeMap<i64, &[MapPoint]>, effort: &mut usize) -> LogLane {
    let ids = |ids: &[i64]| ids.iter().take(LINKS_MAX).map(i64::to_string).collect();
    let limit = lane.speed_limit_mph * MPH_IN_MPS;
    LogLane {
        id: id.to_string(),
        kind: match lane.kind {
            1 => LaneKind::Freeway,
            3 => LaneKind::Bike,
            _ => LaneKind::Street,
        },
        points: across(lane, borders, effort),
        entries: ids(&lane.entry_lanes),
        exits: ids(&lane.exit_lanes),
        left: beside(&lane.left_neighbors),
        right: beside(&lane.right_neighbors),
        speed_limit_mps: (limit > 0.0 && limit <= 100.0).then_some(limit),
    }
}

/// Returns the neighbours of a side, the one that is beside the lane for the longest way first.
fn beside(neighbours: &[LaneNeighbor]) -> Vec<String> {
    let mut side: Vec<&LaneNeighbor> = neighbours.iter().take(LINKS_MAX).collect();
    side.sort_by_key(|n| std::cmp::Reverse(i64::from(n.self_end_index) - i64::from(n.self_start_index)));
    side.into_iter().map(|n| n.feature_id.to_string()).collect()
}

/// Returns the thinned centre line with the distance to the border features that the lane names for each stretch. If a point is
/// no place, nothing is thinned: the point is left out later.
fn across(lane: &LaneCenter, borders: &BTreeMap<i64, &[MapPoint]>, effort: &mut usize) -> Vec<Across> {
    let plain: Vec<Across> = lane.polyline.iter().map(|p| Across::new(place(p), 0.0, 0.0)).collect();
    let whole = plain.iter().all(|p| p.centre.is_finite());
    let thin = if whole { thinned(&plain) } else { plain.clone() };
    let mut from = 0;
    thin.iter()
        .map(|point| {
            // Thinned points have the same order as in the original, whose indices the borders refer to.
            let index = from + plain[from..].iter().position(|p| p.centre == point.centre).unwrap_or(0);
            from = if whole { index } else { index + 1 };
            let mut to_border = |segments: &[BoundarySegment]| {
                let index = i64::try_from(index).unwrap_or(i64::MAX);
                let here = |s: &&BoundarySegment| {
                    i64::from(s.lane_start_index) <= index && index <= i64::from(s.lane_end_index)
                };
                let segment = segments.iter().find(here)?;
                let border = borders.get(&segment.boundary_feature_id)?;
                *effort = effort.checked_sub(border.len() + segments.len())?;
                distance(point.centre, border)
            };
            let left = to_border(&lane.left_boundaries).unwrap_or(0.0);
            let right = to_border(&lane.right_boundaries).unwrap_or(0.0);
            Across::new(point.centre, left, right)
        })
        .collect()
}

fn distance(point: Vec2, line: &[MapPoint]) -> Option<f64> {
    let to_piece = |w: &[MapPoint]| {
        let (a, b) = (place(&w[0]), place(&w[1]));
        let along = b - a;
        let length = along.norm_squared();
        let share = if length > 0.0 { ((point - a).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
        point.distance(a.lerp(b, share))
    };
    line.windows(2).map(to_piece).min_by(f64::total_cmp)
}

#[cfg(test)]
pub(super) mod tests {
    use super::tfrecord::written;
    use super::*;
    use crate::formats::log::SampleTimes;

    fn read(file_name: &str, bytes: &[u8], parts_max: usize) -> Result<Imported, ImportError> {
        super::read(file_name, bytes, Conventions::default(), parts_max)
    }

    fn points(from: (f64, f64), to: (f64, f64)) -> Vec<MapPoint> {
        let at = |k: usize, a: f64, b: f64| a + (b - a) * k as f64 / 100.0;
        (0..=100).map(|k| MapPoint { x: at(k, from.0, to.0), y: at(k, from.1, to.1) }).collect()
    }

    fn driver(id: i32, object_type: i32, from: (f64, f64), velocity: (f64, f64)) -> Track {
        let state = |k: usize| ObjectState {
            center_x: from.0 + velocity.0 * 0.1 * k as f64,
            center_y: from.1 + velocity.1 * 0.1 * k as f64,
            center_z: Some(12.0),
            length: 4.7,
            width: 2.0,
            heading: num::atan2(velocity.1, velocity.0) as f32,
            velocity_x: Some(velocity.0 as f32),
            velocity_y: Some(velocity.1 as f32),
            valid: id != 3 || k > 20,
        };
        Track { id, object_type, states: (0..91).map(state).collect() }
    }

    pub fn light_at(lane: i64) -> LaneState {
        LaneState { lane, state: 4, stop_point: None }
    }

    /// Makes a car crossing the path of another, and a pedestrian.
    pub fn message() -> Scenario {
        let border = |lane_start_index, lane_end_index, boundary_feature_id| BoundarySegment {
            lane_start_index,
            lane_end_index,
            boundary_feature_id,
        };
        let lane = LaneCenter {
            speed_limit_mph: 35.0,
            kind: 2,
            polyline: points((7000.0, 100.0), (7100.0, 100.0)),
            exit_lanes: vec![11, 999],
            right_boundaries: vec![border(0, 100, 20)],
            right_neighbors: vec![
                LaneNeighbor { feature_id: 999, self_start_index: 0, self_end_index: 4 },
                LaneNeighbor { feature_id: 11, self_start_index: 0, self_end_index: 3 },
                LaneNeighbor { feature_id: 12, self_start_index: 4, self_end_index: 90 },
            ],
            ..LaneCenter::default()
        };
        let onward =
            LaneCenter { polyline: points((7100.0, 100.0), (7200.0, 100.0)), kind: 1, ..LaneCenter::default() };
        let beside = LaneCenter { polyline: points((7000.0, 96.0), (7100.0, 96.0)), kind: 2, ..LaneCenter::default() };
        let feature = |id, lane| MapFeature { id, lane: Some(Box::new(lane)), ..MapFeature::default() };
        let edge = Line { polyline: points((6990.0, 98.5), (7210.0, 98.5)) };
        let sign = StopSign { lane: vec![10], position: Some(MapPoint { x: 7099.0, y: 97.0 }) };
        let lights = |k: usize| LaneState {
            lane: 10,
            state: if k < 30 { 4 } else { 3 },
            stop_point: Some(MapPoint { x: 7098.0, y: 100.0 }),
        };
        Scenario {
            timestamps_seconds: (0..91).map(|k| 0.1 * f64::from(k)).collect(),
            tracks: vec![
                driver(1, 1, (7030.0, 100.0), (9.0, 0.0)),
                driver(2, 1, (7000.0, 100.0), (10.0, 0.0)),
                driver(3, 2, (7060.0, 90.0), (0.0, 1.0)),
            ],
            objects_of_interest: vec![2, 1],
            scenario_id: "f00d".into(),
            sdc_track_index: 1,
            current_time_index: 10,
            dynamic_map_states: (5..96).map(|k| DynamicMapState { lane_states: vec![lights(k - 5)] }).collect(),
            map_features: vec![
                feature(10, lane),
                feature(11, onward),
                feature(12, beside),
                MapFeature { id: 20, road_edge: Some(edge), ..MapFeature::default() },
                MapFeature { id: 21, stop_sign: Some(sign), ..MapFeature::default() },
            ],
        }
    }

    /// Makes the record of a scene.
    pub fn message_of(scene: &Scene) -> Scenario {
        let state = |track: &crate::scene::Track, sample: Option<&Sample>| {
            let Sample { position, heading_rad, velocity } = sample.copied().unwrap_or_default();
            ObjectState {
                center_x: position.x,
                center_y: position.y,
                center_z: Some(0.0),
                length: track.length_m as f32,
                width: track.width_m as f32,
                heading: heading_rad as f32,
                velocity_x: Some(velocity.x as f32),
                velocity_y: Some(velocity.y as f32),
                valid: sample.is_some(),
            }
        };
        let track = |(id, track): (usize, &crate::scene::Track)| Track {
            id: id as i32,
            object_type: match track.kind {
                AgentKind::Vehicle => 1,
                AgentKind::Pedestrian => 2,
                AgentKind::Cyclist => 3,
                AgentKind::Static => 4,
            },
            states: track.samples.iter().map(|sample| state(track, sample.as_ref())).collect(),
        };
        let lane = |(id, lane): (usize, &crate::scene::Lane)| {
            let polyline = lane.centre.iter().map(|p| MapPoint { x: p.x, y: p.y }).collect();
            let lane = LaneCenter { kind: 2, polyline, ..LaneCenter::default() };
            MapFeature { id: id as i64, lane: Some(Box::new(lane)), ..MapFeature::default() }
        };
        Scenario {
            timestamps_seconds: (0..scene.steps).map(|k| 0.1 * k as f64).collect(),
            tracks: std::iter::once(&scene.ego.track).chain(&scene.tracks).enumerate().map(track).collect(),
            scenario_id: scene.id.clone(),
            current_time_index: scene.current_step as i32,
            map_features: scene.road.lanes.iter().enumerate().map(lane).collect(),
            ..Scenario::default()
        }
    }

    #[test]
    fn a_scenario_becomes_a_scene() {
        let imported = import("f.tfrecord", &written(&[message().encode_to_vec()])).unwrap();
        assert_eq!(imported.left_out, vec![]);
        let scene = &imported.scenes[0];
        assert_eq!((scene.id.as_str(), scene.current_step, scene.steps), ("f00d", 10, 91));
        assert_eq!(scene.ego.track.at(10).unwrap().position, Vec2::ZERO);
        assert_eq!((scene.objects_of_interest.clone(), scene.tracks[1].span()), (vec![0], Some((21, 90))));
        let lane = &scene.road.lanes[0];
        assert_eq!(lane.exits, [1]);
        let beside: Vec<_> = lane.right_neighbours.iter().map(|n| n.lane).collect();
        assert_eq!(beside, [2, 1], "all that the map holds, the longest first");
        assert!((lane.right[0].y - -1.5).abs() < 1e-9 && (lane.left[0].y - 1.75).abs() < 1e-9, "border and default");
        assert!((lane.speed_limit_mps.unwrap() - 15.6464).abs() < 1e-9);
        assert_eq!((scene.lights[0].states[29], scene.lights[0].states[30]), (LightState::Stop, LightState::Go));
        assert_eq!((scene.stop_signs[0].lanes.clone(), scene.road.edges.len()), (vec![0], 1));
        assert_eq!(crate::scene::usable(scene), Ok(()));
    }

    #[test]
    fn records_beyond_the_parts_of_a_file_are_left_out_together() {
        let named = |k: usize| Scenario { scenario_id: k.to_string(), ..message() }.encode_to_vec();
        let bytes = written(&(0..5).map(named).collect::<Vec<_>>());
        let imported = read("f.tfrecord", &bytes, 500).unwrap();
        assert_eq!((imported.scenes.len(), imported.left_out.len()), (2, 1), "{:?}", imported.left_out);
        assert!(imported.left_out[0].what == "record 2" && imported.left_out[0].reason.contains("at most 500"));
        assert_eq!(read("f.tfrecord", &bytes, FILE_PARTS_MAX).unwrap().scenes.len(), 5);
        // Empty records count too, and so do tracks that are never observed.
        let nothing = read("f.tfrecord", &written(&[&[named(0)][..], &vec![vec![]; 100]].concat()), 500).unwrap();
        assert!(nothing.left_out.len() < 20, "{}", nothing.left_out.len());
        let mut unseen = message();
        unseen.tracks[0].states.iter_mut().for_each(|state| state.valid = false);
        let unseen = written(&[unseen.encode_to_vec(), named(1), named(2)]);
        assert_eq!(read("f.tfrecord", &unseen, 300).unwrap().scenes.len(), 1);
    }

    #[test]
    fn a_bad_record_is_left_out_and_the_rest_kept() {
        let mut short = message();
        short.scenario_id = "short".into();
        short.tracks[0].states.truncate(50);
        let mut lost = message();
        lost.sdc_track_index = 77;
        let bytes =
            written(&[message().encode_to_vec(), short.encode_to_vec(), lost.encode_to_vec(), b"\xff\xff".to_vec()]);
        let imported = import("f.tfrecord", &bytes).unwrap();
        assert_eq!(imported.scenes.iter().map(|scene| scene.tracks.len()).collect::<Vec<_>>(), [2, 1]);
        let left_out: Vec<&str> = imported.left_out.iter().map(|l| l.reason.as_str()).collect();
        assert!(
            left_out[0].contains("tracks[0] 1")
                && left_out[1].contains("no track of that id")
                && left_out[2].contains("sdc_track_index")
                && left_out[3].contains("Scenario message")
        );
    }

    #[test]
    fn a_sample_that_cannot_be_is_dropped_alone_and_told() {
        let mut wild = message();
        wild.tracks[0].states[40].center_x = f64::NAN;
        wild.tracks[0].states[41].velocity_x = Some(103.0);
        let imported = import("f.tfrecord", &written(&[wild.encode_to_vec()])).unwrap();
        let (track, left_out) = (&imported.scenes[0].tracks[0], &imported.left_out[0]);
        assert_eq!((39..43).map(|k| track.at(k).is_some()).collect::<Vec<_>>(), [true, false, false, true]);
        assert_eq!((left_out.what.as_str(), left_out.reason.contains("100 m/s")), ("2 samples of track 1", true));
    }

    #[test]
    fn a_place_from_which_nobody_can_come_is_dropped_where_speeds_are_derived_from_places() {
        let mut late = message();
        late.timestamps_seconds = (0..91).map(|k| 0.1 * f64::from(k) + if k > 3 { 0.04 } else { 0.0 }).collect();
        late.tracks[0].states[40].center_x += 500.0;
        let imported = import("f.tfrecord", &written(&[late.encode_to_vec()])).unwrap();
        let track = &imported.scenes[0].tracks[0];
        assert!(track.samples.iter().flatten().all(|sample| sample.speed_mps() < 100.0));
        assert!(
            track.samples.iter().flatten().count() > 80 && imported.left_out[1].what.ends_with("samples of track 1")
        );
    }

    #[test]
    fn times_that_are_not_read_move_nothing_and_are_told() {
        let (even, mut late) = (message(), message());
        late.timestamps_seconds = (0..91).map(|k| 0.14 * f64::from(k)).collect();
        let read = |message: &Scenario, times| {
            let conventions = Conventions { times, ..Conventions::default() };
            import_as("f.tfrecord", &written(&[message.encode_to_vec()]), conventions).unwrap()
        };
        let (plain, ignored) = (read(&even, SampleTimes::Recorded), read(&late, SampleTimes::Every(0.1)));
        assert_eq!(ignored.scenes, plain.scenes);
        assert!(
            ignored.left_out.iter().any(|part| part.reason.starts_with("they were not read")),
            "{:?}",
            ignored.left_out
        );
        assert_eq!(read(&even, SampleTimes::Every(0.1)), plain, "what lies on the grid is read as ever");
        assert_ne!(read(&late, SampleTimes::Recorded).scenes, plain.scenes);
    }

    #[test]
    fn times_beside_the_grid_are_told_and_whoever_is_seen_once_is_kept() {
        let mut late = message();
        late.timestamps_seconds = (0..91).map(|k| 0.1 * f64::from(k) + if k > 3 { 0.04 } else { 0.0 }).collect();
        for (k, state) in late.tracks[2].states.iter_mut().enumerate() {
            state.valid = k == 50;
        }
        let imported = import("f.tfrecord", &written(&[late.encode_to_vec()])).unwrap();
        let left_out = &imported.left_out[0];
        assert!(left_out.is_kept(), "{left_out:?}");
        assert!(left_out.reason.contains("0.040 s") && imported.left_out.len() == 1, "{:?}", imported.left_out);
        let seen = &imported.scenes[0].tracks[1];
        assert_eq!((seen.id.as_str(), seen.span()), ("3", Some((50, 50))));
        assert!((seen.at(50).unwrap().velocity.y - 1.0).abs() < 1e-6);
    }

    #[test]
    fn truncated_files_are_refused_or_end_early() {
        let bytes = written(&[message().encode_to_vec()]);
        for end in (0..bytes.len()).step_by(499).skip(1) {
            assert!(import("cut.tfrecord", &bytes[..end]).is_err(), "{end}");
        }
    }
}
