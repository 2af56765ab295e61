//! A planner in Python that asks for more: the observation of a learned ego, the program that it drives under, the labels behind each
//! rollout; and that abandons scenes.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::backends::experiment;
use crate::harness::{Ran, events, evodrive, folder_below};
use crate::own_ego::{copied, driver, python};

/// Planner that steers by the numbers of the observation, abandons odd scenes under programs, and writes down what it was told.
const PLANNER: &str = r#"
import json, os
from evodrive_driver import Abandon, Action, serve

class Asks:
    def begin(self, scene):
        odd = scene["scene"][-1] in "13579"
        self.abandons = odd and scene["under"]["kind"] != "plain"
        self.steps = 0

    def decide(self, scene, step):
        if self.abandons and step["step"] == 3:
            raise Abandon("odd-number")
        self.steps += 1
        seen = step["observation"]
        pedal = 0.3 if seen[8] == 0 else -1.0
        return Action(steering=2.0 * seen[4] - 0.3 * seen[3], pedal=pedal)

    def end(self, scene, end):
        told = {"scene": scene["scene"], "under": scene["under"], "end": end, "decided": self.steps}
        with open(f"told-{os.getpid()}", "a") as out:
            out.write(json.dumps(told) + "\n")

serve(Asks())
"#;

/// Returns the file that each process of the planner wrote.
fn own(folder: &Path) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    files.filter(|path| path.file_name().unwrap().to_str().unwrap().starts_with("told-")).collect()
}

fn told(folder: &Path) -> Vec<Value> {
    own(folder)
        .into_iter()
        .flat_map(|path| {
            let text = std::fs::read_to_string(path).unwrap();
            text.lines().map(|line| serde_json::from_str(line).unwrap()).collect::<Vec<Value>>()
        })
        .collect()
}

fn json(ran: &Ran) -> Value {
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    serde_json::from_str(&ran.stdout).unwrap()
}

fn is_odd(scene: &Value) -> bool {
    scene.as_str().unwrap().ends_with(['1', '3', '5', '7', '9'])
}

