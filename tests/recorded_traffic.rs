//! Evolution on really recorded traffic: every usable CommonRoad scene, each left-out one named with its reason.
//! The scenes are not part of the project; the test says so when they are absent.

use std::path::{Path, PathBuf};
use std::process::Command;

#[allow(clippy::disallowed_methods)]
fn shared() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let root = std::env::var("EVODRIVE_SHARED").map(PathBuf::from).unwrap_or(beside);
    let folder = root.join("data/commonroad");
    folder.is_dir().then_some(folder)
}

#[test]
fn a_generator_evolves_on_recorded_traffic_and_replays_to_one_root() {
    let Some(folder) = shared() else {
        println!("skipped: no recorded scenes at ../shared/data/commonroad (or EVODRIVE_SHARED)");
        return;
    };
    let out = tempfile::tempdir().unwrap();
    let root = || {
        let output = Command::new(env!("CARGO_BIN_EXE_evodrive"))
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .args(["run", "experiments/recorded_traffic.toml", "--out", out.path().to_str().unwrap(), "--scenes"])
            .arg(&folder)
            .output()
            .unwrap();
        let (stdout, stderr) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success(), "{stderr}");
        assert!(stderr.contains("left out: DEU_Starnberg-1_1_T-1.xml"), "{stderr}");
        assert!(stdout.contains("cat-idm") && stdout.contains("at-idm"), "{stdout}");
        stdout.lines().last().unwrap_or_default().to_string()
    };
    let first = root();
    assert!(first.starts_with("root: ") && first.len() == 70, "{first}");
    assert_eq!(first, root());
}
