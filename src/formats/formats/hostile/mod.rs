//! Hostile files against every importer: a table of importers, attacks and messages, and randomly drawn changes. A
//! refusal names file, place, rule and remedy. Nothing panics, and no imported scene breaks a rule.

mod checkpoints;
mod parts;
mod pickles;
pub(super) mod wholes;

use super::{ImportError, Imported, gpudrive, import_files, opendrive, safebench};
use prost::Message;
use serde_json::json;
use wholes::{Whole, described, edited, field, nested, of, pickled, sealed, wholes};

/// An importer's message about a file: its error, or what it left out. Both must be complete.
fn refusal(whole: &Whole, bytes: &[u8]) -> String {
    match (whole.read)(whole.file, bytes) {
        Err(error) => {
            let ImportError { file, place, expected, remedy } = &error;
            assert_eq!(file, whole.file, "{error}");
            assert!([place, expected, remedy].iter().all(|text| !text.trim().is_empty()), "{error}");
            assert!(error.to_string().len() < 2000, "{} bytes", error.to_string().len());
            error.to_string()
        }
        Ok(imported) => {
            sound(&imported);
            assert!(imported.left_out.iter().all(|l| l.file == whole.file && !l.reason.is_empty()));
            let left_out = imported.left_out.iter().map(|l| format!("{} {}: {}\n", l.file, l.what, l.reason));
            format!("left out {}", left_out.collect::<String>())
        }
    }
}

fn sound(imported: &Imported) {
    for scene in &imported.scenes {
        assert_eq!(scene.validate(), vec![]);
    }
}

#[test]
fn whole_files_are_read() {
    for whole in wholes() {
        let imported = (whole.read)(whole.file, &whole.bytes);
        assert!(imported.is_ok(), "{}: {imported:?}", whole.format);
        sound(&imported.unwrap());
    }
}

