//! Evolution on really recorded traffic: every usable CommonRoad scene, each left-out one named with its reason.
//! The scenes are not part of the project; the test says so when they are absent.

use crate::harness::{Ran, evodrive, shared};

#[test]
fn a_generator_evolves_on_recorded_traffic_and_replays_to_one_root() {
    let Some(folder) = shared("data/commonroad") else { return };
    let out = tempfile::tempdir().unwrap();
    let root = || {
        let mut command = evodrive();
        command.args(["run", "experiments/recorded_traffic.toml", "--out", out.path().to_str().unwrap(), "--scenes"]);
        let ran = Ran::of(command.arg(&folder));
        let root = ran.root();
        assert!(ran.stderr.contains("left out: DEU_Starnberg-1_1_T-1.xml"), "{}", ran.stderr);
        assert!(ran.stdout.contains("cat-idm") && ran.stdout.contains("at-idm"), "{}", ran.stdout);
        root
    };
    let first = root();
    assert_eq!(first.len(), 64, "{first}");
    assert_eq!(first, root());
}
