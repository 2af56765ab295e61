//! One bad part of each kind in a file of each format, by docs/FORMAT.md's rule: the part is left out by name and the rest
//! kept; a file is refused where its ego, its route or the core of its map is lost.

use serde_json::{Value, json};

use super::wholes::{self, described, edited, of, pickled, sealed};
use super::{gpudrive, opendrive, refusal, safebench};
use crate::formats::{Imported, import_files};
use crate::kernel::{Vec2, num};
use crate::scene::{AgentKind, LeftOut, Scene};

/// Fate of a file with one bad part.
enum Becomes {
    /// It gives its scene, with so many tracks and lanes fewer.
    Kept(usize, usize),
    /// It gives no scene.
    Refused,
}
use Becomes::{Kept, Refused};

const JSON: &str = "ScenarioNet JSON";
const PICKLE: &str = "ScenarioNet pickle";
const GPU: &str = "GPUDrive JSON";
const CR: &str = "CommonRoad";
const WAYMO: &str = "Waymo TFRecord";

/// Returns the file as the pickle's rows have it: the same description as in JSON.
fn whole(format: &str) -> Vec<u8> {
    if format == PICKLE { pickled(&described(|_| ())) } else { of(format).bytes }
}

fn text(value: &Value) -> Vec<u8> {
    // Python's word for NaN.
    value.to_string().replace("\"<nan>\"", "NaN").into_bytes()
}

fn gpu(change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let mut value = gpudrive::tests::new_form();
    change(&mut value);
    text(&value)
}

