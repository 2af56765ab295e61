//! Small files of our own, and hostile ones; the benchmark's files are read in `tests/scene_safebench.rs`.

use super::*;
use crate::formats::import_files;
use crate::kernel::Vec2;
use crate::scene::safebench::Stage;

/// A straight road of two lanes each way along CARLA's +x, 300 m.
pub const TOWN: &str = r#"<OpenDRIVE><header revMajor="1" revMinor="4"/>
<road id="1" length="300" junction="-1">
 <planView><geometry s="0" x="0" y="0" hdg="0" length="300"><line/></geometry></planView>
 <lanes><laneSection s="0">
  <left><lane id="1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></left>
  <center><lane id="0" type="none"/></center>
  <right><lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
   <lane id="-2" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right>
 </laneSection></lanes></road></OpenDRIVE>"#;

pub const ROUTE: &str = r#"<routes><route id="0" town="Plain">
<waypoint x="20" y="5.25" z="0" pitch="0" roll="0" yaw="360.0"/>
<waypoint x="60" y="5.25" z="0" pitch="0" roll="0" yaw="0.0"/>
<waypoint x="120" y="5.25" z="0" pitch="0" roll="0" yaw="0.0"/></route></routes>"#;

pub const EVENTS: &str = r#"{"available_scenarios":[{"Plain":[{"available_event_configurations":[
{"transform":{"x":"250.0","y":"5.25","yaw":"0"},"other_actors":{"left":[]}},
{"transform":{"x":"50.0","y":5.25,"yaw":"359.5"},"other_actors":{"left":[{"x":"80.0","y":"-15.0","yaw":"90.0"}]}}
],"scenario_name":"OppositeVehicleRunningRedLight"},{"available_event_configurations":[
{"transform":{"x":"45.0","y":"5.25","yaw":"0"}}],"scenario_name":"DynamicObjectCrossing"}]}]}"#;

pub fn library() -> Library {
    let mut library = Library::default();
    let road = crate::formats::opendrive::read::road("Plain.xodr", TOWN.as_bytes(), &mut Imported::default()).unwrap();
    library.add_town("Plain.xodr", road).unwrap();
    library.add_scenarios("scenario_05.json", EVENTS.as_bytes(), &mut Imported::default()).unwrap();
    library
}

fn one(file: &str, route: &str) -> Scene {
    let imported = import(file, route.as_bytes(), &library()).unwrap();
    assert_eq!(imported.left_out, vec![]);
    imported.scenes.into_iter().next().unwrap()
}

#[test]
fn a_route_file_and_its_event_give_a_scene_in_the_mirrored_frame() {
    let scene = one("scenario_05_route_06.xml", ROUTE);
    assert_eq!(scene.id, "safebench/red_light_running/06");
    assert_eq!(scene.validate(), vec![]);
    assert_eq!(scene.ego.route[0], Vec2::new(20.0, -5.25), "y is negated");
    assert!((scene.ego.route[scene.ego.route.len() - 1].x - 120.0).abs() < 1e-9);
    let staging = scene.staging.as_ref().unwrap();
    assert!(staging.trigger.position.distance(Vec2::new(50.0, -5.25)) < 1e-9);
    let frame = staging.spawns[0];
    assert!((frame.fwd_m - 30.0).abs() < 1e-6 && (frame.right_m + 20.25).abs() < 1e-6, "{frame:?}");
    assert!((frame.yaw_rad + num::FRAC_PI_2).abs() < 1e-6, "it drives from the left to the right");
    assert_eq!(scene.lights.len(), 1, "the ego's; no lane is under the actor");
}

#[test]
fn families_without_frames_find_their_places_along_the_road() {
    let scene = one("scenario_01_route_04.xml", ROUTE);
    assert_eq!(scene.staging.as_ref().unwrap().spawns, vec![]);
    let stage = Stage::of(&scene).unwrap();
    let (walker, left) = (stage.roadside(30.0), stage.left_lane(30.0).unwrap());
    assert!(walker.pose.position.distance(Vec2::new(75.0, -8.75)) < 1e-6, "{walker:?}");
    assert!((walker.pose.heading_rad - num::FRAC_PI_2).abs() < 1e-9 && walker.lanes_between == 0);
    assert!(left.same_direction && left.pose.position.distance(Vec2::new(75.0, -1.75)) < 1e-6, "{left:?}");
}