#[test]
fn every_hostility_is_told_with_file_place_rule_and_remedy() {
    let deep = "[".repeat(100_000);
    let bomb = |root: &str| {
        let entities: String =
            (1..10).map(|k| format!("<!ENTITY l{k} \"{}\">", format!("&l{};", k - 1).repeat(10))).collect();
        format!("<?xml version=\"1.0\"?><!DOCTYPE {root} [<!ENTITY l0 \"lol\">{entities}]><{root}>&l9;</{root}>")
    };
    let elements = |root: &str| format!("<{root}>{}{}</{root}>", "<a>".repeat(100_000), "</a>".repeat(100_000));
    let lane = |change: &dyn Fn(&mut serde_json::Value)| described(|scene| change(&mut scene["map_features"]["10"]));
    let states =
        |change: &dyn Fn(&mut serde_json::Value)| described(|scene| change(&mut scene["tracks"]["2"]["state"]));
    let waymo = |change: fn(&mut super::waymo::Scenario)| sealed(change);
    let (net, json, gpu, cr, odr, route, events, wm) = (
        "ScenarioNet pickle",
        "ScenarioNet JSON",
        "GPUDrive JSON",
        "CommonRoad",
        "OpenDRIVE",
        "SafeBench route",
        "SafeBench scenarios",
        "Waymo TFRecord",
    );
    let text = |value: serde_json::Value| value.to_string().into_bytes();
    let gpudrive = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut value = super::gpudrive::tests::new_form();
        change(&mut value);
        text(value)
    };
    let crossing = |from: &str, to: &str| edited(cr, from, to);
    let far: Vec<u8> = 1_000_000_000_000u64.to_le_bytes().to_vec();
    let table: Vec<(&str, &str, Vec<u8>, &str)> = vec![
        // Nesting.
        (net, "nested lists", nested(100_000), "a dictionary"),
        (json, "nested lists", format!("{{\"version\": {deep}").into_bytes(), "recursion"),
        (gpu, "nested lists", format!("{{\"roads\":[{{\"geometry\":{deep}").into_bytes(), "EOF"),
        (events, "nested lists", format!("{{\"available_scenarios\":{deep}").into_bytes(), "line 1"),
        (cr, "nested elements", elements("commonRoad").into_bytes(), "64 nested"),
        (odr, "nested elements", elements("OpenDRIVE").into_bytes(), "64 nested"),
        (route, "nested elements", elements("routes").into_bytes(), "64 nested"),
        // Entities.
        (cr, "entity bomb", bomb("commonRoad").into_bytes(), "remove <!DOCTYPE"),
        (odr, "entity bomb", bomb("OpenDRIVE").into_bytes(), "remove <!DOCTYPE"),
        (route, "entity bomb", bomb("routes").into_bytes(), "remove <!DOCTYPE"),
        (cr, "entity in an attribute", crossing("2020a", "&l9;"), "found &l9;"),
        (odr, "entity in an attribute", edited(odr, "road id=\"3\"", "road id=\"&l9;\""), "found &l9;"),
        (route, "entity in an attribute", edited(route, "Plain", "&l9;"), "found &l9;"),
        // Counts of 1e12.
        (
            net,
            "steps",
            pickled(&described(|s| {
                s["metadata"]["ts"] = json!(null);
                s["length"] = json!(1_000_000_000_000u64)
            })),
            "at most 1200",
        ),
        (net, "bytes of a text", [b"\x80\x04\x8d", &far[..], b"abc"].concat(), "1000000000000 more bytes"),
        (net, "a frame", [b"\x80\x04\x95", &far[..], b"abc"].concat(), "a frame of 1000000000000"),
        (net, "a memo index", b"\x80\x04Nr\xff\xff\xff\xff.".to_vec(), "a memo index near 0"),
        (
            json,
            "steps",
            text(described(|s| {
                s["metadata"]["ts"] = json!(null);
                s["length"] = json!(1e12)
            })),
            "at most 1200",
        ),
        (
            gpu,
            "the ego's index",
            gpudrive(&|v| v["metadata"]["sdc_track_index"] = json!(1_000_000_000_000u64)),
            "sdc_track_index",
        ),
        (cr, "a time step", crossing("<duration>20<", "<duration>1000000000000<"), "a step from 0 to 1000000"),
        (odr, "a length", edited(odr, "length=\"50\" junction", "length=\"1e12\" junction"), "at most 100000 m"),
        (odr, "a lane's number", edited(odr, "lane id=\"-3\"", "lane id=\"-1000000000000\""), "a lane id"),
        (route, "a coordinate", edited(route, "x=\"60\"", "x=\"1e12\""), "waypoint 1"),
        (events, "a coordinate", edited(events, "250.0", "1e12"), "finite x, y and yaw"),
        (wm, "a record's length", wholes::record_of_length(1_000_000_000_000), "a whole record"),
        (
            wm,
            "a field's length",
            wholes::record_of(&[&[0x12u8][..], &field(1_000_000_000_000)].concat()),
            "a Scenario message",
        ),
        (wm, "map features", wholes::record_of(&[0x42, 0x00].repeat(60_000)), "map_features: expected at most 50000"),
        (wm, "the ego's index", waymo(|m| m.sdc_track_index = i32::MAX), "sdc_track_index"),
        (wm, "light states", wholes::lights_of(44_000), "dynamic_map_states: expected at most 4 million states"),
        (
            wm,
            "map features behind a group",
            wholes::record_of(&[&[0x1b, 0x1c][..], &[0x42, 0x00].repeat(60_000)].concat()),
            "without groups",
        ),
        (cr, "road edges of all problems", wholes::edges_of_problems(3_000, 600), "at most 8000000 samples"),
        (cr, "a ring to follow", wholes::ring_to_follow(1_000_000), "route_is_plausible"),
        // Malformed numbers.
        (net, "NaN", pickled(&states(&|s| s["position"][5][0] = json!("<nan>"))), "1 samples of track 2: not finite"),
        (net, "infinity", pickled(&states(&|s| s["heading"][5] = json!("<inf>"))), "1 samples of track 2: not finite"),
        (
            net,
            "NaN on the map",
            pickled(&lane(&|l| l["polyline"][1][0] = json!("<nan>"))),
            "1 points of lane 10: not finite",
        ),
        (
            net,
            "NaN in time",
            pickled(&described(|s| s["metadata"]["ts"][0] = json!("<nan>"))),
            "first or last sample has no time",
        ),
        (json, "infinity", edited(json, "\"length\":91", "\"length\":1e999"), "out of range"),
        (json, "NaN", edited(json, "\"sdc_id\":\"1\"", "\"sdc_id\":NaN"), "the id of a track"),
        (gpu, "infinity", edited(gpu, "\"sdc_track_index\":1", "\"sdc_track_index\":1e999"), "out of range"),
        (
            gpu,
            "out of all measure",
            gpudrive(&|v| v["objects"][0]["position"][4]["x"] = json!(1e300)),
            "1 samples of track 7: not finite, farther than 100 km",
        ),
        (cr, "NaN", crossing("<x>-50</x>", "<x>NaN</x>"), "a finite number"),
        (cr, "infinity", crossing("<x>-50</x>", "<x>-inf</x>"), "a finite number"),
        (odr, "NaN", edited(odr, "hdg=\"0\"", "hdg=\"nan\""), "a finite number"),
        (odr, "infinity", edited(odr, "curvature=\"0.05\"", "curvature=\"1e999\""), "a finite number"),
        (route, "NaN", edited(route, "x=\"60\"", "x=\"NaN\""), "a finite number"),
        (events, "infinity", edited(events, "250.0", "inf"), "finite x, y and yaw"),
        (wm, "NaN", waymo(|m| m.tracks[0].states[40].center_x = f64::NAN), "1 samples of track 1: not finite"),
        (
            wm,
            "infinity on the map",
            waymo(|m| wholes::lane_of(m).polyline[7].x = f64::INFINITY),
            "1 points of lane 10: not finite",
        ),
        // Tracks of no length.
        (net, "no samples", pickled(&states(&|s| s["position"] = json!([]))), "91 rows of 2"),
        (
            net,
            "never observed",
            pickled(&states(&|s| s["valid"] = json!(vec![0; 91]))),
            "track 2: it is never observed",
        ),
        (json, "no samples", text(states(&|s| s["heading"] = json!([]))), "91 rows of 1"),
        (gpu, "no samples", gpudrive(&|v| v["objects"][1]["valid"] = json!([])), "2 to 1200 samples, found 0"),
        (gpu, "fewer places than times", gpudrive(&|v| v["objects"][2]["position"] = json!([])), "objects[2]"),
        (cr, "a box of no length", crossing("<length>4.5</length>", "<length>0</length>"), "a length above 0"),
        (
            odr,
            "a road of no length",
            edited(odr, "length=\"50\" junction", "length=\"0\" junction"),
            "a length above 0",
        ),
        (
            route,
            "one waypoint",
            edited(
                route,
                "<waypoint x=\"60\" y=\"5.25\" z=\"0\" pitch=\"0\" roll=\"0\" yaw=\"0.0\"/>\n<waypoint x=\"120\" y=\"5.25\" z=\"0\" pitch=\"0\" roll=\"0\" yaw=\"0.0\"/>",
                "",
            ),
            "at least 2 waypoints",
        ),
        (wm, "no states", waymo(|m| m.tracks[0].states.clear()), "91 states, found 0"),
        // Lanes of one point.
        (
            net,
            "one point",
            pickled(&lane(&|l| l["polyline"] = json!([[0.0, 0.0, 0.0]]))),
            "lane 10: its centre line needs 2 points that differ, found 1",
        ),
        (
            json,
            "one point",
            text(lane(&|l| l["polyline"] = json!([[0.0, 0.0, 0.0]]))),
            "lane 10: its centre line needs 2 points that differ, found 1",
        ),
        (
            gpu,
            "one point",
            gpudrive(&|v| v["roads"][0]["geometry"] = json!([{"x": 0.0, "y": 0.0}])),
            "lane 50: its centre line needs 2 points that differ, found 1",
        ),
        (cr, "one point", wholes::one_point_lanelet(), "as many left as right points, found 1"),
        (
            odr,
            "no geometry",
            edited(odr, "<geometry s=\"0\" x=\"0\" y=\"0\" hdg=\"0\" length=\"50\"><line/></geometry>", ""),
            "at least one <geometry>",
        ),
        (
            wm,
            "one point",
            waymo(|m| wholes::lane_of(m).polyline.truncate(1)),
            "its centre line needs 2 points that differ, found 1",
        ),
        // Topology that leads back to itself.
        (
            net,
            "its own exit",
            pickled(&lane(&|l| l["exit_lanes"] = json!(["10"]))),
            "link of lane 10: it leads to its own lane",
        ),
        (
            net,
            "its own neighbour",
            pickled(&lane(&|l| l["left_neighbor"] = json!(["10"]))),
            "link of lane 10: it leads to its own lane",
        ),
        (net, "a list in itself", b"\x80\x04]\x94h\x00a.".to_vec(), "a dictionary with \"metadata\""),
        (
            json,
            "its own exit",
            text(lane(&|l| l["exit_lanes"] = json!(["10"]))),
            "link of lane 10: it leads to its own lane",
        ),
        (
            gpu,
            "two lanes of one id",
            gpudrive(&|v| v["roads"][1]["id"] = json!(50)),
            "lane 50: its id is already taken",
        ),
        (
            cr,
            "its own successor",
            crossing("successor ref=\"2\"", "successor ref=\"1\""),
            "another lanelet than itself",
        ),
        (
            odr,
            "its own connection",
            edited(odr, "connectingRoad=\"2\"", "connectingRoad=\"1\""),
            "other than the incoming one",
        ),
        (
            wm,
            "its own exit",
            waymo(|m| wholes::lane_of(m).exit_lanes.push(10)),
            "link of lane 10: it leads to its own lane",
        ),
    ];
    let missed: Vec<String> = table
        .iter()
        .map(|(format, what, bytes, words)| (format, what, words, refusal(&of(format), bytes)))
        .filter(|(_, _, words, refused)| !refused.contains(**words))
        .map(|(format, what, words, refused)| format!("{format}, {what}: no {words:?} in {refused}"))
        .collect();
    assert!(missed.is_empty(), "{}", missed.join("\n"));
    let last_complaint = |format: &str| table.iter().filter(|row| row.0 == format).count();
    assert!(wholes().iter().all(|whole| last_complaint(whole.format) >= 3), "every importer has its rows");
}

