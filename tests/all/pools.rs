//! Pools out of pools, as a user makes them: merged, split, filtered, checked, and taken wherever scenes are.

use std::collections::BTreeSet;
use std::path::Path;

use evodrive::scene::{Pool, Scene, pool};
use serde_json::Value;

use crate::backends::experiment;
use crate::harness::{Ran, evodrive, run};
use crate::sim::scenes::{car, sample, straight, straight_road};

/// The binary in a folder.
fn at(folder: &Path, args: &[&str]) -> Ran {
    Ran::of(evodrive().current_dir(folder).args(args))
}

fn well(folder: &Path, args: &[&str]) -> Value {
    let ran = at(folder, &[args, &["--json"]].concat());
    assert_eq!(ran.code, 0, "{args:?}: {}", ran.stderr);
    serde_json::from_str(&ran.stdout).unwrap()
}

fn ids(folder: &Path, pool: &str) -> BTreeSet<String> {
    let listed = well(folder, &["scenes", "list", pool]);
    listed["scenes"].as_array().unwrap().iter().map(|of| of["id"].as_str().unwrap().to_string()).collect()
}

fn generate(folder: &Path, seed: &str, out: &str) {
    let path = experiment(folder, &format!("s{seed}"), "");
    let text = std::fs::read_to_string(&path).unwrap().replace("seed = 7", &format!("seed = {seed}"));
    std::fs::write(&path, text).unwrap();
    well(folder, &["scenes", "generate", path.to_str().unwrap(), "--out", out]);
}

#[test]
fn pools_are_merged_split_filtered_and_checked() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    generate(folder, "7", "one.pool");
    generate(folder, "8", "two.pool");
    let both = well(folder, &["scenes", "merge", "one.pool", "two.pool", "one.pool", "--out", "both.pool"]);
    assert_eq!((both["repeated"].as_u64(), ids(folder, "both.pool").len()), (Some(12), 24));
    // By a seed: disjoint, complete, the same again, another one for another seed.
    let cut = |seed: &str, open: &str, closed: &str| {
        let args =
            ["scenes", "split", "both.pool", "--held-out", "6", "--seed", seed, "--out", open, "--held-out-to", closed];
        well(folder, &[args.as_slice(), &["--overwrite"]].concat());
        [ids(folder, open), ids(folder, closed)]
    };
    let [open, closed] = cut("1", "open.pool", "closed.pool");
    let usable: BTreeSet<String> = {
        let listed = well(folder, &["scenes", "list", "both.pool", "--usable"]);
        listed["scenes"].as_array().unwrap().iter().map(|of| of["id"].as_str().unwrap().to_string()).collect()
    };
    assert!(open.is_disjoint(&closed) && closed.len() == 6);
    assert_eq!(open.union(&closed).cloned().collect::<BTreeSet<_>>(), usable);
    assert_eq!(cut("1", "a.pool", "b.pool"), [open.clone(), closed.clone()]);
    assert_ne!(cut("2", "a.pool", "b.pool")[1], closed);
    // By a tag: the scenes that have it are held out, and no others.
    let args = ["scenes", "split", "both.pool", "--tag", "light", "--out", "a.pool", "--held-out-to", "b.pool"];
    well(folder, &[args.as_slice(), &["--overwrite"]].concat());
    let lit = well(folder, &["scenes", "list", "both.pool", "--tag", "light", "--usable"]);
    assert_eq!(lit["scenes"].as_array().unwrap().len(), ids(folder, "b.pool").len());
    assert_eq!(ids(folder, "a.pool").len() + ids(folder, "b.pool").len(), usable.len());
    // By an expression and a tag, which must both hold.
    let listed = well(
        folder,
        &["scenes", "filter", "both.pool", "--where", "vehicle_count >= 10", "--tag", "junction", "--out", "f.pool"],
    );
    let kept = listed["scenes"].as_array().unwrap();
    let whole = well(folder, &["scenes", "list", "both.pool"]);
    let junctions = whole["scenes"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|of| of["tags"].as_array().unwrap().contains(&"junction".into()));
    assert!(!kept.is_empty() && kept.len() < junctions.count(), "the expression takes some away: {listed}");
    // Two scenes of one id.
    let scene = whole["scenes"][0]["id"].as_str().unwrap().to_string();
    let export = ["scenes", "export", "one.pool", "--scene", &scene, "--format", "scenarionet", "--out", "exported"];
    assert_eq!(at(folder, &export).code, 0);
    // Checked: the pool is good; of scenes without traffic each reason is one line, and the exit code says so.
    let checked = well(folder, &["scenes", "check", "open.pool"]);
    assert_eq!(
        (checked["usable"].as_u64(), checked["scenes"].as_u64()),
        (Some(open.len() as u64), Some(open.len() as u64))
    );
    for (args, expected) in [
        (vec!["scenes", "filter", "both.pool", "--tag", "juncton", "--out", "x.pool"], "did you mean junction?"),
        (vec!["scenes", "filter", "both.pool", "--where", "vehicle_cuont > 3", "--out", "x.pool"], "evodrive features"),
        (
            vec!["scenes", "filter", "both.pool", "--where", "vehicle_count > 300", "--out", "x.pool"],
            "none of the 24 scenes",
        ),
        (vec!["scenes", "filter", "both.pool", "--without", &scene[..scene.len() - 1], "--out", "x.pool"], &scene),
        (
            vec!["scenes", "split", "both.pool", "--held-out", "60", "--out", "x.pool", "--held-out-to", "y.pool"],
            "ask for fewer",
        ),
        (
            vec!["scenes", "split", "both.pool", "--held-out", "3", "--out", "x.pool", "--held-out-to", "x.pool"],
            "two files",
        ),
        (vec!["scenes", "show", "both.pool", &scene[..scene.len() - 1]], "did you mean"),
    ] {
        let refused = at(folder, &args);
        assert!(refused.code == 2 && refused.stderr.contains(expected), "{args:?}: {}", refused.stderr);
        assert!(!folder.join("x.pool").exists(), "{args:?}");
    }
}

