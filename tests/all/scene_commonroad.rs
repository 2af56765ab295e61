//! CommonRoad import on written fixtures, on damaged ones, and on the recorded files where they are at hand.

use crate::harness::{files, shared, text};
use evodrive::kernel::{Polyline, Vec2};
use evodrive::scene::{AgentKind, LaneGraph, LightState, Scene, SceneFeatures, usable};
use evodrive::{
    formats::commonroad::read as commonroad,
    formats::{Imported, import_files},
};

fn fixture(name: &str) -> String {
    text(&format!("tests/fixtures/commonroad/{name}"))
}

fn imported(name: &str) -> Imported {
    commonroad::import(name, fixture(name).as_bytes()).unwrap()
}

#[test]
fn a_2018b_file_gives_a_scene_per_problem_in_a_frame_at_the_ego() {
    let imported = imported("two_lanes_2018b.xml");
    assert_eq!(imported.scenes.len(), 1);
    let scene = &imported.scenes[0];
    assert_eq!(scene.validate(), vec![]);
    assert_eq!(scene.id, "XXX_TwoLanes-1_1_T-1#100");
    assert_eq!(scene.origin.format, "commonroad-2018b");
    let ego = scene.ego.track.at(0).unwrap();
    assert_eq!((ego.position, ego.heading_rad), (Vec2::ZERO, 0.01));
    assert_eq!(scene.ego.target_speed_mps, Some(13.5));
    assert_eq!(scene.road.lanes[0].centre[0], Vec2::new(-10.0, 0.25));
    assert_eq!((scene.road.lanes[0].exits.clone(), scene.road.lanes[2].entries.clone()), (vec![2], vec![0]));
    assert!(scene.road.lanes[0].left_neighbours.iter().any(|n| n.lane == 1 && n.same_direction));
}

#[test]
fn steps_of_a_fifth_of_a_second_are_interpolated_and_regions_stand_for_their_middle() {
    let scene = &imported("two_lanes_2018b.xml").scenes[0];
    let car = scene.tracks.iter().find(|t| t.id == "10").unwrap();
    assert!((car.at(1).unwrap().position.x - 21.0).abs() < 1e-9);
    assert_eq!(car.span(), Some((0, 40)));
    let truck = scene.tracks.iter().find(|t| t.id == "11").unwrap();
    assert!(truck.at(10).unwrap().position.distance(Vec2::new(8.0, 3.75)) < 1e-9);
    assert!((truck.at(10).unwrap().speed_mps() - 8.0).abs() < 1e-9);
    let cone = scene.tracks.iter().find(|t| t.id == "12").unwrap();
    assert_eq!((cone.kind, cone.length_m, cone.span()), (AgentKind::Static, 1.2, Some((0, scene.steps - 1))));
}

#[test]
fn what_is_left_out_is_named_with_its_reason() {
    let imported = imported("two_lanes_2018b.xml");
    let left_out: Vec<String> = imported.left_out.iter().map(|l| format!("{}: {}", l.what, l.reason)).collect();
    assert_eq!(left_out.len(), 2);
    assert!(left_out[0].contains("obstacle 13") && left_out[0].contains("occupancies"), "{}", left_out[0]);
    assert!(left_out[1].contains("#101") && left_out[1].contains("does not start in a lane"), "{}", left_out[1]);
}

#[test]
fn the_route_changes_into_the_goal_s_lane_without_a_jump() {
    let scene = &imported("two_lanes_2018b.xml").scenes[0];
    let route = Polyline::new(scene.ego.route.clone()).unwrap();
    assert_eq!(route.points()[0], Vec2::ZERO);
    assert!(route.project(Vec2::new(90.0, 3.75)).offset_m.abs() < 0.1, "it passes the goal region");
    let turns = route.points().windows(3).map(|w| ((w[2] - w[1]).heading() - (w[1] - w[0]).heading()).abs());
    assert!(turns.fold(0.0, f64::max) < 0.1);
}