#[test]
fn a_road_that_is_a_ring_is_read_without_a_link_to_itself() {
    let ring = edited("OpenDRIVE", "elementType=\"road\" elementId=\"3\"", "elementType=\"road\" elementId=\"2\"");
    let road = super::opendrive::read::road("ring.xodr", &ring, &mut Imported::default()).unwrap();
    let lane = road.lanes.iter().find(|lane| lane.id == "2/0/-1").unwrap();
    assert_eq!((lane.exits.len(), lane.entries.len()), (0, 1));
}

#[test]
fn a_scenario_description_is_known_whichever_key_comes_first() {
    let whole = described(|_| ());
    let text = whole.to_string();
    for first in ["tracks", "map_features", "metadata", "length"] {
        let mut rest = whole.clone();
        let value = rest.as_object_mut().unwrap().remove(first).unwrap();
        let rest = rest.to_string();
        let turned = format!("{{{:?}:{value},{}", first, &rest[1..]);
        assert_eq!(turned.len(), text.len());
        let summary = import_files(&[("s.json", turned)]);
        assert_eq!(summary.scenes.len(), 1, "{first}: {:?}", summary.left_out);
    }
}

#[test]
fn one_text_as_the_id_of_everything_is_no_id() {
    // A long text costs its bytes only once, however often it is referenced.
    let refused = refusal(&of("ScenarioNet pickle"), &pickles::shared_ids(100_000, 2_000));
    assert!(refused.contains("a dictionary of tracks"), "{refused}");
}