#[test]
fn a_pool_is_taken_wherever_scenes_are_and_a_window_fits_into_it() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    generate(folder, "7", "mine.pool");
    let generated = experiment(folder, "generated", "");
    let text = std::fs::read_to_string(&generated).unwrap();
    let (before, _) = text.split_once("[scenes]").unwrap();
    let taken = |name: &str, source: &str| {
        let path = folder.join(name);
        std::fs::write(&path, format!("{}[scenes]\n{source}\n", before.replace("\"generated", "\"taken"))).unwrap();
        path
    };
    let planned = |path: &Path, more: &[&str]| {
        at(folder, &[&["plan", path.to_str().unwrap(), "--out", "plans", "--json"], more].concat())
    };
    let pool_of = |ran: &Ran| {
        assert_eq!(ran.code, 3, "nothing is recorded yet: {}", ran.stderr);
        let object: Value = serde_json::from_str(&ran.stdout).unwrap();
        let folder = folder.join(object["folder"].as_str().unwrap());
        well(dir.path(), &["scenes", "check", folder.join("scenes.pool").to_str().unwrap()])["digest"].to_string()
    };
    let of_pool = pool_of(&planned(&taken("p.toml", "source = \"pool\"\npath = \"mine.pool\""), &[]));
    let of_files =
        pool_of(&planned(&taken("f.toml", "source = \"files\"\npaths = [\"mine.pool\", \"mine.pool\"]"), &[]));
    let instead = pool_of(&planned(&generated, &["--scenes", "mine.pool"]));
    assert!(of_pool == of_files && of_pool == instead);
    let wide = taken("wide.toml", "source = \"pool\"\npath = \"mine.pool\"");
    let text = std::fs::read_to_string(&wide).unwrap().replace("window = 3", "window = 7");
    std::fs::write(&wide, text).unwrap();
    let refused = planned(&wide, &[]);
    assert!(
        refused.code == 2 && refused.stderr.contains("split.window is 7, expected at most the 6"),
        "{}",
        refused.stderr
    );
    let help = run(&["scenes", "import", "--help"]).stdout;
    for format in ["scenarionet", "commonroad", "waymo", "gpudrive", "safebench", "pool"] {
        assert!(help.contains(&format!("\n  {format}")), "{format}: {help}");
    }
}

