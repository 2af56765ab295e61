//! Properties that every exporter must keep, tested on generated worlds of every kind and on hostile scenes.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

use super::openscenario::Revision::{V1_0, V1_2};
use super::scenarionet::read_json as scenarionet_import;
use super::xml_read::{Document, Element};
use super::*;
use crate::kernel::{Seed, Vec2};
use crate::scene::fixture::two_lane_scene;
use crate::scene::{AgentKind, LaneKind, Light, LightState, Neighbour, Sample, Scene, StopSign, TrackIx};
use crate::synth::{SynthOptions, WorldKind, pool_member};

/// One scene of every kind of world, kept for all tests.
pub(super) fn worlds() -> &'static [Scene] {
    static WORLDS: OnceLock<Vec<Scene>> = OnceLock::new();
    WORLDS.get_or_init(|| {
        let options = SynthOptions {
            kinds: WorldKind::ALL.to_vec(),
            steps: 61,
            current_step: 10,
            warm_up_s: 12.0,
            tracks_per_scene: 16,
            pedestrian_share: 0.15,
            cyclist_share: 0.1,
            following_share: 0.3,
            ego_travel_m_min: 8.0,
            interaction_time_s_max: 5.0,
            interaction_gap_m_max: 20.0,
            attempts_max: 200,
            traffic: None,
        };
        (0..WorldKind::ALL.len()).map(|i| pool_member(&options, Seed(7), i).unwrap()).collect()
    })
}

/// A scene with everything that is difficult for a format: gaps, late and single samples, ids that are not names,
/// lights, signs and crosswalks.
pub(super) fn awkward() -> Scene {
    let mut scene = two_lane_scene();
    scene.id = "a \"<scene>\" & ]]> ?> --> \u{0}\u{1f}\u{ffff} \u{1f600}'".into();
    scene.origin.name = "\u{8}<!-- ".into();
    scene.current_step = 5;
    scene.ego.start_step = 3;
    scene.ego.track.id = "ego\" x=\"<?".into();
    scene.ego.track.samples[40] = None;
    scene.ego.target_speed_mps = Some(0.1 + 0.2);
    scene.tracks[0].id = "../../etc/passwd&#0;".into();
    scene.tracks[0].samples[20] = None;
    scene.tracks[0].samples[21] = None;
    scene.tracks[1].id = String::new();
    scene.tracks[1].samples[..30].fill(None);
    let mut once = scene.tracks[0].clone();
    once.id = "7".into();
    once.kind = AgentKind::Pedestrian;
    once.samples.fill(None);
    once.samples[3] = Some(Sample { heading_rad: -1e-17, velocity: Vec2::new(-0.3, 1e-300), ..Sample::default() });
    let mut history = once.clone();
    history.id = "07".into();
    history.kind = AgentKind::Cyclist;
    history.samples.swap(0, 3);
    let mut cone = two_lane_scene().tracks[0].clone();
    cone.id = "cone".into();
    cone.kind = AgentKind::Static;
    cone.samples.fill(Some(Sample { position: Vec2::new(1.0 / 3.0, -2.5), ..Sample::default() }));
    let mut rolling = two_lane_scene().tracks[1].clone();
    rolling.id = "rolling cone".into();
    rolling.kind = AgentKind::Static;
    scene.tracks.extend([once, history, cone, rolling]);
    scene.objects_of_interest = vec![5, 0];
    let lanes = &mut scene.road.lanes;
    lanes[0].id = "1".into();
    lanes[1].id = "__edge_0".into();
    lanes[2].id = "</lanelet>".into();
    lanes[3].id = "-5".into();
    lanes[1].kind = LaneKind::Bike;
    lanes[2].kind = LaneKind::Freeway;
    lanes[3].kind = LaneKind::Other;
    lanes[3].speed_limit_mps = None;
    lanes[3].right_neighbours =
        vec![Neighbour { lane: 2, same_direction: false }, Neighbour { lane: 0, same_direction: true }];
    lanes[2].centre[1] = lanes[2].centre[0];
    lanes[2].left[1] = lanes[2].left[0];
    lanes[2].right[1] = lanes[2].right[0];
    scene.road.edges = vec![vec![Vec2::new(0.0, -1.75), Vec2::new(100.0, -1.75)], vec![Vec2::ZERO, Vec2::ZERO]];
    let states = (0..60).map(|k| [LightState::Go, LightState::Caution, LightState::Stop, LightState::Unknown][k / 15]);
    let light = Light { lane: 0, stop_point: Vec2::new(98.0, 0.1), states: states.collect() };
    scene.lights = vec![light.clone(), light];
    scene.stop_signs = vec![
        StopSign { position: Vec2::new(99.0, -4.0), lanes: vec![0, 1] },
        StopSign { position: Vec2::new(9.0, -4.0), lanes: vec![] },
    ];
    scene.crosswalks = vec![
        vec![Vec2::new(50.0, -3.0), Vec2::new(53.0, -3.0), Vec2::new(53.0, 6.0), Vec2::new(50.0, 6.0)],
        vec![Vec2::ZERO, Vec2::new(1.0, 0.0), Vec2::new(0.0, 1.0)],
    ];
    assert_eq!(scene.validate(), vec![]);
    scene
}