#[test]
fn a_planner_hears_what_it_asks_for_and_what_it_abandons_is_recorded_and_counted_apart() {
    if !python() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    copied(folder, &["evodrive_driver.py"]);
    std::fs::write(folder.join("asks.py"), PLANNER).unwrap();
    let table = format!("{}observe = \"metadrive-1\"\nblind = false\n", driver("asks.py"));
    let path = experiment(folder, "mine", &table);
    let changes = [
        ("held_out = 3", "held_out = 6"),
        ("slots = 1", "slots = 4"),
        ("max_repair_rounds = 0", "max_repair_rounds = 1"),
    ];
    let text = std::fs::read_to_string(&path).unwrap();
    let text = changes.into_iter().fold(text, |text, (from, to)| text.replace(from, to));
    std::fs::write(&path, &text).unwrap();
    let here = |args: &[&str]| Ran::of(evodrive().current_dir(folder).args(args));
    let recorded = here(&["record", "mine.toml", "--no-report", "--out", "a"]);
    let root = recorded.root();
    // Behind every rollout the labels, and of each under which program it was.
    let all = told(folder);
    let kind = |of: &&Value, kind: &str| of["under"]["kind"] == kind;
    assert!(["plain", "parent", "program"].iter().all(|name| all.iter().any(|of| kind(&of, name))));
    for of in &all {
        let end = &of["end"];
        let abandoned = of["under"]["kind"] != "plain" && is_odd(&of["scene"]);
        assert_eq!(end["end"] == "abandoned", abandoned, "{of}");
        if abandoned {
            assert_eq!((&of["decided"], &end["steps"], end.get("labels")), (&3.into(), &3.into(), None), "{of}");
        } else {
            assert_eq!(of["decided"], end["steps"]);
            let (labels, outcome) = (&end["labels"], &end["outcome"]);
            assert_eq!(labels["collision"], end["end"] == "contact", "{of}");
            assert_eq!(labels["collision"], outcome["contact"].is_object());
            assert_eq!(labels["route_completion"], outcome["route_completion"]);
        }
    }
    assert!(all.iter().any(|of| of["end"]["labels"]["route_completion"].as_f64().is_some_and(|share| share > 0.5)));
    // The programs are those of the run.
    let run = folder_below(&folder.join("a"));
    let hashes: Vec<Value> = all.iter().map(|of| of["under"]["program"].clone()).filter(|of| !of.is_null()).collect();
    let kept = events(&run).iter().map(Value::to_string).collect::<String>();
    assert!(hashes.iter().all(|hash| kept.contains(hash.as_str().unwrap())), "{hashes:?}");
    // Counted apart, in the result and in the events.
    let line = recorded.stdout.lines().find(|line| line.contains("held-out scenes the parent is labelled in"));
    let line = line.unwrap_or_else(|| panic!("{}", recorded.stdout));
    let said = " The driver abandoned the scene, which is neither a crash nor a success, in ";
    assert!(line.contains(said) && line.contains("decision 3 (0.3 s): odd-number"), "{line}");
    assert!(kept.contains("\"abandoned\":true") && !kept.contains("\"too_slow\":true"));
    let count = recorded.stderr.lines().find(|line| line.contains("rollouts in")).unwrap().to_string();
    assert!(count.contains("; 0 of them failed, the planner abandoned "), "{count}");
    // An abandoned scene is an answer: it replays without the planner, and is not asked again when more is recorded.
    let asked = all.len();
    assert_eq!(here(&["run", "mine.toml", "--no-report", "--out", "b"]).root(), root);
    let verified = here(&["verify", run.to_str().unwrap()]);
    assert_eq!(verified.code, 0, "{}", verified.stderr);
    assert_eq!(here(&["record", "mine.toml", "--no-report", "--out", "c"]).root(), root);
    assert_eq!(told(folder).len(), asked, "nobody is asked twice");
    // Where a program is applied it is told from its parent.
    own(folder).iter().for_each(|file| std::fs::remove_file(file).unwrap());
    here(&["program", "export", run.to_str().unwrap(), "cat-mine/parent", "--out", "mine.json"]);
    here(&["scenes", "generate", "mine.toml", "--out", "mine.pool"]);
    let apply = ["apply", "mine.json", "--scenes", "mine.pool", "--driver", "mine.toml", "--scenes-broken"];
    let object = json(&here(&[&["--json"], &apply[..]].concat()));
    let failures = object["program"]["score"]["failures"].as_array().unwrap();
    assert!(!failures.is_empty() && failures.iter().all(|of| is_odd(&of["scene"]) && of["abandoned"] == true));
    assert_eq!((&object["abandoned"]["program"], &object["abandoned"]["replay"]), (&failures.len().into(), &0.into()));
    let shown = here(&apply).stdout;
    let sentence =
        format!("abandoned: the driver abandoned 0 scenes without a program, {0} under the parent", failures.len());
    assert!(shown.contains(&sentence), "{sentence}: {shown}");
    let kinds: std::collections::BTreeSet<String> =
        told(folder).iter().map(|of| of["under"]["kind"].to_string()).collect();
    assert!(kinds.iter().eq(["\"parent\"", "\"plain\""]), "the parent alone was applied: {kinds:?}");
    // Told less it is another planner, and so it is by another observation.
    for (from, to, expected) in [
        ("blind = false\n", "", "was recorded with another planner: its digest is "),
        ("metadrive-1", "safebench-1", "was recorded with another planner: its digest is "),
        ("metadrive-1", "metadrive-2", "driver.observe is \"metadrive-2\", expected "),
        ("blind = false", "blind = 0", "driver.blind is 0, expected true or false"),
    ] {
        let changed = text.replace(from, to);
        assert_ne!(changed, text);
        std::fs::write(&path, changed).unwrap();
        let refused = here(&["run", "mine.toml", "--no-report", "--out", "d"]);
        assert!(refused.code == 2 && refused.stderr.contains(expected), "{expected}: {}", refused.stderr);
    }
}