#[test]
fn two_scenes_of_one_id_and_unusable_scenes_are_told() {
    let dir = tempfile::tempdir().unwrap();
    let fixtures = crate::harness::home().join("tests/fixtures/commonroad");
    let path = fixtures.join("two_lanes_2018b.xml");
    let text = std::fs::read_to_string(&path).unwrap();
    let other = dir.path().join("two_lanes_2018b.xml");
    let changed = text.replacen("<x>", "<x>0", 1);
    assert_ne!(changed, text);
    // The first coordinate of the road, moved by a metre.
    let moved = text.find("<x>").map(|at| {
        let end = at + text[at..].find("</x>").unwrap();
        let x: f64 = text[at + 3..end].trim().parse().unwrap();
        format!("{}{}{}", &text[..at + 3], x + 1.0, &text[end..])
    });
    std::fs::write(&other, moved.unwrap()).unwrap();
    let merge = ["scenes", "merge", path.to_str().unwrap(), other.to_str().unwrap(), "--out", "x.pool"];
    let refused = at(dir.path(), &merge);
    assert!(refused.code == 2 && refused.stderr.contains("names two different scenes"), "{}", refused.stderr);
    assert!(!dir.path().join("x.pool").exists());
    let checked = at(dir.path(), &["scenes", "check", path.to_str().unwrap(), "--json"]);
    let object: Value = serde_json::from_str(&checked.stdout).unwrap();
    let unusable = object["unusable"].as_array().unwrap();
    assert_eq!(checked.code, if unusable.is_empty() { 0 } else { 2 }, "{}", checked.stdout);
    assert_eq!(object["scenes"].as_u64().unwrap(), object["usable"].as_u64().unwrap() + unusable.len() as u64);
}

/// An ego at 10 m/s that drives into a standing car, or would if the car did not stand beside its lane.
fn with_a_standing_car(id: &str, aside_m: f64) -> Scene {
    let standing = car("stands", straight(sample(40.0, aside_m, 0.0, 0.0), 60));
    // Somebody who drives, so that evolution can use the scene.
    let driving = car("drives", straight(sample(10.0, 12.0, 0.0, 8.0), 60));
    Scene { id: id.into(), ..straight_road(60, 10.0, vec![standing, driving]) }
}

#[test]
fn scenes_whose_recorded_ego_crashes_are_counted_and_named_and_can_be_left_out() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let scenes = [("clear", 8.0), ("crash-a", 0.0), ("clear-too", -8.0), ("crash-b", 0.5)];
    let scenes = scenes.map(|(id, aside_m)| with_a_standing_car(id, aside_m)).to_vec();
    std::fs::write(folder.join("raw.pool"), pool::encode(&Pool::new(scenes, vec![]).unwrap())).unwrap();
    let which = |object: &Value| {
        let crashes = object["recorded_crashes"].as_array().unwrap();
        crashes.iter().map(|of| format!("{} {}", of["scene"].as_str().unwrap(), of["with"].as_str().unwrap())).collect()
    };
    let crashing: Vec<String> = vec!["crash-a stands".into(), "crash-b stands".into()];
    // They can be used, as ever: the pool is good.
    let checked = well(folder, &["scenes", "check", "raw.pool"]);
    assert_eq!((checked["usable"].as_u64(), which(&checked)), (Some(4), crashing.clone()));
    assert_eq!(which(&well(folder, &["scenes", "import", "raw.pool", "--out", "mine.pool"])), crashing);
    assert_eq!(which(&well(folder, &["init", "mine", "--scenes", "mine.pool"])), crashing);
    assert_eq!(ids(folder, "mine.pool").len(), 4);
    // In words, with commands that work as they are printed.
    let words = at(folder, &["scenes", "check", "mine.pool"]).stdout;
    assert!(
        words.contains("in 2 scenes of 4 the recorded ego itself touches somebody: crash-a (touches stands after 3."),
        "{words}"
    );
    let told = at(folder, &["init", "other", "--scenes", "mine.pool"]).stdout;
    assert!(told.contains("recorded crash: in 2 scenes of 4"), "{told}");
    for (_, typed) in words.lines().filter_map(|line| line.split_once("evodrive ")) {
        let ran = at(folder, &typed.split(' ').collect::<Vec<_>>());
        assert_eq!(ran.code, 0, "{typed}: {}", ran.stderr);
    }
    assert!(folder.join("scene.html").exists());
    assert_eq!(ids(folder, "no_crashes.pool"), ["clear".to_string(), "clear-too".to_string()].into());
    let clean = at(folder, &["scenes", "check", "no_crashes.pool"]).stdout;
    assert!(!clean.contains("crash"), "{clean}");
}
