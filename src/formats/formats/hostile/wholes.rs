//! One complete file of every format, and functions that make hostile files from them.

use prost::Message;
use serde_json::{Value, json};

use super::super::{ImportError, Imported, gpudrive, safebench, waymo};
use crate::formats::{
    commonroad::read as commonroad,
    opendrive::read as opendrive,
    scenarionet::{read_json as scenarionet_json, read_pickle as scenarionet},
    waymo::tfrecord,
};

/// A file that is read, and its importer.
pub struct Whole {
    pub format: &'static str,
    pub file: &'static str,
    pub bytes: Vec<u8>,
    pub read: fn(&str, &[u8]) -> Result<Imported, ImportError>,
    /// True if it gives a scene by itself.
    pub gives_scenes: bool,
}

const CROSSING: &str = include_str!("../../../../tests/fixtures/commonroad/crossing_2020a.xml");
const PICKLE: &[u8] = include_bytes!("../../../../tests/fixtures/scenarionet/waymo_form_4.pkl");

pub fn wholes() -> Vec<Whole> {
    let whole = |format, file, bytes: Vec<u8>, read, gives_scenes| Whole { format, file, bytes, read, gives_scenes };
    vec![
        whole("ScenarioNet pickle", "f.pkl", PICKLE.to_vec(), scenarionet::import, true),
        whole("ScenarioNet JSON", "s.json", described(|_| ()).to_string().into_bytes(), scenarionet_json::import, true),
        whole("GPUDrive JSON", "g.json", gpudrive::tests::new_form().to_string().into_bytes(), gpudrive::import, true),
        whole("CommonRoad", "c.xml", CROSSING.into(), commonroad::import, true),
        whole("OpenDRIVE", "t.xodr", opendrive::tests::TURN.into(), road_alone, false),
        whole("SafeBench route", "scenario_05_route_06.xml", safebench::tests::ROUTE.into(), route, false),
        whole("SafeBench scenarios", "scenario_05.json", safebench::tests::EVENTS.into(), scenarios, false),
        whole("Waymo TFRecord", "w.tfrecord", sealed(|_| ()), waymo::import, true),
    ]
}

pub fn of(format: &str) -> Whole {
    wholes().into_iter().find(|whole| whole.format == format).unwrap()
}

fn road_alone(file: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    let mut imported = Imported::default();
    opendrive::road(file, bytes, &mut imported).map(|_| imported)
}

fn route(file: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    safebench::import(file, bytes, &safebench::tests::library())
}

fn scenarios(file: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    let mut imported = Imported::default();
    safebench::Library::default().add_scenarios(file, bytes, &mut imported).map(|()| imported)
}

/// Returns the whole file with one text in place of another.
pub fn edited(format: &str, from: &str, to: &str) -> Vec<u8> {
    let text = String::from_utf8(of(format).bytes).unwrap();
    assert!(text.contains(from), "{format} holds no {from}");
    text.replacen(from, to, 1).into_bytes()
}

/// The first lanelet with one point on its left side.
pub fn one_point_lanelet() -> Vec<u8> {
    let (before, rest) = CROSSING.split_once("<leftBound>").unwrap();
    let (bound, after) = rest.split_once("</leftBound>").unwrap();
    let (point, _) = bound.split_once("</point>").unwrap();
    format!("{before}<leftBound>{point}</point></leftBound>{after}").into_bytes()
}

/// A ScenarioDescription in the form of `json.dump`: the ego behind a car on two lanes, one leading into the other.
pub fn described(change: impl FnOnce(&mut Value)) -> Value {
    let car = |x: f64| {
        json!({"type": "VEHICLE", "state": {
            "position": (0..91).map(|k| json!([x + f64::from(k), 0.5, 0.0])).collect::<Vec<_>>(),
            "heading": vec![0.0; 91], "velocity": vec![json!([10.0, 0.0]); 91], "valid": vec![1; 91],
            "length": 4.5, "width": 1.9,
        }})
    };
    let lane = |from: f64, exits: &[&str]| {
        let line: Vec<Value> = (0..=12).map(|k| json!([from + 10.0 * f64::from(k), 0.0, 0.0])).collect();
        json!({"type": "LANE_SURFACE_STREET", "polyline": line, "exit_lanes": exits, "entry_lanes": []})
    };
    let mut scene = json!({
        "id": "described", "version": "x", "length": 91,
        "tracks": {"1": car(0.0), "2": car(20.0)},
        "map_features": {"10": lane(-20.0, &["11"]), "11": lane(100.0, &[])},
        "dynamic_map_states": {},
        "metadata": {"ts": (0..91).map(|k| 0.1 * f64::from(k)).collect::<Vec<_>>(), "sdc_id": "1", "scenario_id": "described"},
    });
    change(&mut scene);
    scene
}

/// Nested lists, built from the inside out. The last owner drops them without recursion.
pub fn nested(depth: usize) -> Vec<u8> {
    [b"\x80\x04".to_vec(), b"](".repeat(depth), b"e".repeat(depth), b".".to_vec()].concat()
}