#[test]
fn a_2020a_file_gives_lights_signs_crosswalks_and_shapes() {
    let scene = &imported("crossing_2020a.xml").scenes[0];
    assert_eq!(scene.validate(), vec![]);
    let light = &scene.lights[0];
    assert_eq!((light.lane, light.stop_point), (0, Vec2::new(42.0, -0.2)));
    let changes: Vec<(usize, LightState)> = (1..scene.steps)
        .filter(|&k| light.states[k] != light.states[k - 1])
        .map(|k| (k, light.states[k]))
        .take(3)
        .collect();
    assert_eq!(changes, [(5, LightState::Stop), (30, LightState::Go), (70, LightState::Caution)]);
    assert_eq!(scene.stop_signs.len(), 1);
    assert_eq!((scene.stop_signs[0].position, scene.stop_signs[0].lanes.clone()), (Vec2::new(50.0, -9.2), vec![3]));
    assert_eq!(scene.crosswalks.len(), 1);
    assert_eq!(scene.road.lanes[0].speed_limit_mps, Some(8.33));
    let parked = scene.tracks.iter().find(|t| t.id == "60").unwrap();
    assert!(parked.at(0).unwrap().position.distance(Vec2::new(20.0, 5.8)) < 1e-9, "the middle of its polygon");
    assert_eq!((parked.length_m, parked.width_m), (4.0, 1.8));
    assert_eq!(scene.tracks.iter().find(|t| t.id == "62").unwrap().kind, AgentKind::Pedestrian);
    let features = SceneFeatures::of(scene, &LaneGraph::of(&scene.road));
    assert!(features.is_junction && features.has_light);
    assert_eq!(features.conflict_count, 1.0);
}

#[test]
fn a_recorded_file_imports_twice_to_one_digest() {
    let one = imported("ZAM_Tutorial-1_2_T-1.xml");
    assert_eq!(one.scenes.len(), 1);
    assert_eq!(one.scenes[0].digest(), imported("ZAM_Tutorial-1_2_T-1.xml").scenes[0].digest());
    assert_eq!(one.scenes[0].tracks.len(), 3);
}

#[test]
fn every_truncation_is_refused_by_place() {
    let whole = fixture("crossing_2020a.xml");
    for end in (0..whole.len() - 2).step_by(61) {
        let error = commonroad::import("cut.xml", &whole.as_bytes()[..end]).unwrap_err();
        assert_eq!(error.file, "cut.xml");
        assert!(!error.place.is_empty() && !error.remedy.is_empty(), "{error}");
    }
}

/// Returns what is said of a fixture in which one text is replaced everywhere: why it is refused, or what is left out.
fn refused(name: &str, from: &str, to: &str) -> String {
    let text = fixture(name);
    assert!(text.contains(from), "{from}");
    let sentences = |imported: Imported| imported.left_out.iter().map(|left| format!("{left:?}\n")).collect();
    commonroad::import(name, text.replace(from, to).as_bytes()).map_or_else(|error| error.to_string(), sentences)
}

