//! The planner of docs/EGOS.md drives as the page says, one that is too slow is counted apart, and the scenes that break a planner are
//! listed with the command that plays each.

use std::path::Path;

use serde_json::Value;

use crate::backends::experiment;
use crate::harness::{Ran, evodrive, home, text};
use crate::own_ego::{copied, driver, python};

fn here(folder: &Path, args: &[&str]) -> Ran {
    Ran::of(evodrive().current_dir(folder).args(args))
}

fn json(ran: &Ran) -> Value {
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    serde_json::from_str(&ran.stdout).unwrap()
}

/// Figures of an ego by the end of its name, as `egos` found them.
fn figures<'j>(object: &'j Value, name: &str) -> &'j Value {
    let egos = object["egos"].as_array().unwrap();
    egos.iter().find(|ego| ego["ego"].as_str().unwrap().ends_with(name)).unwrap_or_else(|| panic!("{name}: {object}"))
}

#[test]
fn the_planner_of_the_page_drives_the_hundred_scenes_as_the_page_says() {
    if !python() {
        return;
    }
    let page = text("docs/EGOS.md");
    let section = page.split("### A planner that looks at the map").nth(1).expect("the section");
    let code = section.split("```python\n").nth(1).unwrap().split("```").next().unwrap();
    let lines = code.lines().filter(|line| !line.trim().is_empty()).count();
    assert!(lines <= 42, "{lines} lines");
    let folder = tempfile::tempdir().unwrap();
    copied(folder.path(), &["evodrive_driver.py"]);
    std::fs::write(folder.path().join("careful.py"), code).unwrap();
    let still = "from evodrive_driver import serve\nclass Still:\n    def decide(self, scene, step):\n        return -5.0, 0.0\nserve(Still())\n";
    std::fs::write(folder.path().join("still.py"), still).unwrap();
    let scenes = home().join("experiments/metadrive/cat-idm.toml").display().to_string();
    let ran = here(folder.path(), &["--json", "egos", &scenes, "--driver", "careful.py", "--driver", "still.py"]);
    assert!(ran.stderr.contains(" rollouts played again in another process, all equal"), "{}", ran.stderr);
    let object = json(&ran);
    let row = |name: &str| -> Vec<f64> {
        let line = section.lines().find(|line| line.starts_with(&format!("| {name} |"))).unwrap();
        let percent = |cell: &str| cell.trim().strip_suffix(" %").map(|number| number.parse::<f64>().unwrap() / 100.0);
        line.split('|').filter_map(percent).collect()
    };
    let of = |ego: &str, what: &str| figures(&object, ego)["figures"][what].as_f64().unwrap();
    for (name, ego) in [("`careful.py`", "careful.py"), ("standing still", "still.py"), ("IDM", "idm")] {
        let said = row(name);
        let measured = ["route_completion", "crash_rate", "arrival_rate"].map(|what| of(ego, what));
        let near = said.iter().zip(&measured).all(|(said, measured)| (said - measured).abs() < 0.025);
        assert!(said.len() == 3 && near, "{name}: {said:?} {measured:?}");
    }
    assert!(of("careful.py", "crash_rate") < of("idm", "crash_rate"));
    assert!(of("careful.py", "route_completion") > 10.0 * of("still.py", "crash_rate") / 4.0);
}

/// An IDM that never answers in scenes whose id ends in an odd digit.
fn slow(folder: &Path) {
    copied(folder, &["evodrive_driver.py", "idm.py"]);
    let idm = std::fs::read_to_string(folder.join("idm.py")).unwrap();
    let decide = "    def decide(self, scene, step):\n";
    let waits = "        if step['step'] == 2 and scene['scene'].endswith(('1', '3', '5', '7', '9')):\n            import time\n            time.sleep(600)\n";
    std::fs::write(folder.join("idm.py"), idm.replace(decide, &format!("{decide}{waits}"))).unwrap();
}