/// A value as a pickle of protocol 4. The texts `<nan>` and `<inf>` stand for NaN and infinity, which JSON does not
/// have.
pub fn pickled(value: &Value) -> Vec<u8> {
    let mut bytes = b"\x80\x04".to_vec();
    enum Part<'v> {
        Value(&'v Value),
        Code(&'static [u8]),
        Key(&'v str),
    }
    let text = |bytes: &mut Vec<u8>, text: &str| {
        bytes.push(b'X');
        bytes.extend((text.len() as u32).to_le_bytes());
        bytes.extend(text.as_bytes());
    };
    let float = |bytes: &mut Vec<u8>, x: f64| {
        bytes.push(b'G');
        bytes.extend(x.to_be_bytes());
    };
    let mut open = vec![Part::Code(b"."), Part::Value(value)];
    while let Some(part) = open.pop() {
        match part {
            Part::Code(code) => bytes.extend(code),
            Part::Key(key) => text(&mut bytes, key),
            Part::Value(Value::Null) => bytes.push(b'N'),
            Part::Value(Value::Bool(is)) => bytes.push(if *is { 0x88 } else { 0x89 }),
            Part::Value(Value::Number(n)) => match n.as_i64() {
                Some(whole) => {
                    bytes.extend(b"\x8a\x08");
                    bytes.extend(whole.to_le_bytes());
                }
                None => float(&mut bytes, n.as_f64().unwrap()),
            },
            Part::Value(Value::String(s)) if s == "<nan>" => float(&mut bytes, f64::NAN),
            Part::Value(Value::String(s)) if s == "<inf>" => float(&mut bytes, f64::INFINITY),
            Part::Value(Value::String(s)) => text(&mut bytes, s),
            Part::Value(Value::Array(items)) => {
                bytes.extend(b"](");
                open.push(Part::Code(b"e"));
                open.extend(items.iter().rev().map(Part::Value));
            }
            Part::Value(Value::Object(entries)) => {
                bytes.extend(b"}(");
                open.push(Part::Code(b"u"));
                for (key, value) in entries.iter().rev() {
                    open.push(Part::Value(value));
                    open.push(Part::Key(key));
                }
            }
        }
    }
    bytes
}

/// Waymo's message with a change, in a record file.
pub fn sealed(change: impl FnOnce(&mut waymo::Scenario)) -> Vec<u8> {
    let mut message = waymo::tests::message();
    change(&mut message);
    record_of(&message.encode_to_vec())
}

pub fn record_of(data: &[u8]) -> Vec<u8> {
    tfrecord::written(&[data.to_vec()])
}

/// The head of a record that states a length, without the data.
pub fn record_of_length(length: u64) -> Vec<u8> {
    tfrecord::head(length)
}

pub fn lane_of(message: &mut waymo::Scenario) -> &mut waymo::LaneCenter {
    message.map_features[0].lane.as_mut().unwrap()
}

/// A length in the wire format.
pub fn field(length: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    prost::encoding::encode_varint(length, &mut bytes);
    bytes
}

/// A Waymo message with this many lights in its first step.
pub fn lights_of(count: i64) -> Vec<u8> {
    let state = waymo::tests::light_at;
    sealed(|m| m.dynamic_map_states[0] = waymo::DynamicMapState { lane_states: (0..count).map(state).collect() })
}

const ROAD_HEAD: &str = "<commonRoad commonRoadVersion=\"2020a\" benchmarkID=\"x\" timeStepSize=\"0.1\">";

fn lanelet(id: usize, from: i32, to: i32, successor: &str) -> String {
    let bound = |y: i32| {
        let point = |x: i32| format!("<point><x>{x}</x><y>{y}</y></point>");
        [point(from), point(to)].concat()
    };
    format!(
        "<lanelet id=\"{id}\"><leftBound>{}</leftBound><rightBound>{}</rightBound>{successor}</lanelet>",
        bound(2),
        bound(-2)
    )
}

/// A problem that starts 5 m into lanelet 1 at 10 m/s and may take this many steps.
fn problem(id: usize, steps: usize) -> String {
    format!(
        "<planningProblem id=\"{id}\"><initialState><position><point><x>5</x><y>0</y></point></position><orientation>\
         <exact>0</exact></orientation><time><exact>0</exact></time><velocity><exact>10</exact></velocity>\
         </initialState><goalState><time><intervalStart>1</intervalStart><intervalEnd>{steps}</intervalEnd></time>\
         </goalState></planningProblem>"
    )
}

/// Two lanelets that form a ring, and a problem of this many steps.
pub fn ring_to_follow(steps: usize) -> Vec<u8> {
    let next = |id: usize| format!("<successor ref=\"{id}\"/>");
    let road = lanelet(1, 0, 100, &next(2)) + &lanelet(2, 100, 0, &next(1));
    format!("{ROAD_HEAD}{road}{}</commonRoad>", problem(9, steps)).into_bytes()
}

/// A lanelet with this many pieces of road boundary, and this many planning problems.
pub fn edges_of_problems(edges: usize, problems: usize) -> Vec<u8> {
    let edge = |k: usize| {
        format!(
            "<staticObstacle id=\"{}\"><type>roadBoundary</type><shape><rectangle><length>1</length><width>1</width>\
             </rectangle></shape><initialState><position><point><x>0</x><y>9</y></point></position><orientation>\
             <exact>0</exact></orientation><time><exact>0</exact></time></initialState></staticObstacle>",
            10_000 + k
        )
    };
    let edges: String = (0..edges).map(edge).collect();
    let problems: String = (0..problems).map(|k| problem(100_000 + k, 30)).collect();
    format!("{ROAD_HEAD}{}{edges}{problems}</commonRoad>", lanelet(1, 0, 100, "")).into_bytes()
}
