//! Exports of real and generated scenes. With EVODRIVE_EXPORT_DIR set, the files are also written there, for
//! `xmllint`, the ASAM checkers and other readers.

use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::process::Command;
use std::sync::OnceLock;

use crate::harness::{files, home, named_folder, shared, skip};
use evodrive::formats::openscenario::Revision;
use evodrive::formats::xml_read::{Document, Element};
use evodrive::formats::{Staging, commonroad, import_files, openscenario, scenarionet};
use evodrive::kernel::Seed;
use evodrive::scene::{Sample, Scene};
use evodrive::synth::{FamilyOptions, SynthOptions, WorldKind, family_member, pool_member};

/// Scenes of the committed fixtures and of the CommonRoad files beside the repository, where there are any.
fn recorded() -> Vec<Scene> {
    let fixtures = home().join("tests/fixtures");
    let folders =
        [fixtures.join("commonroad"), fixtures.join("scenarionet")].into_iter().chain(shared("data/commonroad"));
    let mut files: Vec<(String, Vec<u8>)> = folders.flat_map(|folder| files(&folder, "")).collect();
    files.retain(|(name, _)| name.ends_with(".xml") || name.ends_with(".pkl"));
    let scenes = import_files(&files).scenes;
    for format in ["commonroad-2018b", "commonroad-2020a", "scenarionet"] {
        assert!(scenes.iter().any(|scene| scene.origin.format == format), "no scene of {format}");
    }
    scenes
}

/// A generated crossing with what formats stumble over: ids that are markup, gaps, late and single samples.
fn hostile(mut scene: Scene) -> Scene {
    scene.id = "a \"<hostile>\" & ]]> ?> --> \u{1}\u{ffff} \u{1f600}'".into();
    for (ix, track) in scene.tracks.iter_mut().enumerate() {
        track.id = format!("<{ix}> \"&#0;/../{ix}");
        let (first, last) = track.span().unwrap();
        track.samples[(first + last) / 2] = None;
        if ix % 5 == 0 && track.span().is_some() {
            let only = track.span().unwrap().0;
            track.samples[only + 1..].fill(None);
        }
    }
    scene.tracks.retain(|track| track.span().is_some());
    scene.objects_of_interest.clear();
    for (ix, lane) in scene.road.lanes.iter_mut().enumerate() {
        lane.id = format!("]]>{ix}<?");
    }
    scene
        .crosswalks
        .push(scene.road.lanes[0].centre[..2].iter().chain(&scene.road.lanes[0].left[..1]).copied().collect());
    assert_eq!(scene.validate(), vec![]);
    scene
}

fn generated() -> Vec<Scene> {
    let options = SynthOptions {
        kinds: WorldKind::ALL.to_vec(),
        steps: 91,
        current_step: 10,
        warm_up_s: 15.0,
        tracks_per_scene: 24,
        pedestrian_share: 0.1,
        cyclist_share: 0.06,
        following_share: 0.3,
        ego_travel_m_min: 10.0,
        interaction_time_s_max: 4.0,
        interaction_gap_m_max: 15.0,
        attempts_max: 100,
        traffic: None,
    };
    let mut scenes: Vec<Scene> =
        (0..WorldKind::ALL.len()).map(|i| pool_member(&options, Seed(3), i).unwrap()).collect();
    let crossing = scenes[2].clone();
    scenes.push(hostile(crossing));
    // A scene of every traffic family of SafeBench, with its staging.
    let families = FamilyOptions { routes: vec![4], ..FamilyOptions::all() };
    scenes.extend((0..families.count()).map(|i| family_member(&families, Seed(3), i).unwrap()));
    scenes
}

/// All scenes, as logged and as played.
fn cases() -> &'static [(Scene, Option<Staging>)] {
    static CASES: OnceLock<Vec<(Scene, Option<Staging>)>> = OnceLock::new();
    CASES.get_or_init(|| {
        let scenes = recorded().into_iter().chain(generated());
        scenes.flat_map(|scene| [(scene.clone(), None), (scene.clone(), Some(braking(&scene)))]).collect()
    })
}