/// A scene whose ego comes after the current step and is then lost for a while.
fn late_ego() -> Scene {
    let mut scene = two_lane_scene();
    scene.ego.start_step = 9;
    scene.ego.track.samples[..9].fill(None);
    scene.ego.track.samples[30..40].fill(None);
    assert_eq!(scene.validate(), vec![]);
    scene
}

/// The changes of a rollout: the ego brakes, its object of interest swerves, a new road user crosses.
pub(super) fn staging_of(scene: &Scene) -> Staging {
    let from_step = scene.ego.start_step;
    let start = *scene.ego.track.at(from_step).unwrap();
    let moved = |from: Sample, turn_rad: f64, count: usize| {
        let velocity = from.velocity.rotated(turn_rad) * 0.8;
        let along = move |k: usize| Sample {
            position: from.position + velocity * (k as f64 * 0.1),
            heading_rad: from.heading_rad + turn_rad,
            velocity,
        };
        (0..count).map(along).collect::<Vec<_>>()
    };
    let count = (scene.steps - from_step).min(25);
    let other: TrackIx = *scene.objects_of_interest.first().unwrap_or(&0);
    let from = scene.tracks[other].samples.iter().flatten().next().copied().unwrap();
    let aside =
        Sample { position: start.position + Vec2::new(12.0, 9.0), heading_rad: -1.0, velocity: Vec2::new(1.0, -1.5) };
    Staging {
        id: format!("{} as played", scene.id),
        from_step,
        ego: Some(moved(start, 0.0, count)),
        tracks: BTreeMap::from([(other, moved(from, 0.05, count).into_iter().map(Some).collect())]),
        inserted: vec![Inserted {
            kind: AgentKind::Pedestrian,
            length_m: 0.6,
            width_m: 0.7,
            samples: moved(aside, 0.0, count).into_iter().enumerate().map(|(k, s)| (k > 4).then_some(s)).collect(),
        }],
        last_step_share: Some(0.4),
    }
}

#[test]
fn a_staged_scene_moves_as_played_and_ends_with_the_rollout() {
    let scene = &worlds()[0];
    let staging = staging_of(scene);
    let mut notes = vec![];
    let played = staging.applied_to(scene, &mut notes).unwrap();
    assert_eq!(played.validate(), vec![]);
    assert_eq!(played.steps, scene.ego.start_step + 25);
    assert_eq!(played.ego.track.at(3), scene.ego.track.at(3), "history stays");
    let ego = staging.ego.as_ref().unwrap();
    assert_eq!(played.ego.track.at(20), Some(&ego[10]));
    let last = played.ego.track.samples.last().unwrap().unwrap();
    let carried = ego[24].position + ego[24].velocity * (0.6 * 0.1);
    assert!(last.position.distance(carried) < 1e-12, "the rest of the step at its own velocity");
    let new = played.tracks.last().unwrap();
    assert_eq!((new.kind, new.span()), (AgentKind::Pedestrian, Some((15, 34))));
}