/// Format, bad part, file, words of the message, fate of the file.
type Row = (&'static str, &'static str, Vec<u8>, &'static str, Becomes);

/// Returns both forms of a ScenarioNet description.
fn both(part: &'static str, change: impl Fn(&mut Value), words: &'static str, kept: (usize, usize)) -> [Row; 2] {
    let value = described(change);
    [
        (JSON, part, text(&value), words, Kept(kept.0, kept.1)),
        (PICKLE, part, pickled(&value), words, Kept(kept.0, kept.1)),
    ]
}

fn scenarionet() -> Vec<Row> {
    let state = |key: &'static str, value: Value| move |s: &mut Value| s["tracks"]["2"]["state"][key] = value.clone();
    let lane = |key: &'static str, value: Value| move |s: &mut Value| s["map_features"]["10"][key] = value.clone();
    let refused = |part, change: &dyn Fn(&mut Value), words| -> [Row; 2] {
        let value = described(|s| change(s));
        [(JSON, part, text(&value), words, Refused), (PICKLE, part, pickled(&value), words, Refused)]
    };
    let heights = |s: &mut Value, steps: std::ops::Range<usize>| {
        steps.for_each(|k| s["tracks"]["2"]["state"]["position"][k][2] = json!(8.0));
    };
    let high = |s: &mut Value| heights(s, 0..91);
    let bridge = |s: &mut Value| heights(s, 40..42);
    let flat = |s: &mut Value| {
        for id in ["1", "2"] {
            let places = s["tracks"][id]["state"]["position"].as_array_mut().unwrap();
            places.iter_mut().for_each(|place| place.as_array_mut().unwrap().truncate(2));
        }
    };
    let far = |s: &mut Value| s["tracks"]["2"]["state"]["position"][5][0] = json!(1e9);
    [
        both("a heading", |s| s["tracks"]["2"]["state"]["heading"][5] = json!("<nan>"), "1 samples of track 2", (0, 0)),
        both(
            "a place",
            |s| s["tracks"]["2"]["state"]["position"][5][0] = json!("<nan>"),
            "1 samples of track 2",
            (0, 0),
        ),
        both("a place far off", far, "1 samples of track 2", (0, 0)),
        both(
            "a velocity",
            |s| s["tracks"]["2"]["state"]["velocity"][5][0] = json!("<nan>"),
            "its velocities: 1 samples",
            (0, 0),
        ),
        both("no velocity", state("velocity", json!(null)), "its velocities: 91 samples of 1 road users", (0, 0)),
        both("no heading", state("heading", json!(null)), "its headings: 1 road users", (0, 0)),
        both("no places", state("position", json!(null)), "track 2", (1, 0)),
        both("too few places", state("position", json!([[0.0, 0.0]])), "track 2", (1, 0)),
        both("no state", |s| s["tracks"]["2"]["state"] = json!(7), "track 2", (1, 0)),
        both(
            "its kind",
            |s| s["tracks"]["2"]["type"] = json!("OTHER"),
            "its kinds: 1 road users of the kind \"OTHER\"",
            (0, 0),
        ),
        both("no kind", |s| s["tracks"]["2"]["type"] = json!(null), "its kinds: 1 road users", (0, 0)),
        both("another level", high, "track 2: on another level than the ego's way, up to 8.0 m above it", (1, 0)),
        both("another level for a while", bridge, "2 samples of track 2: on another level", (0, 0)),
        both("no heights", flat, "its heights: there are none", (0, 0)),
        both("a time", |s| s["metadata"]["ts"][3] = json!("<nan>"), "its sample times: 1 are no numbers", (0, 0)),
        both(
            "its id",
            |s| (s["id"], s["metadata"]["scenario_id"]) = (json!(null), json!(null)),
            "its id: there is none",
            (0, 0),
        ),
        both(
            "a point of a lane",
            |s| s["map_features"]["10"]["polyline"][1][0] = json!("<nan>"),
            "1 points of lane 10",
            (0, 0),
        ),
        both("a lane without a line", lane("polyline", json!(null)), "lane 10", (0, 1)),
        both("a lane of one point", lane("polyline", json!([[0.0, 0.0]])), "lane 10", (0, 1)),
        both("a lane of no kind", lane("type", json!(null)), "map feature 10", (0, 1)),
        both("its own exit", lane("exit_lanes", json!(["10", "11"])), "link of lane 10", (0, 0)),
        both("a speed", lane("speed_limit_kmh", json!("fast")), "speed limit of lane 10", (0, 0)),
        both("a light", |s| s["dynamic_map_states"]["10"] = json!({"lane": "10"}), "light 10", (0, 0)),
        both(
            "a light's lane",
            |s| s["dynamic_map_states"]["77"] = json!({"state": {"object_state": []}}),
            "light of lane 77",
            (0, 0),
        ),
        both(
            "a stop sign",
            |s| s["map_features"]["12"] = json!({"type": "STOP_SIGN", "position": null}),
            "map feature 12",
            (0, 0),
        ),
        both("a mark", |s| s["metadata"]["objects_of_interest"] = json!(["2", "99"]), "mark of interest 99", (0, 0)),
        refused("the ego", &|s| s["metadata"]["sdc_id"] = json!("99"), "the id of a track"),
        refused("the ego's state", &|s| s["tracks"]["1"]["state"]["position"] = json!(null), "numbers in an array"),
        refused(
            "the ego now",
            &|s| s["tracks"]["1"]["state"]["position"][10][0] = json!("<nan>"),
            "not observed at the current",
        ),
        refused(
            "every lane",
            &|s| ["10", "11"].iter().for_each(|id| s["map_features"][id]["polyline"] = json!(null)),
            "at least one lane",
        ),
    ]
    .concat_rows()
}

trait ConcatRows {
    fn concat_rows(self) -> Vec<Row>;
}

impl<const N: usize> ConcatRows for [[Row; 2]; N] {
    fn concat_rows(self) -> Vec<Row> {
        self.into_iter().flatten().collect()
    }
}

fn gpudrive_rows() -> Vec<Row> {
    let row = |part, change: &dyn Fn(&mut Value), words, becomes| (GPU, part, gpu(|v| change(v)), words, becomes);
    vec![
        row(
            "another level",
            &|v| (0..91).for_each(|k| v["objects"][0]["position"][k]["z"] = json!(-8.0)),
            "samples of track 7: on another level",
            Kept(0, 0),
        ),
        row("a heading", &|v| v["objects"][0]["heading"][5] = json!("<nan>"), "1 samples of track 7", Kept(0, 0)),
        row("a place", &|v| v["objects"][0]["position"][5]["x"] = json!(null), "1 samples of track 7", Kept(0, 0)),
        row(
            "a place that is none",
            &|v| v["objects"][0]["position"][5] = json!(null),
            "1 samples of track 7",
            Kept(0, 0),
        ),
        row(
            "a place far off",
            &|v| v["objects"][0]["position"][4]["x"] = json!(1e300),
            "1 samples of track 7",
            Kept(0, 0),
        ),
        row("no velocity", &|v| v["objects"][0]["velocity"] = json!(null), "its velocities: 91 samples", Kept(0, 0)),
        row("no heading", &|v| v["objects"][0]["heading"] = json!(null), "its headings: 1", Kept(0, 0)),
        row("too few samples", &|v| v["objects"][2]["heading"] = json!([1.0]), "object 2", Kept(1, 0)),
        row("an object of another kind of thing", &|v| v["objects"][2] = json!("x"), "object 2", Kept(1, 0)),
        row(
            "its kind",
            &|v| v["objects"][0]["type"] = json!("hoverboard"),
            "its kinds: 1 road users of the kind \"hoverboard\"",
            Kept(0, 0),
        ),
        row(
            "a point of a lane",
            &|v| v["roads"][0]["geometry"][7]["x"] = json!("<nan>"),
            "1 points of lane 50",
            Kept(0, 0),
        ),
        row("a lane without a line", &|v| v["roads"][0]["geometry"] = json!(null), "road 0", Kept(0, 1)),
        row(
            "two lanes of one id",
            &|v| v["roads"][1]["id"] = json!(50),
            "lane 50: its id is already taken",
            Kept(0, 1),
        ),
        row("a light", &|v| v["tl_states"]["50"] = json!(3), "light 50", Kept(0, 0)),
        row("a light's lane", &|v| v["tl_states"] = json!({"77": {"state": []}}), "light of lane 77", Kept(0, 0)),
        row("a mark", &|v| v["metadata"]["objects_of_interest"] = json!([9, 7, 99]), "mark of interest 99", Kept(0, 0)),
        row("the ego", &|v| v["metadata"]["sdc_track_index"] = json!(99), "sdc_track_index", Refused),
        row("the ego's samples", &|v| v["objects"][1]["position"] = json!([]), "objects[1]", Refused),
    ]
}

fn commonroad_rows() -> Vec<Row> {
    let row = |part, from: &str, to: &str, words, becomes| (CR, part, edited(CR, from, to), words, becomes);
    let initial = r#"<y>-40</y></point></position><orientation><exact>1.5707963267948966</exact></orientation>"#;
    let of_mass = "<y>-40</y></point></position>";
    vec![
        row("a speed sign", "8.33", "8.33 knots", "speed of trafficSign 40", Kept(0, 0)),
        row("a sign without a number", "<trafficSignID>274</trafficSignID>", "", "trafficSign 40", Kept(0, 0)),
        row(
            "a sign that is not there",
            "trafficSignRef ref=\"41\"",
            "trafficSignRef ref=\"77\"",
            "trafficSignRef of lanelet 4",
            Kept(0, 0),
        ),
        row(
            "a light that is not there",
            "trafficLightRef ref=\"50\"",
            "trafficLightRef ref=\"77\"",
            "trafficLightRef of lanelet 1",
            Kept(0, 0),
        ),
        row("a light's time", "<duration>20<", "<duration>1000000000000<", "trafficLight 50", Kept(0, 0)),
        row("a light's colour", ">redYellow<", ">pink<", "trafficLight 50", Kept(0, 0)),
        row(
            "a link to a lanelet that is not there",
            "successor ref=\"5\"",
            "successor ref=\"77\"",
            "successor of lanelet 4",
            Kept(0, 0),
        ),
        row(
            "a link to its own lanelet",
            "predecessor ref=\"4\"",
            "predecessor ref=\"5\"",
            "predecessor of lanelet 5",
            Kept(0, 0),
        ),
        row(
            "the direction of a neighbour",
            "adjacentLeft ref=\"7\" drivingDir=\"opposite\"",
            "adjacentLeft ref=\"7\"",
            "adjacentLeft of lanelet 3",
            Kept(0, 0),
        ),
        row(
            "a point of a lanelet",
            "<point><x>-30</x><y>1.75</y></point>",
            "<point><x>NaN</x><y>1.75</y></point>",
            "1 points of lanelet 1",
            Kept(0, 0),
        ),
        row(
            "a point far off",
            "<point><x>-30</x><y>1.75</y></point>",
            "<point><x>8e9</x><y>1.75</y></point>",
            "1 points of lanelet 1",
            Kept(0, 0),
        ),
        row("a bound", "<point><x>20</x><y>-4</y></point>", "", "lanelet 6", Kept(0, 1)),
        row("an id twice", "lanelet id=\"7\"", "lanelet id=\"6\"", "lanelet 6", Kept(0, 1)),
        row(
            "a stop line",
            "<point><x>-1.75</x><y>-9</y></point>",
            "<point><x>-1.75</x></point>",
            "stopLine of lanelet 4",
            Kept(0, 0),
        ),
        row(
            "an obstacle's id",
            "staticObstacle id=\"60\"",
            "staticObstacle id=\"61\"",
            "dynamicObstacle 61",
            Kept(1, 0),
        ),
        row("an obstacle's shape", "<length>4.5</length>", "<length>0</length>", "dynamicObstacle 61", Kept(1, 0)),
        row("a state", "<y>-39.2</y>", "<y>NaN</y>", "1 states of dynamicObstacle 61", Kept(0, 0)),
        row(
            "a state that repeats the time before it",
            "<time><exact>1</exact></time>",
            "<time><exact>0</exact></time>",
            "1 states of",
            Kept(0, 0),
        ),
        row("states without a heading", initial, of_mass, "its headings: 1 obstacles", Kept(0, 0)),
        row(
            "a kind",
            "<type>car</type>",
            "<type>hovercraft</type>",
            "its kinds: 1 road users of the kind \"hovercraft\"",
            Kept(0, 0),
        ),
        row("its id", "benchmarkID=\"XXX_Crossing-1_1_T-1\"", "", "its id: there is no benchmarkID", Kept(0, 0)),
        row("the ego's start", "<x>-50</x><y>0.2</y>", "<x>-50</x>", "planningProblem 100", Refused),
        row("the goal of the route", "<lanelet ref=\"3\"/>", "<lanelet ref=\"77\"/>", "goal of problem 100", Refused),
        (CR, "the lanelet of the ego", wholes::one_point_lanelet(), "lanelet 1", Refused),
        (
            CR,
            "every lanelet",
            String::from_utf8(whole(CR))
                .unwrap()
                .replace("<leftBound>", "<left>")
                .replace("</leftBound>", "</left>")
                .into(),
            "at least one <lanelet> that can be read",
            Refused,
        ),
    ]
}

fn waymo_rows() -> Vec<Row> {
    let row = |part, change: fn(&mut super::super::waymo::Scenario), words, becomes| {
        (WAYMO, part, sealed(change), words, becomes)
    };
    vec![
        row(
            "another level",
            |m| m.tracks[0].states.iter_mut().for_each(|s| s.center_z = Some(20.0)),
            "track 1: on another level",
            Kept(1, 0),
        ),
        row("a place", |m| m.tracks[0].states[40].center_x = f64::NAN, "1 samples of track 1", Kept(0, 0)),
        row("a place far off", |m| m.tracks[0].states[40].center_x = 1e12, "1 samples of track 1", Kept(0, 0)),
        row("no states", |m| m.tracks[0].states.clear(), "track 1", Kept(1, 0)),
        row("a point of a lane", |m| wholes::lane_of(m).polyline[7].x = f64::NAN, "1 points of lane 10", Kept(0, 0)),
        row("a lane without a line", |m| wholes::lane_of(m).polyline.clear(), "lane 10", Kept(0, 1)),
        row("its own exit", |m| wholes::lane_of(m).exit_lanes.push(10), "link of lane 10", Kept(0, 0)),
        row("the ego", |m| m.sdc_track_index = 77, "sdc_track_index", Refused),
        row("the ego's states", |m| m.tracks[1].states.clear(), "tracks[1]", Refused),
        row("the ego now", |m| m.tracks[1].states[10].center_x = f64::NAN, "not observed at the current", Refused),
    ]
}

#[test]
fn a_bad_part_is_left_out_by_name_and_the_rest_is_kept() {
    let rows: Vec<Row> =
        [scenarionet(), gpudrive_rows(), commonroad_rows(), waymo_rows()].into_iter().flatten().collect();
    let mut missed = Vec::new();
    for (format, part, bytes, words, becomes) in &rows {
        let reader = of(format);
        let read = |bytes: &[u8]| (reader.read)(reader.file, bytes).unwrap_or_default();
        let counts = |imported: &Imported| imported.scenes.first().map(|s| (s.tracks.len(), s.road.lanes.len()));
        let (tracks, lanes) = counts(&read(&whole(format))).unwrap();
        let expected = match becomes {
            Kept(fewer_tracks, fewer_lanes) => Some((tracks - fewer_tracks, lanes - fewer_lanes)),
            Refused => None,
        };
        let (kept, said) = (counts(&read(bytes)), refusal(&reader, bytes));
        if kept != expected || !said.contains(words) {
            missed.push(format!("{format}, {part}: {kept:?}, expected {expected:?} and {words:?} in {said}"));
        }
    }
    assert!(missed.is_empty(), "{} of {}:\n{}", missed.len(), rows.len(), missed.join("\n"));
    // Every part that is left out is reported with its place and the rest that is kept.
    for (format, part, bytes, _, _) in rows.iter().filter(|row| matches!(row.4, Kept(..))) {
        let reader = of(format);
        let before = (reader.read)(reader.file, &whole(format)).unwrap().left_out;
        let imported = (reader.read)(reader.file, bytes).unwrap();
        let new: Vec<&LeftOut> = imported.left_out.iter().filter(|left| !before.contains(left)).collect();
        assert!(!new.is_empty() && new.iter().all(|left| !left.what.is_empty()), "{format}, {part}: {new:?}");
    }
}

#[test]
fn roads_lanes_and_links_of_an_opendrive_file_are_left_out_alone() {
    let lanes = |bytes: &[u8]| {
        let mut imported = Imported::default();
        let road = opendrive::read::road("t.xodr", bytes, &mut imported).unwrap();
        (road.lanes.iter().map(|lane| lane.id.clone()).collect::<Vec<_>>(), imported.left_out)
    };
    let (all, none) = lanes(&of("OpenDRIVE").bytes);
    assert_eq!(none, vec![]);
    // The change, the words of the message, and how many lanes fewer there are.
    let rows = [
        ("elementId=\"3\"", "elementId=\"41\"", "successor of road 2", 0),
        (
            "elementType=\"road\" elementId=\"1\" contactPoint=\"end\"",
            "elementType=\"road\" elementId=\"1\"",
            "predecessor of road 2",
            0,
        ),
        ("connectingRoad=\"2\"", "connectingRoad=\"77\"", "connection 0 of junction 9", 0),
        ("connectingRoad=\"2\"", "connectingRoad=\"1\"", "connection 0 of junction 9", 0),
        ("laneLink from=\"-1\"", "laneLink from=\"x\"", "laneLink of connection 0", 0),
        ("hdg=\"-1.5707963267948966\"", "hdg=\"nan\"", "road 3", 1),
        ("<arc curvature=\"0.05\"/>", "<poly3 a=\"0\"/>", "road 2", 1),
        (
            "id=\"-3\" type=\"sidewalk\"><width sOffset=\"0\" a=\"2\"",
            "id=\"-3\" type=\"sidewalk\"><width sOffset=\"0\" a=\"x\"",
            "lane -3 and those beyond it",
            1,
        ),
        ("lane id=\"-3\"", "lane id=\"3\"", "the lanes of the right side of section 0 of road 1", 3),
        ("max=\"30\" unit=\"mph\"", "max=\"30\" unit=\"knots\"", "speed limit of a type of road 1", 0),
        ("road id=\"3\"", "road id=\"2\"", "road 2", 1),
    ];
    for (from, to, words, fewer) in rows {
        let (kept, left_out) = lanes(&edited("OpenDRIVE", from, to));
        assert_eq!(kept.len(), all.len() - fewer, "{to}: {left_out:?}");
        assert!(left_out.iter().any(|left| left.what.contains(words)), "{to}: {left_out:?}");
    }
    let limit = |to: &str| {
        let bytes = edited("OpenDRIVE", "max=\"30\" unit=\"mph\"", to);
        opendrive::read::road("t.xodr", &bytes, &mut Imported::default()).unwrap().lanes[0].speed_limit_mps
    };
    assert!((limit("max=\"50kmh\"").unwrap() - 13.889).abs() < 1e-3);
}

#[test]
fn an_event_a_route_and_a_town_s_link_of_safebench_are_left_out_alone() {
    let events = safebench::tests::EVENTS.replace("\"250.0\"", "NaN");
    let town = safebench::tests::TOWN.replace(
        "<planView>",
        "<link><predecessor elementType=\"road\" elementId=\"41\" contactPoint=\"end\"/></link><planView>",
    );
    let route = safebench::tests::ROUTE;
    let bad = route.trim_start_matches("<routes>").trim_end_matches("</routes>").replace("x=\"60\"", "x=\"NaN\"");
    let routes = route.replace("</routes>", &format!("{bad}</routes>"));
    let files = [("Plain.xodr", town), ("scenario_05.json", events), ("scenario_05_route_06.xml", routes)];
    let summary = import_files(&files);
    assert_eq!(summary.scenes.len(), 1, "{:?}", summary.left_out);
    let mut names: Vec<&str> = summary.left_out.iter().map(|left| left.what.as_str()).collect();
    names.sort_unstable();
    let all =
        ["Plain, OppositeVehicleRunningRedLight event 0", "predecessor of road 1", "safebench/red_light_running/06.1"];
    assert_eq!(names, all, "{:?}", summary.left_out);
}

fn scene_of(format: &str, bytes: &[u8]) -> Scene {
    let reader = of(format);
    (reader.read)(reader.file, bytes).unwrap().scenes.remove(0)
}

#[test]
fn what_a_file_does_not_say_comes_from_what_it_says() {
    // A limit with its unit.
    for (text, mps) in [("50kmh", 13.889), ("25mph", 11.176), ("8.33", 8.33)] {
        let scene = scene_of(CR, &edited(CR, "8.33", text));
        let limits: Vec<f64> = scene.road.lanes.iter().filter_map(|lane| lane.speed_limit_mps).collect();
        assert!(!limits.is_empty() && limits.iter().all(|limit| (limit - mps).abs() < 1e-3), "{text}: {limits:?}");
    }
    // Velocities from places, absent in either way.
    for absent in [json!(null), json!(vec![json!([0.0, 0.0]); 91])] {
        let scene = scene_of(JSON, &text(&described(|s| s["tracks"]["2"]["state"]["velocity"] = absent)));
        let speeds = scene.tracks[0].samples.iter().flatten().map(|sample| sample.velocity);
        assert!(speeds.clone().count() == 91 && speeds.into_iter().all(|v| v.distance(Vec2::new(10.0, 0.0)) < 1e-6));
    }
    // A point mass heads where it goes.
    let mass = edited(
        CR,
        "<orientation><exact>1.5707963267948966</exact></orientation><time><exact>0</exact></time><velocity><exact>8</exact></velocity>",
        "<time><exact>0</exact></time><velocity><exact>0</exact></velocity><velocityY><exact>8</exact></velocityY>",
    );
    let scene = scene_of(CR, &mass);
    let car = scene.tracks.iter().find(|track| track.id == "61").unwrap().at(0).unwrap();
    assert!(
        (car.heading_rad - num::FRAC_PI_2).abs() < 1e-9 && car.velocity.distance(Vec2::new(0.0, 8.0)) < 1.0,
        "{car:?}"
    );
    // Kinds by their names, and unknown kinds by their motion.
    let names = [
        ("BUS", AgentKind::Vehicle),
        ("TRUCK", AgentKind::Vehicle),
        ("MOTORCYCLE", AgentKind::Cyclist),
        ("OTHER", AgentKind::Vehicle),
        ("TRAFFIC_CONE", AgentKind::Static),
    ];
    for (name, kind) in names {
        let scene = scene_of(JSON, &text(&described(|s| s["tracks"]["2"]["type"] = json!(name))));
        assert_eq!(scene.tracks[0].kind, kind, "{name}");
    }
}

#[test]
fn a_million_faults_are_counted_after_the_first_thousand() {
    let links: String = (0..5000).map(|k| format!("<successor ref=\"{}\"/>", 1000 + k)).collect();
    let bytes = edited(CR, "<successor ref=\"2\"/>", &format!("<successor ref=\"2\"/>{links}"));
    let summary = import_files(&[("c.xml", bytes)]);
    assert_eq!((summary.scenes.len(), summary.left_out.len()), (1, 1001));
    let last = &summary.left_out[1000];
    assert!(last.reason.starts_with("and 40") && last.reason.ends_with("more parts of this file"), "{last:?}");
}

#[test]
fn of_two_scenes_with_one_id_both_are_taken_where_that_is_asked_for() {
    use crate::formats::conventions::Conventions;
    use crate::formats::summary::{SameId, read_file, summed};
    let bytes = |from: f64| text(&described(|s| s["tracks"]["2"]["state"]["position"][0][1] = json!(from)));
    let files = [("a.json", 0.5), ("b.json", 0.6), ("sub.b.json", 0.7), ("b.json", 0.8), ("c.json", 0.5)];
    let read = |same_id| {
        let read = files
            .iter()
            .map(|(name, from)| (name.to_string(), read_file(name, &bytes(*from), None, Conventions::default())));
        summed(read, same_id)
    };
    let left_out = read(SameId::LeftOut);
    assert_eq!((left_out.scenes.len(), left_out.left_out.len()), (1, 4));
    assert!(left_out.left_out[0].reason.contains("--keep-both"), "{:?}", left_out.left_out);
    let both = read(SameId::Renamed);
    let ids: Vec<&str> = both.scenes.iter().map(|scene| scene.id.as_str()).collect();
    assert_eq!(ids, ["described", "described@b", "described@sub", "described@b-2"]);
    assert_eq!(both.left_out.iter().filter(|left| left.is_kept()).count(), 3);
    assert!(both.left_out[3].reason.contains("the same scene was already read from a.json"), "{:?}", both.left_out);
}

#[test]
fn times_of_a_description_are_not_read_where_that_is_asked_for() {
    use crate::formats::conventions::Conventions;
    use crate::formats::log::SampleTimes;
    use crate::formats::summary::import_file;
    let slow = |s: &mut Value| {
        for time in s["metadata"]["ts"].as_array_mut().unwrap() {
            *time = json!(1.5 * time.as_f64().unwrap());
        }
    };
    let (even, slow) = (described(|_| ()), described(slow));
    for bytes in [text as fn(&Value) -> Vec<u8>, pickled] {
        let read =
            |of: &Value, times| import_file("s", &bytes(of), Conventions { times, ..Conventions::default() }).unwrap();
        let (plain, ignored) = (read(&even, SampleTimes::Recorded), read(&slow, SampleTimes::Every(0.1)));
        assert_eq!(ignored.scenes, plain.scenes);
        assert!(ignored.left_out.iter().any(|part| part.reason.starts_with("they were not read")));
        assert_eq!(read(&even, SampleTimes::Every(0.1)), plain);
        assert_ne!(read(&slow, SampleTimes::Recorded).scenes, plain.scenes);
    }
}

#[test]
fn a_packed_file_gives_what_is_in_it_and_beside_routes_too() {
    use std::io::Write;
    let packed = |bytes: &[u8]| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    };
    for format in [JSON, PICKLE, GPU, CR, WAYMO] {
        let plain = import_files(&[("f", whole(format))]);
        assert!(!plain.scenes.is_empty() && import_files(&[("f", packed(&whole(format)))]) == plain, "{format}");
    }
    let road = crate::formats::opendrive::read::tests::TURN.as_bytes();
    let alone = import_files(&[("T.xodr", packed(road))]);
    assert!(alone.left_out[0].reason.contains("a road network of"), "{:?}", alone.left_out);
    assert_eq!(crate::formats::summary::part(&packed(road)), crate::formats::summary::Part::Beside);
}