/// The scene that an export must give back.
fn as_exported(scene: &Scene, staging: Option<&Staging>) -> Scene {
    staging.map_or_else(|| scene.clone(), |staging| staging.applied_to(scene, &mut vec![]).unwrap())
}

fn keep(name: &str, bytes: &[u8]) {
    if let Some(folder) = named_folder("EVODRIVE_EXPORT_DIR") {
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join(name), bytes).unwrap();
    }
}

fn file_name(scene: &Scene) -> String {
    scene.id.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' }).collect()
}

/// The ego brakes at 2 m/s² from its start on; whoever interacts with it keeps the speed it had then.
fn braking(scene: &Scene) -> Staging {
    let from_step = scene.ego.start_step;
    let start = *scene.ego.track.at(from_step).unwrap();
    let count = (scene.steps - from_step).min(40);
    let along = |k: usize| {
        let (t, speed) = (k as f64 * 0.1, start.speed_mps());
        let until = t.min(0.5 * speed);
        let way = speed * until - until * until;
        let ahead = if speed > 0.0 { start.velocity * (1.0 / speed) } else { start.velocity };
        let velocity = ahead * (speed - 2.0 * until);
        Sample { position: start.position + ahead * way, heading_rad: start.heading_rad, velocity }
    };
    let keeps = |&track: &usize| {
        let first = *scene.tracks[track].at(from_step)?;
        let samples =
            (0..count).map(|k| Some(Sample { position: first.position + first.velocity * (k as f64 * 0.1), ..first }));
        Some((track, samples.collect()))
    };
    Staging {
        id: format!("{} played", scene.id),
        from_step,
        ego: Some((0..count).map(along).collect()),
        tracks: scene.objects_of_interest.iter().filter_map(keeps).collect::<BTreeMap<_, _>>(),
        inserted: vec![],
        last_step_share: Some(0.6),
    }
}

/// The scene of one file, whatever its format, as any importer would find it.
fn imported(name: &str, bytes: &[u8]) -> Scene {
    let mut found = import_files(&[(name, bytes)]);
    assert_eq!(found.left_out, vec![], "{name}");
    found.scenes.remove(0)
}

#[test]
fn exported_scenes_come_back_with_the_same_digest() {
    for (scene, staging) in cases() {
        let expected = as_exported(scene, staging.as_ref());
        let name = file_name(&expected);
        let xml = commonroad::export(scene, staging.as_ref()).unwrap();
        keep(&format!("{name}.xml"), &xml.bytes);
        assert_eq!(imported("f.xml", &xml.bytes).digest(), expected.digest(), "{}: CommonRoad", expected.id);
        let json = scenarionet::export(scene, staging.as_ref()).unwrap();
        keep(&format!("{name}.json"), &json.bytes);
        assert_eq!(imported("f.json", &json.bytes).digest(), expected.digest(), "{}: ScenarioNet", expected.id);
    }
}

#[test]
fn every_scene_has_an_openscenario_form() {
    for (scene, staging) in cases() {
        let expected = as_exported(scene, staging.as_ref());
        let name = file_name(&expected);
        let road_file = format!("{name}.xodr");
        for revision in [Revision::V1_0, Revision::V1_2] {
            let files = openscenario::export(scene, staging.as_ref(), &road_file, revision).unwrap();
            keep(&format!("{name}.xosc"), &files.xosc);
            keep(&road_file, &files.xodr);
            let text = String::from_utf8(files.xosc).unwrap();
            assert_eq!(text.matches("<ScenarioObject ").count(), expected.tracks.len() + 1, "{}", expected.id);
            assert!(text.contains(&road_file));
        }
    }
}

#[test]
fn commonroad_files_are_valid_by_the_schema() {
    let Some(schema) = shared("data/commonroad/XML_commonRoad_XSD.xsd") else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut files = Vec::new();
    for (number, (scene, staging)) in cases().iter().enumerate() {
        files.push(folder.path().join(format!("{number}.xml")));
        std::fs::write(&files[number], commonroad::export(scene, staging.as_ref()).unwrap().bytes).unwrap();
    }
    match Command::new("xmllint").arg("--noout").arg("--schema").arg(&schema).args(&files).output() {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            skip("xmllint is not installed (Debian: libxml2-utils)");
        }
        ran => {
            let ran = ran.unwrap();
            let printed = String::from_utf8_lossy(&ran.stderr);
            assert!(
                ran.status.success(),
                "{}",
                printed.lines().filter(|l| !l.ends_with("validates")).collect::<String>()
            );
            assert_eq!(printed.matches(" validates").count(), files.len());
        }
    }
}