#[test]
fn a_staging_that_does_not_fit_is_refused() {
    let scene = &worlds()[0];
    let refused = |change: fn(&mut Staging)| {
        let mut staging = staging_of(scene);
        change(&mut staging);
        staging.applied_to(scene, &mut vec![]).unwrap_err()
    };
    let is_staging = |error: ExportError| matches!(error, ExportError::Staging { .. });
    assert!(is_staging(refused(|s| {
        s.tracks.insert(usize::MAX, vec![]);
    })));
    assert!(is_staging(refused(|s| s.from_step = usize::MAX)));
    assert!(is_staging(refused(|s| s.last_step_share = Some(f64::NAN))));
    assert!(is_staging(refused(|s| s.ego = Some(vec![Sample::default(); 5000]))));
    assert!(matches!(refused(|s| s.inserted[0].width_m = f64::NAN), ExportError::Unsound { .. }));
}

#[test]
fn scenarionet_json_gives_back_every_scene() {
    for scene in worlds().iter().cloned().chain([two_lane_scene(), awkward(), late_ego()]) {
        let exported = scenarionet::export(&scene, None).unwrap();
        let back = scenarionet_import::import("f.json", &exported.bytes).unwrap();
        assert_eq!(back.left_out, vec![], "{}", scene.id);
        assert_eq!(back.scenes[0].digest(), scene.digest(), "{}", scene.id);
        let pickled = scenarionet::pickled(&exported.bytes).unwrap();
        let back = scenarionet::read_pickle::import("f.pkl", &pickled.bytes).unwrap();
        assert_eq!((back.left_out, back.scenes[0].digest()), (vec![], scene.digest()), "{}", scene.id);
    }
}

#[test]
fn a_data_set_counts_what_its_scenes_hold_and_is_imported_as_no_scene() {
    let exported = scenarionet::export(&awkward(), None).unwrap();
    let scenarionet::Pickled { summary, bytes } = scenarionet::pickled(&exported.bytes).unwrap();
    // The pickle and the list hold the same summary: MetaDrive's curriculum reads the pickle.
    let pickle = scenarionet::pickle::read("f.pkl", &bytes).unwrap();
    let metadata = pickle.root().get("metadata").unwrap();
    let moved = |id: &str| metadata.get("object_summary")?.get(id)?.get("moving_distance")?.number();
    for (id, listed) in summary["object_summary"].as_object().unwrap() {
        assert_eq!(moved(id), listed["moving_distance"].as_f64(), "{id}");
    }
    let objects = metadata.get("number_summary").and_then(|counts| counts.get("num_objects")?.number());
    assert_eq!(objects, summary["number_summary"]["num_objects"].as_f64());
    let counts = &summary["number_summary"];
    assert_eq!((&counts["num_objects"], &counts["num_objects_each_type"]["OTHER"]), (&7.into(), &2.into()));
    assert_eq!(counts["num_traffic_light_each_step"]["LANE_STATE_CAUTION"], 30);
    let gapped = &summary["object_summary"]["../../etc/passwd&#0;"];
    let seen = ["track_length", "valid_length", "continuous_valid_length"].map(|key| gapped[key].as_u64().unwrap());
    assert_eq!(seen, [60, 58, 20]);
    assert!(summary.get("evodrive").is_none() && summary["sdc_id"] == "ego\" x=\"<?");
    let mut set = scenarionet::DataSet::default();
    assert_eq!(set.files(), vec![]);
    set.add("sd_a.pkl", summary);
    for (name, bytes) in set.files() {
        let read = scenarionet::read_pickle::import(name, &bytes).unwrap();
        assert!(read.scenes.is_empty() && read.left_out[0].reason.contains("data set"), "{name}");
    }
}