#[test]
fn a_file_in_latin_1_is_read_as_the_same_in_utf_8() {
    let text = String::from_utf8(whole(CR)).unwrap();
    let declared = text.replacen("UTF-8", "ISO-8859-1", 1);
    assert_ne!(declared, text, "the file declares its encoding");
    let named = declared.replacen("author=\"", "author=\"J\u{fc}rgen ", 1);
    assert_ne!(named, declared, "the file has an author");
    let latin_1: Vec<u8> = named.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let read = import_files(&[("f.xml", latin_1)]);
    assert_eq!(read.scenes, import_files(&[("f.xml", text.into_bytes())]).scenes, "{:?}", read.left_out);
}

#[test]
fn flags_may_be_ones_and_zeros() {
    let seen = |k: usize| k != 5;
    for number in [true, false] {
        let flag = |k: usize| if number { json!(i32::from(seen(k))) } else { json!(f64::from(u8::from(seen(k)))) };
        let plain = import_files(&[("f", gpu(|g| g["objects"][0]["valid"] = (0..91).map(seen).collect()))]);
        let read = import_files(&[("f", gpu(|g| g["objects"][0]["valid"] = (0..91).map(flag).collect()))]);
        assert_eq!((read.scenes.len(), &read.scenes), (1, &plain.scenes));
        let change =
            |of: &dyn Fn(usize) -> Value| described(|s| s["tracks"]["2"]["state"]["valid"] = (0..91).map(of).collect());
        let plain = change(&|k| json!(seen(k)));
        for bytes in [text as fn(&Value) -> Vec<u8>, pickled] {
            let read = |value: &Value| import_files(&[("f", bytes(value))]).scenes;
            assert_eq!(read(&change(&flag)), read(&plain));
        }
    }
    let two = import_files(&[("f", gpu(|g| g["objects"][0]["valid"][3] = json!(2)))]);
    assert!(two.left_out[0].reason.contains("true, false, 1 or 0"), "{:?}", two.left_out);
}

#[test]
fn files_of_others_are_named_with_what_to_do() {
    for (bytes, words) in [
        (b"PK\x03\x04....".as_slice(), "a ZIP archive"),
        (b"PAR1....", "Argoverse 2"),
        (b"SQLite format 3\0", "nuPlan"),
        (b"version https://git-lfs.github.com/spec/v1", "git lfs pull"),
        (b"track_id,frame_id,timestamp_ms", "INTERACTION"),
        (b"<?xml version='1.0'?><osm version='0.6'/>", "Lanelet2"),
        (b"<?xml version='1.0'?><OpenSCENARIO/>", "written and not read"),
    ] {
        let read = import_files(&[("f", bytes)]);
        assert!(read.left_out[0].reason.contains(words), "{words}: {:?}", read.left_out);
    }
    // The older form of Waymo's data: a map from names to features.
    let example = b"\x0a\x20\x0a\x1e\x0a\x18roadgraph_samples/valid\x12\x02\x0a\x00".to_vec();
    let read = import_files(&[("training_tfexample.tfrecord", crate::formats::waymo::tfrecord::written(&[example]))]);
    assert!(read.left_out[0].reason.contains("folder `scenario` in place of `tf_example`"), "{:?}", read.left_out);
}