/// Children of an element in the order that CommonRoad's schema asks for; `all` of them in any order where it does.
fn order_of(element: &str) -> &'static [&'static str] {
    match element {
        "commonRoad" => &[
            "location",
            "scenarioTags",
            "lanelet",
            "trafficSign",
            "trafficLight",
            "intersection",
            "staticObstacle",
            "dynamicObstacle",
            "planningProblem",
        ],
        "lanelet" => &[
            "leftBound",
            "rightBound",
            "predecessor",
            "successor",
            "adjacentLeft",
            "adjacentRight",
            "stopLine",
            "laneletType",
            "userOneWay",
            "userBidirectional",
            "trafficSignRef",
            "trafficLightRef",
        ],
        "leftBound" | "rightBound" | "stopLine" => &["point", "lineMarking"],
        "trafficSign" => &["trafficSignElement", "position", "virtual"],
        "trafficLight" => &["cycle", "position", "active"],
        "dynamicObstacle" => &["type", "shape", "initialState", "trajectory"],
        "staticObstacle" => &["type", "shape", "initialState"],
        "rectangle" => &["length", "width", "orientation", "center"],
        "planningProblem" => &["initialState", "goalState"],
        _ => &[],
    }
}

/// Checks what the schema asks for, apart from types of texts: order, ids, references, times.
fn check_structure(root: Element<'_>, name: &str) {
    let mut ids = BTreeSet::new();
    let mut open = vec![root];
    let mut references = Vec::new();
    while let Some(element) = open.pop() {
        let order = order_of(element.name());
        let places: Vec<Option<usize>> =
            element.children().map(|c| order.iter().position(|n| *n == c.name())).collect();
        assert!(order.is_empty() || places.iter().all(Option::is_some), "{name}: {}", element.place());
        assert!(order.is_empty() || places.is_sorted(), "{name}: {}", element.place());
        if let Some(id) = element.attribute("id") {
            assert!(id.parse::<u32>().is_ok_and(|id| id > 0) && ids.insert(id.to_string()), "{}", element.place());
        }
        references.extend(element.attribute("ref").map(str::to_string));
        if element.name() == "dynamicObstacle" {
            let step = |state: Element<'_>| state.child("time").unwrap().child("exact").unwrap().integer().unwrap();
            assert_eq!(step(element.child("initialState").unwrap()), 0);
            let steps: Vec<i64> = element.child("trajectory").unwrap().named("state").map(step).collect();
            assert!(!steps.is_empty() && steps[0] > 0 && steps.windows(2).all(|w| w[0] < w[1]), "{}", element.place());
        }
        if matches!(element.name(), "x" | "y" | "exact" | "length" | "width") {
            let plain = element.text().bytes().all(|b| b.is_ascii_digit() || matches!(b, b'-' | b'.'));
            assert!(plain, "{name}: {}: {} is no decimal", element.place(), element.text());
        }
        open.extend(element.children());
    }
    for reference in references {
        assert!(ids.contains(&reference), "{name}: nothing has the id {reference}");
    }
}

#[test]
fn commonroad_files_have_the_structure_that_the_schema_asks_for() {
    for (scene, staging) in cases() {
        let bytes = commonroad::export(scene, staging.as_ref()).unwrap().bytes;
        let document = Document::parse("f.xml", &bytes).unwrap();
        check_structure(document.root(), &scene.id);
    }
}

#[test]
fn what_commonroad_cannot_hold_is_said() {
    let scene = &generated()[2];
    let notes = commonroad::export(scene, None).unwrap().notes;
    let says = |what: &str, words: &str| notes.iter().any(|n| n.what.starts_with(what) && n.reason.contains(words));
    assert!(says("tracks[", "history before the ego's start"));
    assert!(says("ego", "route"));
    assert!(says("lights", "before the ego's start"));
}