#[test]
fn scenarionet_json_holds_the_motion_in_its_standard_keys() {
    let scene = &worlds()[2];
    let exported = scenarionet::export(scene, None).unwrap();
    let mut value: serde_json::Value = serde_json::from_slice(&exported.bytes).unwrap();
    value["metadata"]["evodrive"] = serde_json::Value::Null;
    let foreign = scenarionet_import::import("f.json", &serde_json::to_vec(&value).unwrap()).unwrap();
    let back = &foreign.scenes[0];
    assert_eq!(back.validate(), vec![]);
    assert_eq!((back.steps, back.current_step, back.tracks.len()), (scene.steps, 10, scene.tracks.len()));
    let here = scene.ego.track.at(10).unwrap().position;
    for (read, track) in back.tracks.iter().map(|t| (t, scene.tracks.iter().find(|s| s.id == t.id).unwrap())) {
        for (a, b) in read.samples.iter().zip(&track.samples) {
            assert_eq!(a.map(|s| (s.position, s.velocity)), b.map(|s| (s.position - here, s.velocity)));
        }
    }
    let seen = value["tracks"][&scene.tracks[0].id]["state"]["valid"].as_array().unwrap();
    assert_eq!(seen.len(), scene.steps);
}

#[test]
fn an_edited_scenarionet_export_is_read_by_its_standard_keys_and_says_so() {
    let scene = &worlds()[0];
    let exported = scenarionet::export(scene, None).unwrap();
    let mut value: serde_json::Value = serde_json::from_slice(&exported.bytes).unwrap();
    value["tracks"][&scene.tracks[0].id]["state"]["position"][30][0] = 12.5.into();
    let back = scenarionet_import::import("f.json", &serde_json::to_vec(&value).unwrap()).unwrap();
    assert_eq!(back.left_out[0].what, "metadata.evodrive");
    let track = back.scenes[0].tracks.iter().find(|t| t.id == scene.tracks[0].id).unwrap();
    // As in any description, the ego's place is the origin.
    let here = scene.ego.track.at(scene.current_step).unwrap().position;
    assert_eq!(track.samples[30].map(|s| s.position.x), Some(12.5 - here.x));
}

#[test]
fn hostile_scenarionet_json_is_refused_with_its_place() {
    let refused = |text: &str| scenarionet_import::import("f.json", text.as_bytes()).unwrap_err().to_string();
    assert!(refused("{\"id\": NaN").contains("line 1"));
    let head = |length: &str| {
        format!(
            r#"{{"id": "a", "length": {length}, "metadata": {{"sdc_id": 1}}, "tracks": {{}}, "map_features": {{}}}}"#
        )
    };
    assert!(refused(&head("1000000000000")).contains("length"));
    assert!(refused(&head("91")).contains("sdc_id"));
    assert!(refused(r#"{"id": "a", "metadata": {"evodrive": "{}"}}"#).contains("length"));
}

#[test]
fn commonroad_gives_back_every_scene() {
    for scene in worlds().iter().cloned().chain([two_lane_scene(), awkward(), late_ego()]) {
        let exported = commonroad::export(&scene, None).unwrap();
        let back = commonroad::import("f.xml", &exported.bytes).unwrap();
        assert_eq!(back.left_out, vec![], "{}", scene.id);
        assert_eq!(back.scenes[0].digest(), scene.digest(), "{}", scene.id);
    }
}

#[test]
fn every_sign_and_light_of_commonroad_stands_somewhere_and_a_lanelet_refers_to_it() {
    // Three lanes in a ring with one speed limit: none of them is the first with its sign.
    let mut ring = awkward();
    for (ix, lane) in ring.road.lanes.iter_mut().take(3).enumerate() {
        (lane.entries, lane.exits, lane.speed_limit_mps) = (vec![(ix + 2) % 3], vec![(ix + 1) % 3], Some(7.0));
    }
    (ring.road.lanes[3].entries, ring.road.lanes[3].exits) = (vec![], vec![]);
    assert_eq!(ring.validate(), vec![]);
    let exported = commonroad::export(&ring, None).unwrap();
    let document = Document::parse("f.xml", &exported.bytes).unwrap();
    let everything = everything(document.root());
    for (element, by) in [("trafficSign", "trafficSignRef"), ("trafficLight", "trafficLightRef")] {
        let referred = ids(document.root(), by, "ref");
        let all: Vec<_> = everything.iter().filter(|e| e.name() == element).collect();
        assert!(!all.is_empty());
        for one in all {
            assert!(
                referred.contains(one.attribute("id").unwrap()) && one.child("position").is_some(),
                "{}",
                one.place()
            );
        }
    }
    assert!(exported.notes.iter().any(|note| note.reason.contains("for no lane")));
    assert_eq!(commonroad::import("f.xml", &exported.bytes).unwrap().scenes[0].digest(), ring.digest());
}

#[test]
fn commonroad_gives_back_a_scene_as_played() {
    for scene in worlds().iter().chain([&awkward()]) {
        let staging = staging_of(scene);
        let played = staging.applied_to(scene, &mut vec![]).unwrap();
        let exported = commonroad::export(scene, Some(&staging)).unwrap();
        let back = commonroad::import("f.xml", &exported.bytes).unwrap();
        assert_eq!(back.scenes[0].digest(), played.digest(), "{}", scene.id);
    }
}

#[test]
fn an_edited_commonroad_export_is_read_by_its_elements_and_says_so() {
    let scene = &worlds()[0];
    let text = String::from_utf8(commonroad::export(scene, None).unwrap().bytes).unwrap();
    let at = text.find("<trajectory>").unwrap();
    let from = at + text[at..].find("<x>").unwrap() + 3;
    let to = from + text[from..].find("</x>").unwrap();
    let edited = format!("{}{}{}", &text[..from], "12.25", &text[to..]);
    let back = commonroad::import("f.xml", edited.as_bytes()).unwrap();
    assert_eq!(back.left_out[0].what, "<?evodrive?>");
    assert_eq!(back.scenes[0].validate(), vec![]);
    assert_ne!(back.scenes[0].digest(), scene.digest());
}

/// Every id that an XML document defines in `name` of elements called `element`.
fn ids<'d>(root: Element<'d>, element: &str, name: &str) -> BTreeSet<&'d str> {
    everything(root).into_iter().filter(|e| e.name() == element).filter_map(|e| e.attribute(name)).collect()
}

