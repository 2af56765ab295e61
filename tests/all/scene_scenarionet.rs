//! ScenarioNet import: a hand-made scene in several pickle protocols, damaged ones, and nuScenes samples where they
//! are at hand.

use crate::harness::{files, home, shared};
use evodrive::kernel::{Polyline, Vec2};
use evodrive::scene::{AgentKind, LaneGraph, LaneKind, LeftOut, LightState, SceneFeatures, usable};
use evodrive::{
    formats::scenarionet::read_pickle as scenarionet,
    formats::{Imported, import_files},
};

fn fixture(name: &str) -> Vec<u8> {
    std::fs::read(home().join("tests/fixtures/scenarionet").join(name)).unwrap()
}

fn imported(name: &str) -> Imported {
    scenarionet::import(name, &fixture(name)).unwrap()
}

#[test]
fn the_waymo_form_becomes_a_scene_around_the_ego_s_present() {
    let imported = imported("waymo_form_4.pkl");
    let scene = &imported.scenes[0];
    assert_eq!(scene.validate(), vec![]);
    assert_eq!((scene.id.as_str(), scene.steps, scene.current_step), ("fixture-waymo-form", 91, 10));
    assert_eq!(scene.ego.track.at(10).unwrap().position, Vec2::ZERO);
    assert!(scene.ego.track.at(0).unwrap().position.distance(Vec2::new(-10.0, 0.0)) < 1e-9);
    assert!((Polyline::new(scene.ego.route.clone()).unwrap().length_m() - 90.0).abs() < 1e-6);
    assert_eq!(scene.objects_of_interest, [0]);
    let walker = scene.tracks.iter().find(|t| t.id == "3").unwrap();
    assert_eq!((walker.kind, walker.span()), (AgentKind::Pedestrian, Some((5, 39))));
    assert!((scene.tracks[0].length_m - 4.6).abs() < 1e-6);
    assert_eq!(usable(scene), Ok(()));
}

#[test]
fn lanes_keep_links_kinds_and_believable_widths() {
    let imported = imported("waymo_form_4.pkl");
    let road = &imported.scenes[0].road;
    let lane = |id: &str| road.lanes.iter().position(|lane| lane.id == id).unwrap();
    assert_eq!(road.lanes[lane("100")].exits, [lane("101")], "a link out of the map is no link");
    assert!(road.lanes[lane("100")].left_neighbours.iter().any(|n| n.lane == lane("102") && n.same_direction));
    assert_eq!(road.lanes[lane("103")].kind, LaneKind::Freeway);
    assert!((road.lanes[lane("100")].speed_limit_mps.unwrap() - 11.176).abs() < 1e-9);
    let first = &road.lanes[lane("100")];
    let across: Vec<f64> = first.left.iter().zip(&first.right).map(|(l, r)| l.distance(*r)).collect();
    assert!(across.iter().all(|w| (2.6..=5.0).contains(w)), "{across:?}");
    assert_eq!((road.edges.len(), road.edges[0].len()), (1, 2), "a straight edge needs two points");
    let left_out: Vec<&str> = imported.left_out.iter().map(|l| l.what.as_str()).collect();
    assert_eq!(left_out, ["its kinds", "track 4", "lane 104", "light of lane 999"]);
}

#[test]
fn lights_signs_and_crosswalks_are_read() {
    let scene = &imported("waymo_form_4.pkl").scenes[0];
    let light = &scene.lights[0];
    assert!(light.stop_point.distance(Vec2::new(40.0, 0.0)) < 1e-3);
    assert_eq!(
        (light.states[39], light.states[40], light.states[41]),
        (LightState::Stop, LightState::Unknown, LightState::Go)
    );
    assert_eq!((scene.stop_signs.len(), scene.stop_signs[0].lanes.len(), scene.crosswalks.len()), (1, 1, 1));
    let features = SceneFeatures::of(scene, &LaneGraph::of(&scene.road));
    assert!(features.has_light && features.is_junction);
    assert_eq!(features.conflict_count, 1.0);
}