#[test]
fn what_is_inconsistent_is_named_with_element_and_rule() {
    let file = "crossing_2020a.xml";
    let found = refused(file, r#"successor ref="2""#, r#"successor ref="77""#);
    assert!(found.contains("lanelet 1/successor") && found.contains("77"), "{found}");
    let found = refused(file, r#"successor ref="2""#, r#"successor ref="1""#);
    assert!(found.contains("another lanelet than itself"), "{found}");
    let found = refused(file, r#"staticObstacle id="60""#, r#"staticObstacle id="61""#);
    assert!(found.contains("already taken"), "{found}");
    assert!(refused(file, "<x>-50</x>", "<x>NaN</x>").contains("finite number"));
    assert!(refused(file, "<x>-50</x>", "<x>1e400</x>").contains("finite number"));
    assert!(refused(file, "2020a", "2017a").contains("2018b or 2020a"));
    assert!(refused(file, r#"timeStepSize="0.1""#, r#"timeStepSize="0""#).contains("timeStepSize"));
    assert!(refused(file, "commonRoad ", "openRoad ").contains("well-formed"));
    assert!(refused(file, "<duration>20<", "<duration>1000000000000<").contains("duration"));
    assert!(refused(file, "<time><exact>7<", "<time><exact>3<").contains("after the state before"));
    let found = refused(file, "<point><x>-30</x><y>1.75</y></point>", "");
    assert!(found.contains("as many left as right"), "{found}");
}

#[test]
fn far_coordinates_are_left_out() {
    let text = fixture("crossing_2020a.xml").replace("<x>80</x>", "<x>8e9</x>");
    let imported = commonroad::import("far.xml", text.as_bytes()).unwrap();
    assert_eq!(imported.scenes.len(), 0, "the lanelet of the goal has one point left");
    assert!(imported.left_out.iter().any(|l| l.reason.contains("100 km")), "{:?}", imported.left_out);
}

#[test]
fn one_bad_file_stops_no_other_and_an_id_is_taken_once() {
    let good = fixture("crossing_2020a.xml");
    let other = good.replace("<x>-50</x>", "<x>-40</x>");
    let files = [
        ("bad.xml", "<commonRoad".to_string()),
        ("good.xml", good.clone()),
        ("copy.xml", good),
        ("clash.xml", other),
        ("what.bin", "\u{1}\u{2}".into()),
        ("osm.xml", "<osm/>".into()),
    ];
    let summary = import_files(&files);
    assert_eq!(summary.scenes.len(), 1);
    let reason = |file: &str| summary.left_out.iter().filter(|l| l.file == file).map(|l| l.reason.as_str()).next_back();
    assert!(reason("bad.xml").is_some_and(|r| r.contains("line 1")));
    assert!(reason("copy.xml").is_some_and(|r| r.contains("already read from good.xml")));
    assert!(reason("clash.xml").is_some_and(|r| r.contains("taken by a different scene of good.xml")));
    assert!(reason("what.bin").is_some() && reason("osm.xml").is_some());
}

#[test]
fn the_recorded_files_import_and_the_usable_ones_are_known() {
    let Some(folder) = shared("data/commonroad") else { return };
    let summary = import_files(&files(&folder, ".xml"));
    let mut usable_ids = vec![];
    for scene in &summary.scenes {
        let graph = LaneGraph::of(&scene.road);
        let features = SceneFeatures::of(scene, &graph);
        let route = Polyline::new(scene.ego.route.clone()).unwrap();
        println!(
            "{} steps {} route {:.1} m tracks {} tags {:?} usable {:?} conflicts {} curv {:.3}",
            scene.id,
            scene.steps,
            route.length_m(),
            scene.tracks.len(),
            features.tags,
            usable(scene).map_err(|e| e.to_string()),
            features.conflict_count,
            features.route_curvature_max_1pm
        );
        on_the_road(scene, &graph);
        if usable(scene).is_ok() {
            usable_ids.push(scene.id.as_str());
        }
    }
    for left in &summary.left_out {
        println!("{} {}: {}", left.file, left.what, left.reason);
    }
    for needed in [
        "USA_US101-3_3",
        "USA_US101-4_1",
        "USA_Lanker-1_1",
        "USA_Peach-4_8",
        "DEU_A9-3_1",
        "ARG_Carcarana-4_5",
        "FRA_Anglet-1_1",
    ] {
        assert!(usable_ids.iter().any(|id| id.starts_with(needed)), "{needed}");
    }
    let reason = |file: &str| summary.left_out.iter().find(|l| l.file.starts_with(file)).map(|l| l.reason.as_str());
    assert!(reason("DEU_Starnberg").is_some_and(|r| r.contains("no planning problem")));
    assert!(reason("ZAM_Tutorial-1_2").is_some_and(|r| r.contains("id is already taken")));
}

/// Routes stay on the road, and so do most recorded vehicles.
fn on_the_road(scene: &Scene, graph: &LaneGraph) {
    let off = scene.ego.route.iter().map(|p| graph.off_road_m(*p)).fold(0.0, f64::max);
    assert!(off < 0.5, "{}: the route leaves the road by {off} m", scene.id);
    let places: Vec<Vec2> = scene.tracks.iter().flat_map(|t| t.samples.iter().flatten()).map(|s| s.position).collect();
    let beside = places.iter().filter(|p| graph.off_road_m(**p) > 1.0).count();
    assert!(beside * 10 <= places.len(), "{}: {beside} of {} samples beside the road", scene.id, places.len());
}
