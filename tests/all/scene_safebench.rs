//! SafeBench's own route and scenario files on the towns at hand.

use crate::harness::{Ran, evodrive, files, shared};
use evodrive::ego::Policy;
use evodrive::formats::import_files;
use evodrive::scene::safebench::{Stage, TrafficFamily};
use evodrive::sim::{End, Intervention, Plant, rollout};

fn benchmark() -> Option<Vec<(String, Vec<u8>)>> {
    let mut folders = vec!["opendrive_carla".to_string(), "safebench/route/scenarios".to_string()];
    folders.extend((1..=8).map(|family| format!("safebench/route/scenario_0{family}_routes")));
    let folders: Option<Vec<_>> = folders.iter().map(|folder| shared(&format!("data/{folder}"))).collect();
    Some(folders?.iter().flat_map(|folder| files(folder, "")).collect())
}

/// Routes of the benchmark, and how many of them lie on each town that may be absent.
const ROUTES: usize = 112;
const ROUTES_ELSEWHERE: [(&str, usize); 3] = [("Town03", 1), ("Town04", 3), ("Town05", 56)];

#[test]
fn every_route_on_a_town_at_hand_becomes_a_scene_and_the_others_name_their_town() {
    let Some(files) = benchmark() else { return };
    let summary = import_files(&files);
    for left in &summary.left_out {
        println!("{} {}: {}", left.file, left.what, left.reason);
    }
    let is_here = |town: &str| files.iter().any(|(name, _)| name.ends_with(&format!("{town}.xodr")));
    let absent: Vec<_> = ROUTES_ELSEWHERE.iter().filter(|(town, _)| !is_here(town)).collect();
    for (town, routes) in &absent {
        let named = summary.left_out.iter().filter(|l| {
            l.reason.contains(&format!("lies on {town},")) && l.reason.contains(&format!("{town}.xodr is missing"))
        });
        assert_eq!(named.count(), *routes, "{town}");
    }
    let absent: usize = absent.iter().map(|(_, routes)| routes).sum();
    assert_eq!((summary.scenes.len(), summary.left_out.len()), (ROUTES - absent, absent));
    let mut lost = Vec::new();
    for scene in &summary.scenes {
        let staging = scene.staging.as_ref().unwrap();
        let stage = Stage::of(scene).unwrap();
        let route_m: f64 = scene.ego.route.windows(2).map(|w| w[0].distance(w[1])).sum();
        assert!(route_m > 50.0 && route_m < 180.0, "{}: {route_m}", scene.id);
        match staging.family {
            TrafficFamily::TurningObstacle => assert!(stage.turn_exit_m().is_some(), "{}", scene.id),
            TrafficFamily::VehiclePassing if staging.route >= 4 => {
                assert!(stage.left_lane(80.0).is_some_and(|lane| !lane.same_direction), "{}", scene.id);
            }
            TrafficFamily::LaneChanging => {
                assert!(stage.left_lane(36.0).is_some_and(|lane| lane.same_direction), "{}", scene.id);
            }
            family if family.has_spawn_frames() => {
                let frame = &staging.spawns[0];
                assert!(frame.fwd_m > 15.0 && frame.fwd_m < 60.0 && frame.right_m < 0.0, "{}: {frame:?}", scene.id);
            }
            _ => {}
        }
        let outcome =
            rollout(&Plant::new(scene).unwrap(), &Intervention::default(), &mut *Policy::Idm.driver()).unwrap();
        let driving = outcome.driving.unwrap();
        if outcome.end == End::OffRoad {
            lost.push(format!("{}: {:?} {driving:?}", scene.id, outcome.end));
        }
    }
    assert!(lost.is_empty(), "the IDM ego alone on the road loses its way:\n{}", lost.join("\n"));
}

/// Routes of the benchmark that are evaluated, and all that can be played with the towns that are copied beside the project.
#[test]
fn the_set_on_real_routes_plays_what_is_at_hand_and_names_every_missing_file() {
    let (Some(routes), Some(towns)) = (shared("data/safebench/route"), shared("data/opendrive_carla")) else { return };
    let out = tempfile::tempdir().unwrap();
    let pool = out.path().join("real.pool");
    let mut command = evodrive();
    command.args(["scenes", "generate", "experiments/real_routes.toml", "--scenes"]).arg(&routes).arg(&towns);
    let ran = Ran::of(command.arg("--out").arg(&pool));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let absent: Vec<&str> = ROUTES_ELSEWHERE
        .iter()
        .map(|(town, _)| *town)
        .filter(|town| !towns.join(format!("{town}.xodr")).exists())
        .collect();
    for town in &absent {
        assert!(ran.stdout.contains(&format!("{town}.xodr is missing")), "{town}: {}", ran.stdout);
    }
    let alone =
        Ran::of(evodrive().args(["scenes", "import"]).arg(&routes).arg("--out").arg(out.path().join("none.pool")));
    assert_eq!(alone.code, 2);
    assert!(
        alone.stderr.contains("Town05.xodr is missing (towns at hand: none); add it with --towns"),
        "{}",
        alone.stderr
    );
}