#[test]
fn every_pickle_protocol_gives_the_same_scene() {
    let digest = |name: &str| imported(name).scenes[0].digest();
    assert_eq!(digest("waymo_form_2.pkl"), digest("waymo_form_4.pkl"));
    assert_eq!(digest("waymo_form_5.pkl"), digest("waymo_form_4.pkl"));
}

#[test]
fn every_truncation_is_refused() {
    for name in ["waymo_form_2.pkl", "waymo_form_5.pkl"] {
        let whole = fixture(name);
        for end in (0..whole.len()).step_by(211) {
            assert!(scenarionet::import(name, &whole[..end]).is_err(), "{name} {end}");
        }
    }
}

#[test]
fn flipped_bytes_never_panic_and_never_give_an_unsound_scene() {
    let whole = fixture("waymo_form_4.pkl");
    for at in (0..whole.len()).step_by(53) {
        let mut damaged = whole.clone();
        damaged[at] = damaged[at].wrapping_add(1 + (at % 255) as u8);
        if let Ok(imported) = scenarionet::import("damaged.pkl", &damaged) {
            assert!(imported.scenes.iter().all(|scene| scene.validate().is_empty()), "{at}");
        }
    }
}

/// The first place where `from` stands becomes `to`.
fn changed(from: &[u8], to: &[u8]) -> Vec<u8> {
    let mut bytes = fixture("waymo_form_4.pkl");
    let at = bytes.windows(from.len()).position(|window| window == from).unwrap();
    bytes[at..at + from.len()].copy_from_slice(to);
    bytes
}

#[test]
fn what_a_scene_needs_and_does_not_find_is_named() {
    let refusal = |bytes: &[u8]| scenarionet::import("f.pkl", bytes).unwrap_err().to_string();
    assert!(refusal(&changed(b"tracks\x94", b"trucks\x94")).contains("\"tracks\""));
    assert!(refusal(&changed(b"sdc_id", b"sdc_iq")).contains("sdc_id"));
    assert!(refusal(&changed(b"position", b"positiom")).contains("[\"tracks\"][\"1\"][\"state\"]"), "the ego's");
    let nan = scenarionet::import("f.pkl", &changed(&8000.0f64.to_le_bytes(), &f64::NAN.to_le_bytes())).unwrap();
    let dropped = |left: &LeftOut| left.what == "1 samples of track 1";
    assert!(nan.scenes.len() == 1 && nan.left_out.iter().any(dropped), "{:?}", nan.left_out);
    let forbidden = refusal(&changed(b"_reconstruct", b"_reconstrucT"));
    assert!(forbidden.contains("numpy.core.multiarray._reconstrucT"), "{forbidden}");
}

#[test]
fn recorded_nuscenes_scenes_import_with_recovered_topology() {
    let Some(folder) = shared("data/scenarionet_nuscenes") else { return };
    let files = files(&folder, "");
    let summary = import_files(&files);
    for left in &summary.left_out {
        println!("{} {}: {}", left.file, left.what, left.reason);
    }
    assert_eq!(summary.scenes.len(), files.len());
    for scene in &summary.scenes {
        let graph = LaneGraph::of(&scene.road);
        let features = SceneFeatures::of(scene, &graph);
        let linked = scene.road.lanes.iter().filter(|lane| !lane.exits.is_empty()).count();
        let beside = scene.road.lanes.iter().filter(|lane| !lane.left_neighbours.is_empty()).count();
        println!(
            "{}: steps {}, lanes {} ({linked} lead on, {beside} have neighbours), tracks {}, {features:?}, {:?}",
            scene.id,
            scene.steps,
            scene.road.lanes.len(),
            scene.tracks.len(),
            usable(scene)
        );
        assert!(linked * 3 > scene.road.lanes.len() * 2, "{}: {linked} lanes lead on", scene.id);
        let route = &scene.ego.route;
        let off = route.iter().filter(|p| graph.off_road_m(**p) > 0.5).count();
        assert!(off * 10 <= route.len(), "{}: {off} of {} route points off the road", scene.id, route.len());
    }
}