#[test]
fn a_planner_that_is_too_slow_has_neither_crashed_nor_arrived_and_is_counted_apart() {
    if !python() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    slow(folder);
    let path = experiment(folder, "mine", &format!("{}timeout_s = 2\n", driver("idm.py")));
    let table = std::fs::read_to_string(&path).unwrap().replace("held_out = 3", "held_out = 6");
    std::fs::write(&path, table).unwrap();
    here(folder, &["scenes", "generate", "mine.toml", "--out", "mine.pool"]);
    let listed = json(&here(folder, &["--json", "egos", "mine.toml", "--driver", "idm.py", "--time-limit", "2"]));
    let (idm, planner) = (figures(&listed, "idm"), figures(&listed, "idm.py"));
    let too_slow = planner["too_slow"].as_u64().unwrap();
    assert!((1..6).contains(&too_slow) && planner["failed"] == 0 && idm["too_slow"] == 0, "{listed}");
    let shown = here(folder, &["egos", "mine.toml", "--driver", "idm.py", "--time-limit", "2"]).stdout;
    assert!(shown.contains("too slow    failed  ego") && shown.contains("neither a crash nor a success"), "{shown}");
    // In every label of a run: the result says in how many scenes.
    let recorded = here(folder, &["record", "mine.toml", "--no-report"]);
    recorded.root();
    let line = recorded.stdout.lines().find(|line| line.contains("held-out scenes the parent is labelled in"));
    let line = line.unwrap_or_else(|| panic!("{}", recorded.stdout));
    let count = format!(
        "The driver was too slow, which is neither a crash nor a success, in {too_slow} and {too_slow} of them."
    );
    assert!(line.contains(&count) && line.contains("because too slow: planner `python3 idm.py`"), "{line}");
    let run = crate::harness::folder_below(&folder.join("runs"));
    let held_out = crate::harness::events(&run)
        .into_iter()
        .find(|event| event["event"]["kind"] == "held_out" || event["kind"] == "held_out");
    let event = held_out.expect("an event").to_string();
    assert!(event.contains("\"too_slow\":true"), "{event}");
    // And where a program is applied, with the count of rollouts that were played again.
    here(folder, &["program", "export", run.to_str().unwrap(), "cat-mine/parent", "--out", "mine.json"]);
    let args = ["apply", "mine.json", "--scenes", "mine.pool", "--driver", "idm.py", "--time-limit", "2"];
    let applied = here(folder, &[&["--json"], &args[..]].concat());
    assert!(applied.stderr.contains(" rollouts played again in another process"), "{}", applied.stderr);
    let object = json(&applied);
    let odd = |scene: &Value| scene["scene"].as_str().unwrap().ends_with(['1', '3', '5', '7', '9']);
    let score = &object["program"]["score"];
    let failures = score["failures"].as_array().unwrap();
    assert!(!failures.is_empty() && failures.iter().all(|of| odd(of) && of["too_slow"] == true), "{score}");
    assert!(score["scenes"].as_array().unwrap().iter().all(|of| !odd(of)), "{score}");
    assert_eq!(object["too_slow"]["program"], failures.len());
    assert!(here(folder, &args).stdout.contains("those are neither crashes nor successes"), "{object}");
    for bad in ["0", "-1", "NaN"] {
        let limit = format!("--time-limit={bad}");
        let ran = here(folder, &["apply", "mine.json", "--scenes", "mine.pool", "--driver", "idm.py", &limit]);
        assert!(
            ran.code == 2 && ran.stderr.contains("expected a number of seconds from 0.001 to 3600"),
            "{}",
            ran.stderr
        );
    }
}

#[test]
fn the_scenes_that_break_a_planner_are_listed_with_a_command_that_plays_each() {
    if !python() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    copied(folder, &["evodrive_driver.py", "idm.py"]);
    let path = experiment(folder, "mine", "");
    here(folder, &["scenes", "generate", path.to_str().unwrap(), "--out", "mine.pool"]);
    assert_eq!(here(folder, &["program", "new", "--family", "cat", "--out", "my.toml"]).code, 0);
    let args = ["apply", "my.toml", "--scenes", "mine.pool", "--driver", "idm.py", "--scenes-broken"];
    let object = json(&here(folder, &[&["--json"], &args[..]].concat()));
    let broken = object["broken"].as_array().unwrap();
    let met: Vec<&str> = object["program"]["score"]["scenes"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|of| of["contact"].is_object())
        .map(|of| of["scene"].as_str().unwrap())
        .collect();
    let under: Vec<&str> =
        broken.iter().filter(|of| of["program"] != "-").map(|of| of["scene"].as_str().unwrap()).collect();
    assert!(!met.is_empty() && met == under, "{met:?} {under:?}");
    // Only where somebody is met: in the others nothing is to be looked at.
    let meets = |of: &Value| ["without", "parent", "program"].iter().any(|under| of[*under] != "-");
    assert!(broken.len() < 12 && broken.iter().all(meets), "{broken:?}");
    let shown = here(folder, &args).stdout;
    let first = &broken[0];
    let command = first["command"].as_str().unwrap();
    for part in [format!("meets somebody in {} of 12 scenes", broken.len()), format!("  {command}\n")] {
        assert!(shown.contains(&part), "{part}: {shown}");
    }
    let words: Vec<&str> =
        command.strip_prefix("evodrive ").unwrap().split(' ').map(|word| word.trim_matches('\'')).collect();
    let played = here(folder, &words);
    assert_eq!(played.code, 0, "{}", played.stderr);
    let player = std::fs::read_to_string(folder.join("played/player.html")).unwrap();
    assert!(player.contains(first["scene"].as_str().unwrap()), "the page plays another scene");
    assert!(!here(folder, &args[..args.len() - 1]).stdout.contains("meets somebody in"));
}