#[test]
fn a_missing_town_event_or_way_is_told_by_name() {
    let reason = |file: &str, route: String| {
        let imported = import(file, route.as_bytes(), &library()).unwrap();
        assert_eq!(imported.scenes.len(), 0);
        imported.left_out[0].reason.clone()
    };
    let gone = reason("scenario_05_route_06.xml", ROUTE.replace("\"Plain\"", "\"Town05\""));
    assert!(gone.contains("Town05.xodr") && gone.contains("Plain"), "{gone}");
    let none = reason("scenario_07_route_06.xml", ROUTE.into());
    assert!(none.contains("SignalizedJunctionRightTurn") && none.contains("scenario_07.json"), "{none}");
    let back = reason("scenario_05_route_06.xml", ROUTE.replace("x=\"120\"", "x=\"10\""));
    assert!(back.contains("waypoint 2"), "{back}");
    let off = reason("scenario_05_route_06.xml", ROUTE.replace("y=\"5.25\"", "y=\"50\""));
    assert!(off.contains("waypoint 0"), "{off}");
}

#[test]
fn towns_and_events_may_stand_anywhere_in_a_list_of_files() {
    let files = [
        ("scenario_05_route_06.xml", ROUTE),
        ("Plain.xodr", TOWN),
        ("scenario_05_route_07.xml", &ROUTE.replace("\"Plain\"", "\"Town03\"")),
        ("scenario_05.json", EVENTS),
    ];
    let summary = import_files(&files);
    assert_eq!(summary.scenes.len(), 1);
    assert_eq!(summary.left_out.len(), 1, "{:?}", summary.left_out);
    assert!(summary.left_out[0].reason.contains("Town03"));
}

#[test]
fn towns_of_one_name_from_several_folders_are_told_apart() {
    let wider = TOWN.replace("a=\"3.5\"", "a=\"3.75\"");
    let cut = &TOWN[..TOWN.len() - 20];
    let files = [
        ("Plain.xodr", cut),
        ("Plain.xodr", TOWN),
        ("Plain.xodr", TOWN),
        ("Plain.xodr", wider.as_str()),
        ("scenario_05_route_06.xml", ROUTE),
        ("scenario_05.json", EVENTS),
    ];
    let summary = import_files(&files);
    assert_eq!((summary.scenes.len(), summary.left_out.len()), (1, 2), "{:?}", summary.left_out);
    assert_eq!(summary.scenes[0].road, library().towns["Plain"].0, "the first that can be read");
    assert!(summary.left_out[1].reason.contains("one road for the town Plain"), "{:?}", summary.left_out);
}

#[test]
fn a_scenario_file_of_more_than_16_mib_is_not_parsed() {
    let refusal =
        Library::default().add_scenarios("s.json", &vec![b' '; (16 << 20) + 1], &mut Imported::default()).unwrap_err();
    assert!(refusal.to_string().contains("at most 16 MiB"), "{refusal}");
}

#[test]
fn damaged_and_hostile_files_are_refused() {
    let refusal = |file: &str, text: &str| {
        let read = import(file, text.as_bytes(), &library());
        read.map_or_else(|error| error.to_string(), |imported| imported.left_out[0].reason.clone())
    };
    assert!(refusal("my_route.xml", ROUTE).contains("scenario_<01 to 08>"));
    assert!(refusal("scenario_09_route_01.xml", ROUTE).contains("scenario_<01 to 08>"));
    assert!(refusal("scenario_05_route_99999999999999999999.xml", ROUTE).contains("scenario_<01 to 08>"));
    assert!(refusal("scenario_05_route_06.xml", "<routes/>").contains("<route>"));
    assert!(refusal("scenario_05_route_06.xml", &ROUTE.replace("x=\"60\"", "x=\"NaN\"")).contains("finite number"));
    assert!(refusal("scenario_05_route_06.xml", &ROUTE.replace("town", "city")).contains("town"));
    for end in (0..ROUTE.len() - 1).step_by(41) {
        assert!(import("scenario_05_route_06.xml", &ROUTE.as_bytes()[..end], &library()).is_err(), "{end}");
    }
    let events = |text: &str| {
        let mut imported = Imported::default();
        let read = Library::default().add_scenarios("s.json", text.as_bytes(), &mut imported);
        read.map(|()| imported.left_out.first().map(|left| left.reason.clone()).unwrap_or_default())
    };
    for end in (0..EVENTS.len() - 1).step_by(37) {
        assert!(events(&EVENTS[..end]).is_err(), "{end}");
    }
    assert!(events(&EVENTS.replace("250.0", "1e99")).unwrap().contains("finite"));
    assert!(events(&"[".repeat(100_000)).is_err());
}