fn everything(root: Element<'_>) -> Vec<Element<'_>> {
    let mut all = vec![root];
    let mut at = 0;
    while at < all.len() {
        let children: Vec<Element<'_>> = all[at].children().collect();
        all.extend(children);
        at += 1;
    }
    all
}

#[test]
fn openscenario_names_only_what_it_defines_and_its_times_increase() {
    for scene in worlds().iter().cloned().chain([two_lane_scene(), awkward(), late_ego()]) {
        for (staging, revision) in [(None, V1_2), (Some(staging_of(&scene)), V1_2), (Some(staging_of(&scene)), V1_0)] {
            let files = openscenario::export(&scene, staging.as_ref(), "road \"&<.xodr", revision).unwrap();
            let document = Document::parse("f.xosc", &files.xosc).unwrap();
            let entities = ids(document.root(), "ScenarioObject", "name");
            let expected =
                1 + staging.map_or(scene.tracks.len(), |s| s.applied_to(&scene, &mut vec![]).unwrap().tracks.len());
            assert_eq!(entities.len(), expected, "{}", scene.id);
            for element in everything(document.root()) {
                if let Some(entity) = element.attribute("entityRef") {
                    assert!(entities.contains(entity), "{}: {}", scene.id, element.place());
                }
                if element.name() == "Polyline" {
                    let times: Vec<f64> =
                        element.named("Vertex").map(|v| v.number_attribute("time").unwrap()).collect();
                    assert!(times.len() > 1 && times.windows(2).all(|w| w[0] < w[1]), "{}", element.place());
                }
            }
        }
    }
}

/// The names of OpenSCENARIO 1.2's elements that an export uses.
const OPENSCENARIO_ELEMENTS: &str = "AbsoluteTargetSpeed Act Action Actors Axles BoundingBox ByValueCondition \
    CatalogLocations Center Condition ConditionGroup DeleteEntityAction Dimensions Entities EntityAction EntityRef Event \
    FileHeader FollowTrajectoryAction FrontAxle GlobalAction Init Actions LogicFile LongitudinalAction Maneuver \
    ManeuverGroup MiscObject None OpenSCENARIO Pedestrian Performance Phase Polyline Position Private PrivateAction \
    Properties Property RearAxle RoadNetwork RoutingAction ScenarioObject Shape SimulationTimeCondition SpeedAction \
    SpeedActionDynamics SpeedActionTarget StartTrigger StopTrigger Story Storyboard TeleportAction TimeReference Timing \
    TrafficSignalController TrafficSignalState TrafficSignals Trajectory TrajectoryFollowingMode TrajectoryRef Vehicle \
    Vertex WorldPosition AddEntityAction";

#[test]
fn openscenario_has_no_element_that_the_standard_does_not_know() {
    let known: BTreeSet<&str> = OPENSCENARIO_ELEMENTS.split_whitespace().collect();
    for scene in worlds().iter().cloned().chain([awkward(), late_ego()]) {
        let files = openscenario::export(&scene, Some(&staging_of(&scene)), "r.xodr", V1_2).unwrap();
        let document = Document::parse("f.xosc", &files.xosc).unwrap();
        for element in everything(document.root()) {
            assert!(known.contains(element.name()), "{}: {}", scene.id, element.place());
        }
        let parts: Vec<&str> = document.root().child("Storyboard").unwrap().children().map(|e| e.name()).collect();
        assert_eq!(parts, ["Init", "Story", "StopTrigger"]);
    }
}

#[test]
fn openscenario_trajectories_are_the_motion_of_the_scene() {
    let scene = &worlds()[1];
    let staging = staging_of(scene);
    let files = openscenario::export(scene, Some(&staging), "r.xodr", V1_2).unwrap();
    let document = Document::parse("f.xosc", &files.xosc).unwrap();
    let all = everything(document.root());
    let ego = all.iter().find(|e| e.name() == "Trajectory").unwrap();
    let vertices: Vec<_> = everything(*ego).into_iter().filter(|e| e.name() == "Vertex").collect();
    let place = everything(vertices[20]).into_iter().find(|e| e.name() == "WorldPosition").unwrap();
    let at = |name: &str| place.number_attribute(name).unwrap();
    let sample = staging.ego.as_ref().unwrap()[20 - scene.ego.start_step];
    assert_eq!(vertices[20].attribute("time"), Some("2"));
    assert_eq!((at("x"), at("y"), at("h")), (sample.position.x, sample.position.y, sample.heading_rad));
}

#[test]
fn openscenario_1_0_has_what_scenario_runner_asks_for_and_the_motion_of_1_2() {
    for scene in worlds().iter().cloned().chain([awkward(), late_ego()]) {
        let staging = staging_of(&scene);
        let files = |revision| openscenario::export(&scene, Some(&staging), "r.xodr", revision).unwrap().xosc;
        let (old, new) = (files(V1_0), files(V1_2));
        let (old, new) = (Document::parse("0.xosc", &old).unwrap(), Document::parse("2.xosc", &new).unwrap());
        let header = old.root().child("FileHeader").unwrap();
        assert_eq!((header.attribute("revMajor"), header.attribute("revMinor")), (Some("1"), Some("0")));
        assert!(!header.attribute("description").unwrap().starts_with("CARLA:"), "y would change its sign");
        let (of_old, of_new) = (everything(old.root()), everything(new.root()));
        for element in &of_old {
            match element.name() {
                "Vehicle" => assert_eq!(element.attribute("mass"), None),
                "Pedestrian" => assert_eq!(element.attribute("model"), element.attribute("name")),
                "TrajectoryRef" => panic!("{}", element.place()),
                "Timing" => assert_eq!(element.attribute("domainAbsoluteRelative"), Some("relative")),
                "FollowTrajectoryAction" => {
                    let parts: Vec<_> = element.children().map(|part| part.name()).collect();
                    assert_eq!(parts, ["Trajectory", "TimeReference", "TrajectoryFollowingMode"]);
                }
                _ => {}
            }
        }
        // The times of each trajectory begin at 0 and are as far apart as in 1.2; places are the same.
        let lines = |all: &[Element<'_>]| -> Vec<Vec<(f64, String)>> {
            let vertex = |v: Element<'_>| {
                let place = v.child("Position").unwrap().child("WorldPosition").unwrap();
                (
                    v.number_attribute("time").unwrap(),
                    ["x", "y", "h"].map(|name| place.attribute(name).unwrap()).join(" "),
                )
            };
            all.iter().filter(|e| e.name() == "Polyline").map(|e| e.named("Vertex").map(vertex).collect()).collect()
        };
        let (of_old, of_new) = (lines(&of_old), lines(&of_new));
        assert!(!of_old.is_empty() && of_old.len() == of_new.len(), "{}", scene.id);
        for (old, new) in of_old.iter().zip(&of_new) {
            let start = new[0].0;
            assert!(old.len() == new.len() && old[0].0 == 0.0, "{}", scene.id);
            for (a, b) in old.iter().zip(new) {
                assert!((a.0 + start - b.0).abs() < 1e-9 && a.1 == b.1, "{}: {a:?} {b:?}", scene.id);
            }
        }
    }
}

