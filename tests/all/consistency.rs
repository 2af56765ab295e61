//! Fields that contradict each other, in real files: what reports showed is found and mended, and what was recorded right stays as
//! it is. The files are no part of the project; the tests say so when they are absent.

use serde_json::Value;

use crate::harness::{Ran, evodrive, shared, skip};

/// Imports files into the pool in `folder` and returns the answer.
fn imported(folder: &std::path::Path, paths: &[&std::path::Path], more: &[&str]) -> Value {
    let mut command = evodrive();
    command.args(["scenes", "import", "--json", "--overwrite", "--out"]).arg(folder.join("s.pool")).args(paths);
    serde_json::from_str(&Ran::of(command.args(more)).stdout).unwrap()
}

/// Returns what `scenes check` says of the pool in `folder`.
fn checked(folder: &std::path::Path, more: &[&str]) -> String {
    Ran::of(evodrive().args(["scenes", "check"]).arg(folder.join("s.pool")).args(more)).stdout
}

fn told(answer: &Value) -> Vec<String> {
    let parts = answer["left_out"].as_array().unwrap().iter();
    parts.map(|part| format!("{}: {}", part["what"].as_str().unwrap(), part["reason"].as_str().unwrap())).collect()
}

/// Returns the number of road users that contradict each check, where there are any.
fn contradicting(answer: &Value) -> Vec<(String, usize)> {
    let checks = answer["consistency"].as_array().unwrap().iter();
    let each =
        checks.map(|of| (of["name"].as_str().unwrap().to_string(), of["contradictions"].as_array().unwrap().len()));
    each.filter(|(_, count)| *count > 0).collect()
}

#[test]
fn velocities_in_the_cars_own_frame_are_read_as_such_and_become_what_they_should_be() {
    let Some(folder) = shared("cases/public_reports_2/02-velocity-in-body-frame") else { return };
    let out = tempfile::tempdir().unwrap();
    let scene = |name: &str| {
        let bytes = std::fs::read(folder.join(name)).unwrap();
        evodrive::formats::import_files(&[(name, bytes)]).scenes.remove(0)
    };
    let (right, spoilt) = ("sd_n1c_right_velocity.pkl", "sd_n1_body_frame_velocity.pkl");
    for (mended, right) in scene(spoilt).tracks.iter().zip(&scene(right).tracks) {
        let apart = |(a, b): (&evodrive::scene::Sample, &evodrive::scene::Sample)| a.velocity.distance(b.velocity);
        let samples = mended.samples.iter().flatten().zip(right.samples.iter().flatten());
        assert!(samples.map(apart).all(|mps| mps < 1e-6), "{}", mended.id);
    }
    let spoilt = folder.join(spoilt);
    let mended = imported(out.path(), &[&spoilt], &[]);
    assert!(
        told(&mended).iter().any(|said| said.contains("its velocities: those of all road users read as own-frame"))
    );
    let json: Value = serde_json::from_str(&checked(out.path(), &["--json"])).unwrap();
    assert_eq!((contradicting(&json), json["consistency"].as_array().unwrap().len()), (vec![], 7));
    let written = imported(out.path(), &[&spoilt], &["--velocities", "written"]);
    assert_eq!(contradicting(&written), [("velocity".to_string(), 3)]);
    let table = checked(out.path(), &[]);
    assert!(
        table.contains("check") && table.contains("contradiction: velocity: 3 road users of 3 above 0.30 share"),
        "{table}"
    );
}

#[test]
fn headings_in_degrees_and_of_a_compass_are_read_as_such() {
    let Some(folder) = shared("cases/public_reports_2/03-heading-against-motion") else { return };
    let out = tempfile::tempdir().unwrap();
    for (file, convention) in [
        ("sd_n15_heading_degrees.pkl", "degrees"),
        ("sd_n16_heading_compass.pkl", "compass"),
        ("gd_degrees_with_ids.json", "degrees"),
    ] {
        let spoilt = folder.join(file);
        let mended = imported(out.path(), &[&spoilt], &[]);
        let said = told(&mended);
        assert!(said.iter().any(|said| said.contains(&format!("all road users read as {convention} "))), "{said:?}");
        assert_eq!(contradicting(&mended), vec![], "{file}");
        assert_eq!(mended["recorded_crashes"].as_array().unwrap().len(), 0, "{file}");
        let written = imported(out.path(), &[&spoilt], &["--headings", "written"]);
        assert_eq!(contradicting(&written), [("heading".to_string(), 3)], "{file}");
    }
}

#[test]
fn recorded_traffic_stays_as_it_is_and_nobody_of_it_contradicts_himself() {
    let out = tempfile::tempdir().unwrap();
    for path in ["data/scenarionet_nuscenes", "data/commonroad", "data/ngsim_commonroad"] {
        let Some(folder) = shared(path) else { continue };
        let packed = folder.join("scenes.tar.xz");
        let folder = if packed.exists() {
            let unpacked = out.path().join("unpacked");
            std::fs::create_dir_all(&unpacked).unwrap();
            let tar = std::process::Command::new("tar").arg("xJf").arg(&packed).arg("-C").arg(&unpacked).status();
            if !tar.is_ok_and(|status| status.success()) {
                skip("tar with xz is not there to unpack data/ngsim_commonroad");
                continue;
            }
            unpacked
        } else {
            folder
        };
        let judged = imported(out.path(), &[&folder], &[]);
        let written = imported(out.path(), &[&folder], &["--headings", "written", "--velocities", "written"]);
        assert_eq!(judged["digest"], written["digest"], "{path}");
        assert_eq!(told(&judged), told(&written), "{path}");
        assert_eq!(contradicting(&judged), vec![], "{path}");
    }
}