#[test]
fn a_list_that_is_read_by_everyone_is_read_a_bounded_number_of_times() {
    let refused = refusal(&of("ScenarioNet pickle"), &pickles::shared_sizes(1_000_000, 200));
    assert!(refused.contains("numbers in an array or a list"), "{refused}");
}

#[test]
fn elements_that_are_searched_behind_a_million_others_end_the_reading() {
    let noise = "<a/>".repeat(60_000);
    let lanelet = |k: usize| format!("<lanelet id=\"{k}\">{}</lanelet>", "<b/>".repeat(10));
    let lanelets: String = (0..20_000).map(lanelet).collect();
    let head = "<commonRoad commonRoadVersion=\"2020a\" benchmarkID=\"x\" timeStepSize=\"0.1\">";
    let refused = refusal(&of("CommonRoad"), format!("{head}{noise}{lanelets}</commonRoad>").as_bytes());
    assert!(refused.contains("a <leftBound> inside"), "a few steps are no search: {refused}");
    let lanes: String = (1..200)
        .map(|k| format!("<lane id=\"-{k}\" type=\"driving\"><link><successor id=\"-{k}\"/></link></lane>"))
        .collect();
    let sections: String =
        (0..100).map(|k| format!("<laneSection s=\"{k}\"><right>{lanes}</right></laneSection>")).collect();
    let road = format!(
        "<OpenDRIVE><road id=\"1\" length=\"200\">{}<planView><geometry s=\"0\" x=\"0\" y=\"0\" hdg=\"0\" length=\"200\">\
         <line/></geometry></planView><lanes>{sections}</lanes></road></OpenDRIVE>",
        "<a/>".repeat(100_000)
    );
    let refused = refusal(&of("OpenDRIVE"), road.as_bytes());
    assert!(refused.contains("hundreds of millions"), "{refused}");
}

