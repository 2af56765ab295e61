//! Exports of real and generated scenes. With EVODRIVE_EXPORT_DIR set, the files are also written there, for
//! `xmllint`, the ASAM checkers and other readers.

use std::path::PathBuf;

use evodrive::kernel::Seed;
use evodrive::scene::Scene;
use evodrive::scene::export::{commonroad, openscenario, scenarionet_json};
use evodrive::scene::import::{commonroad as commonroad_import, import_files, scenarionet_json as json_import};
use evodrive::scene::synth::{SynthOptions, WorldKind, pool_member};

#[allow(clippy::disallowed_methods)]
fn named_folder(variable: &str) -> Option<PathBuf> {
    std::env::var(variable).ok().map(PathBuf::from)
}

/// Scenes of the CommonRoad files beside the repository; none, said aloud, where there are none.
fn recorded() -> Vec<Scene> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let folder = named_folder("EVODRIVE_SHARED").unwrap_or(beside).join("data/commonroad");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        eprintln!("skipped: no CommonRoad files in {}", folder.display());
        return vec![];
    };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "xml"));
    paths.sort();
    let files: Vec<(String, Vec<u8>)> = paths
        .iter()
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(path).unwrap()))
        .collect();
    import_files(&files).scenes
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
        ego_travel_m_min: 10.0,
        interaction_time_s_max: 4.0,
        interaction_gap_m_max: 15.0,
        attempts_max: 100,
    };
    (0..WorldKind::ALL.len()).map(|i| pool_member(&options, Seed(3), i).unwrap()).collect()
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

#[test]
fn exported_scenes_come_back_with_the_same_digest() {
    for scene in recorded().into_iter().chain(generated()) {
        let name = file_name(&scene);
        let xml = commonroad(&scene, None).unwrap();
        keep(&format!("{name}.xml"), &xml.bytes);
        let back = commonroad_import::import("f.xml", &xml.bytes).unwrap();
        assert_eq!(back.scenes[0].digest(), scene.digest(), "{}: CommonRoad", scene.id);
        let json = scenarionet_json(&scene, None).unwrap();
        keep(&format!("{name}.json"), &json.bytes);
        let back = json_import::import("f.json", &json.bytes).unwrap();
        assert_eq!(back.scenes[0].digest(), scene.digest(), "{}: ScenarioNet", scene.id);
    }
}

#[test]
fn every_scene_has_an_openscenario_form() {
    for scene in recorded().into_iter().chain(generated()) {
        let name = file_name(&scene);
        let road_file = format!("{name}.xodr");
        let files = openscenario(&scene, None, &road_file).unwrap();
        keep(&format!("{name}.xosc"), &files.xosc);
        keep(&road_file, &files.xodr);
        let text = String::from_utf8(files.xosc).unwrap();
        let moving = scene.tracks.iter().filter(|t| t.samples.iter().flatten().count() > 1).count();
        assert!(text.matches("<ScenarioObject ").count() == scene.tracks.len() + 1, "{}", scene.id);
        assert!(text.matches("<FollowTrajectoryAction>").count() <= 2 * moving + 2, "{}", scene.id);
        assert!(text.contains(&road_file));
    }
}