#[test]
fn opendrive_links_lead_to_roads_and_junctions_that_exist_and_back() {
    for scene in worlds().iter().cloned().chain([two_lane_scene(), awkward(), late_ego()]) {
        let files = openscenario::export(&scene, None, "r.xodr", V1_2).unwrap();
        let document = Document::parse("f.xodr", &files.xodr).unwrap();
        let roads: BTreeMap<&str, Element<'_>> =
            document.root().named("road").map(|r| (r.attribute("id").unwrap(), r)).collect();
        let junctions = ids(document.root(), "junction", "id");
        assert_eq!(roads.len(), document.root().named("road").count());
        for (id, road) in &roads {
            let link = road.child("link").unwrap();
            for side in ["predecessor", "successor"] {
                let Some(to) = link.child(side) else { continue };
                let there = to.attribute("elementId").unwrap();
                if to.attribute("elementType") == Some("junction") {
                    assert!(junctions.contains(there), "{}", to.place());
                    continue;
                }
                let back = if side == "predecessor" { "successor" } else { "predecessor" };
                let back = roads[there].child("link").unwrap().child(back).unwrap();
                let mine = [*id, road.attribute("junction").unwrap()];
                assert!(mine.contains(&back.attribute("elementId").unwrap()), "{}: {}", scene.id, to.place());
            }
        }
        for connection in document.root().named("junction").flat_map(|junction| junction.named("connection")) {
            let of = |name: &str| roads[connection.attribute(name).unwrap()];
            let from = of("connectingRoad").child("link").unwrap().child("predecessor").unwrap();
            assert_eq!(from.attribute("elementId"), of("incomingRoad").attribute("id"));
        }
    }
}

#[test]
fn an_exported_road_is_read_back_where_it_was() {
    for scene in worlds() {
        let files = openscenario::export(scene, None, "r.xodr", V1_2).unwrap();
        let road = super::opendrive::read::road("f.xodr", &files.xodr, &mut super::Imported::default()).unwrap();
        let read = crate::scene::LaneGraph::of(&road);
        for lane in &scene.road.lanes {
            let line = crate::kernel::Polyline::new(lane.centre.clone()).unwrap();
            for k in 0..=10 {
                let s = line.length_m() * f64::from(k) / 10.0;
                let place = read.nearest_lane(line.at(s), line.heading_at(s), 1.0);
                let off = place.map(|place| read.pose_at(place.lane, place.s_m).unwrap().position.distance(line.at(s)));
                assert!(off.is_some_and(|off| off < 0.1), "{} lane {} at {s}: {off:?}", scene.id, lane.id);
            }
        }
    }
}

#[test]
fn an_unsound_scene_is_not_exported() {
    let mut scene = two_lane_scene();
    scene.tracks[0].length_m = f64::INFINITY;
    assert!(matches!(scenarionet::export(&scene, None), Err(ExportError::Unsound { .. })));
}