#[test]
fn a_file_of_another_format_is_refused_by_every_importer() {
    for whole in wholes() {
        for other in wholes().iter().filter(|other| other.format != whole.format) {
            let read = (whole.read)(whole.file, &other.bytes);
            assert!(read.is_err(), "{} took {}", whole.format, other.format);
            refusal(&whole, &other.bytes);
        }
    }
}

#[test]
fn a_file_is_known_by_its_content_whatever_its_name_says() {
    for whole in wholes().iter().filter(|whole| whole.gives_scenes) {
        let right = import_files(&[(whole.file, &whole.bytes)]);
        let wrong = import_files(&[("scene.dat", &whole.bytes)]);
        assert_eq!((right.scenes.len(), wrong.scenes.len()), (1, 1), "{}: {:?}", whole.format, wrong.left_out);
    }
}

#[test]
fn every_cut_file_is_refused() {
    for whole in wholes() {
        let end = whole.bytes.trim_ascii_end().len();
        for cut in (0..end).step_by((end / 60).max(1)) {
            let read = (whole.read)(whole.file, &whole.bytes[..cut]);
            assert!(read.is_err(), "{} cut at {cut} of {end}", whole.format);
            refusal(&whole, &whole.bytes[..cut]);
        }
    }
}

#[test]
fn bad_files_in_a_folder_stop_no_other_and_all_are_listed() {
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for (k, whole) in wholes().iter().enumerate() {
        files.push((format!("cut{k}"), whole.bytes[..whole.bytes.len() / 2].to_vec()));
        files.push((format!("noise{k}"), pickles::noise(k as u64, 4096)));
        if whole.gives_scenes {
            files.push((format!("good{k}"), whole.bytes.clone()));
        }
    }
    let good = files.iter().filter(|(name, _)| name.starts_with("good")).count();
    let summary = import_files(&files);
    assert_eq!(summary.scenes.len(), good, "{:?}", summary.left_out);
    for (name, _) in files.iter().filter(|(name, _)| !name.starts_with("good")) {
        let listed: Vec<_> = summary.left_out.iter().filter(|left| left.file == *name).collect();
        assert!(listed.iter().any(|left| left.what.is_empty() && !left.reason.is_empty()), "{name}: {listed:?}");
    }
}

mod by_chance {
    use super::*;
    use proptest::prelude::*;

    /// Changes some bytes, and may cut off the end.
    fn changed(bytes: &[u8], flips: &[(f64, u8)], cut: Option<f64>) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        let place = |share: f64, of: usize| ((of as f64 * share) as usize).min(of.saturating_sub(1));
        for &(share, value) in flips {
            let at = place(share, bytes.len());
            bytes[at] = value;
        }
        if let Some(share) = cut {
            bytes.truncate(place(share, bytes.len()));
        }
        bytes
    }

    fn survives(format: &str, flips: &[(f64, u8)], cut: Option<f64>) {
        let whole = of(format);
        // A record's checksum would reject every change at once, so it is computed again.
        let bytes = match format {
            "Waymo TFRecord" => {
                wholes::record_of(&changed(&super::super::waymo::tests::message().encode_to_vec(), flips, cut))
            }
            _ => changed(&whole.bytes, flips, cut),
        };
        if let Ok(imported) = (whole.read)(whole.file, &bytes) {
            sound(&imported);
        }
        let summary = import_files(&[(whole.file, &bytes)]);
        assert!(summary.scenes.iter().all(|scene| scene.validate().is_empty()));
    }

    macro_rules! never_panics {
        ($($name:ident: $format:literal,)*) => { proptest! {
            $(#[test]
            fn $name(flips in prop::collection::vec((0.0..1.0f64, any::<u8>()), 0..12), cut in prop::option::of(0.0..1.0f64)) {
                survives($format, &flips, cut);
            })*
        } };
    }

    never_panics! {
        a_changed_scenarionet_pickle_never_panics: "ScenarioNet pickle",
        a_changed_scenarionet_json_never_panics: "ScenarioNet JSON",
        a_changed_gpudrive_json_never_panics: "GPUDrive JSON",
        a_changed_commonroad_file_never_panics: "CommonRoad",
        a_changed_opendrive_file_never_panics: "OpenDRIVE",
        a_changed_safebench_route_never_panics: "SafeBench route",
        a_changed_safebench_scenario_file_never_panics: "SafeBench scenarios",
        a_changed_waymo_record_never_panics: "Waymo TFRecord",
    }
}
