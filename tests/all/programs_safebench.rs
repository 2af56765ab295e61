//! SafeBench's and ChatScene's own files as programs, and programs as their files: through the binary, on generated routes, and on
//! the shipped files where they are at hand.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::harness::{Ran, evodrive, home, shared};
use evodrive::kernel::Seed;
use evodrive::scene::safebench::TrafficFamily;
use evodrive::scene::{Pool, Scene, pool};
use evodrive::sim::Intervention;
use evodrive::synth::family_scene;

fn ran(words: &[&str]) -> Ran {
    let ran = Ran::of(evodrive().args(words));
    assert_eq!(ran.code, 0, "{words:?}: {}", ran.stderr);
    ran
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn read(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))).unwrap()
}

/// A pool with one scene of each of these families, and where it lies.
fn scenes(folder: &Path, families: &[TrafficFamily], real: bool) -> PathBuf {
    let of = |family: &TrafficFamily| {
        let mut scene = family_scene(*family, 5, Seed(7));
        if real {
            (scene.origin.format, scene.origin.name) = ("safebench".into(), "Town01/scenario_01_route_05.xml".into());
        }
        scene
    };
    let scenes: Vec<Scene> = families.iter().map(of).collect();
    let path = folder.join("families.pool");
    std::fs::write(&path, pool::encode(&Pool::new(scenes, Vec::new()).unwrap())).unwrap();
    path
}

fn published(folder: &Path, family: &str) -> PathBuf {
    let path = folder.join(format!("{family}.toml"));
    ran(&["program", "new", "--family", family, "--out", text(&path)]);
    path
}

/// Numbers that no formula of ours makes.
fn values(of: u32) -> Vec<f64> {
    (0..100).map(|k| (f64::from(k * k + 17 * of) * 0.001_370_3).fract()).collect()
}

#[test]
fn a_sequence_of_a_file_is_what_the_adversary_plays_and_what_comes_out_again() {
    let dir = tempfile::tempdir().unwrap();
    let pool = scenes(dir.path(), &TrafficFamily::ALL, false);
    let of_method = |first: u32| -> Value {
        let of = |scenario: u32| (scenario.to_string(), json!({"0": values(99), "1": values(first + scenario)}));
        Value::Object((1..=8).map(of).collect())
    };
    let file = dir.path().join("sequences.json");
    std::fs::write(&file, json!({"advsim": of_method(0), "advtraj": of_method(20)}).to_string()).unwrap();
    for (method, list, first, tolerance) in [("advsim", "advsim", 0, 1e-15), ("adv_trajectory", "advtraj", 20, 1e-9)] {
        let (program, out) = (dir.path().join(format!("{method}.toml")), dir.path().join(method));
        ran(&["program", "import", text(&file), "--method", method, "--take", "1", "--out", text(&program)]);
        let said = ran(&[
            "program",
            "export",
            text(&program),
            "--format",
            "safebench",
            "--scenes",
            text(&pool),
            "--out",
            text(&out),
        ]);
        assert!(!said.stdout.contains("left out"), "{}", said.stdout);
        let entries = read(&out.join(format!("scenario_type/{list}.json")));
        assert_eq!(entries.as_array().unwrap().len(), 8);
        assert_eq!(
            (&entries[0]["scenario_folder"], &entries[0]["route_id"], &entries[0]["parameters"]),
            (&json!(method), &json!(5), &json!("0.json"))
        );
        for scenario in 1..=8 {
            let played: Vec<f64> =
                serde_json::from_value(read(&out.join(format!("model_ckpt/{list}/{scenario}/0.json")))).unwrap();
            let wanted = values(first + scenario);
            let off = played.iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(played.len() == 100 && off <= tolerance, "{method}, scenario {scenario}: {off}");
        }
        // What the list names is read again as the same program.
        let again = dir.path().join(format!("{method}-again.toml"));
        let name = list;
        let (list, folder) = (out.join(format!("scenario_type/{list}.json")), out.join(format!("model_ckpt/{list}")));
        ran(&["program", "import", text(&list), "--sequences", text(&folder), "--out", text(&again)]);
        // Without scenes a sequence comes out as it was read.
        let back = dir.path().join(format!("{method}-back"));
        ran(&["program", "export", text(&again), "--format", "safebench", "--out", text(&back)]);
        let third = "3/0.json";
        assert_eq!(read(&back.join(format!("model_ckpt/{name}/{third}"))), read(&folder.join(third)));
        let second = dir.path().join(format!("{method}-second"));
        ran(&[
            "program",
            "export",
            text(&again),
            "--format",
            "safebench",
            "--scenes",
            text(&pool),
            "--out",
            text(&second),
        ]);
        for scenario in (1..=8).filter(|_| method == "advsim") {
            let name = format!("model_ckpt/advsim/{scenario}/0.json");
            assert_eq!(read(&second.join(&name)), read(&out.join(&name)), "the same speeds bit for bit");
        }
        // Without scenes it is what the file said, on every route.
        let whole = dir.path().join(format!("{method}-whole"));
        ran(&["program", "export", text(&program), "--format", "safebench", "--out", text(&whole)]);
        assert_eq!(read(&whole.join(format!("model_ckpt/{name}/3/0.json"))), json!(values(first + 3)));
        assert_eq!(read(&whole.join(format!("scenario_type/{name}.json"))).as_array().unwrap().len(), 80);
    }
}

#[test]
fn a_searched_sequence_has_the_form_until_its_trigger_is_moved() {
    let dir = tempfile::tempdir().unwrap();
    let pool = scenes(dir.path(), &[TrafficFamily::RedLightRunning], false);
    let program = published(dir.path(), "advsim");
    let export = |out: &str| {
        Ran::of(
            evodrive()
                .args(["program", "export", text(&program), "--format", "safebench", "--scenes", text(&pool), "--out"])
                .arg(dir.path().join(out)),
        )
    };
    let first = export("first");
    assert_eq!(first.code, 0, "{}", first.stderr);
    assert!(dir.path().join("first/model_ckpt/advsim/5/0.json").exists(), "{}", first.stdout);
    ran(&["program", "set", text(&program), "/parameters/speed_trigger_shift_m", "4"]);
    let moved = export("moved");
    assert_eq!(moved.code, 2);
    assert!(moved.stderr.contains("it is set off at 39 m, SafeBench's class at 35 m"), "{}", moved.stderr);
    assert!(moved.stderr.contains("--format openscenario"), "and says what has a form for it: {}", moved.stderr);
    let unnamed =
        Ran::of(evodrive().args(["program", "export", text(&program), "--format", "safebench", "--out", "/nowhere"]));
    assert!(unnamed.code == 2 && unnamed.stderr.contains("name scenes with --scenes"), "{}", unnamed.stderr);
}

#[test]
fn a_grid_comes_out_as_a_list_and_goes_in_as_the_same_program() {
    let dir = tempfile::tempdir().unwrap();
    let program = published(dir.path(), "human");
    ran(&["program", "set", text(&program), "/parameters/right_turn_trigger_m", "31.25"]);
    ran(&["program", "set", text(&program), "/parameters/grid_reach", "0.5"]);
    let (out, again) = (dir.path().join("out"), dir.path().join("again.toml"));
    ran(&["program", "export", text(&program), "--format", "safebench", "--out", text(&out)]);
    let list = out.join("scenario_type/human.json");
    let entries = read(&list);
    assert_eq!(entries.as_array().unwrap().len(), 740, "as many as in the benchmark's own");
    ran(&["program", "import", text(&list), "--out", text(&again)]);
    let hash = |path: &Path| {
        let shown = ran(&["program", "show", text(path)]).stdout;
        shown.lines().find(|line| line.starts_with("hash")).unwrap().to_string()
    };
    assert_eq!(hash(&again), hash(&program));
}

#[test]
fn scripts_that_wait_are_written_for_carla_and_recorded_road_users_are_not() {
    let dir = tempfile::tempdir().unwrap();
    let program = published(dir.path(), "human");
    let pool = scenes(dir.path(), &TrafficFamily::ALL, true);
    let out = dir.path().join("played");
    ran(&[
        "program",
        "export",
        text(&program),
        "--format",
        "intervention",
        "--scenes",
        text(&pool),
        "--out",
        text(&out),
    ]);
    let list = read(&out.join("scenario_type/evodrive.json"));
    assert_eq!(list.as_array().unwrap().len(), 8);
    let written = read(&out.join("model_ckpt/evodrive/1/0.json"));
    // What the scenario class is tested with has the same fields.
    let fixture = read(&home().join("bridges/safebench/tests/walker.json"));
    let keys = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!((keys(&written), written["town"].as_str()), (keys(&fixture), Some("Town01")));
    for of in [&written, &fixture] {
        let actions: Intervention = serde_json::from_value(json!({"actions": of["actions"]})).unwrap();
        assert_eq!(actions.actions.len(), 2);
    }
    for format in ["openscenario", "openscenario-1.0"] {
        let out = dir.path().join(format);
        let said = ran(&[
            "program",
            "export",
            text(&program),
            "--format",
            format,
            "--scenes",
            text(&pool),
            "--out",
            text(&out),
        ]);
        assert_eq!(
            std::fs::read_dir(&out).unwrap().count(),
            8,
            "a town's own road is not written again: {}",
            said.stdout
        );
        // Each waits for the ego at the distance that the intervention says; time alone begins nothing but the act.
        for entry in std::fs::read_dir(&out).unwrap() {
            let path = entry.unwrap().path();
            let written = std::fs::read_to_string(&path).unwrap();
            assert_eq!(written.matches("<SimulationTimeCondition").count(), 2, "{}", path.display());
            assert!(written.contains("filepath=\"Town01"), "the town's own road: {}", path.display());
            assert!(!written.contains("<Timing"), "nobody is frozen: {}", path.display());
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let of = TrafficFamily::ALL.into_iter().find(|family| name.contains(family.name())).unwrap();
            let played = read(&dir.path().join(format!("played/model_ckpt/evodrive/{}/0.json", of.number())));
            let distance = played["actions"][0]["triggered"]["trigger"]["distance_m"].as_f64().unwrap();
            let first = written.split("<RelativeDistanceCondition").nth(1).unwrap();
            assert!(first.split('>').next().unwrap().contains(&format!("value=\"{distance}\"")), "{first}");
        }
    }
    let generated = tempfile::tempdir().unwrap();
    let other = scenes(generated.path(), &[TrafficFamily::RightTurn], false);
    let out = generated.path().join("osc");
    ran(&[
        "program",
        "export",
        text(&program),
        "--format",
        "openscenario",
        "--scenes",
        text(&other),
        "--out",
        text(&out),
    ]);
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 2, "a generated road goes along");
    let refused = Ran::of(evodrive().args([
        "program",
        "export",
        text(&program),
        "--format",
        "intervention",
        "--scenes",
        text(&other),
        "--out",
        "/nowhere",
    ]));
    assert!(
        refused.code == 2 && refused.stderr.contains("a generated road, which no town of CARLA has"),
        "{}",
        refused.stderr
    );
}

#[test]
fn the_shipped_files_are_read_as_they_are() {
    let (Some(lists), Some(chat)) = (shared("data/safebench/scenario_type"), shared("data/chatscene")) else { return };
    let dir = tempfile::tempdir().unwrap();
    let import = |words: &[&str]| {
        let out = dir.path().join("made.json");
        let mut all = vec!["program", "import"];
        all.extend(words);
        all.extend(["--overwrite", "--out", text(&out)]);
        ran(&all);
        read(&out)
    };
    let parent = dir.path().join("human.json");
    ran(&["program", "new", "--family", "human", "--out", text(&parent)]);
    let human = lists.join("human.json");
    assert_eq!(
        import(&[text(&human)])["program_hash"],
        read(&parent)["program_hash"],
        "human.json is the published parent"
    );
    // And back: the same numbers, entry by entry.
    let out = dir.path().join("human");
    ran(&["program", "export", text(&parent), "--format", "safebench", "--out", text(&out)]);
    let sorted = |path: &Path| {
        let mut entries: Vec<(u64, u64, Vec<f64>)> = read(path)
            .as_array()
            .unwrap()
            .iter()
            .map(|of| {
                (
                    of["scenario_id"].as_u64().unwrap(),
                    of["route_id"].as_u64().unwrap(),
                    serde_json::from_value(of["parameters"].clone()).unwrap(),
                )
            })
            .collect();
        entries.sort_by(|a, b| a.partial_cmp(b).unwrap());
        entries
    };
    assert_eq!(sorted(&out.join("scenario_type/human.json")), sorted(&human));
    let random = lists.join("random.json");
    let entries = read(&random);
    let made = import(&[text(&random), "--route", "7", "--take", "3"]);
    let of = |scenario: u64| {
        let own = |of: &&Value| of["scenario_id"] == scenario && of["route_id"] == 7;
        entries.as_array().unwrap().iter().filter(own).nth(3).unwrap()["parameters"].clone()
    };
    let names = ["speed_mps", "trigger_m"]
        .map(|name| made["program"]["parameters"][format!("crossing_negotiation_{name}")].clone());
    assert_eq!(json!(names), of(8));
    let sequences = chat.join("advsim_advtraj_control_sequences.json");
    let shipped = read(&sequences);
    for (method, take) in [("advsim", "4"), ("advtraj", "9")] {
        let made = import(&[text(&sequences), "--method", method, "--take", take]);
        for (family, scenario) in TrafficFamily::ALL.map(|family| (family.name(), family.number().to_string())) {
            let numbers = |value: &Value| serde_json::from_value::<Vec<f64>>(value.clone()).unwrap();
            assert_eq!(
                numbers(&made["sequences"][family]),
                numbers(&shipped[method][&scenario][take]),
                "{method} {family}"
            );
        }
    }
    let ranges = import(&[text(&chat.join("scenario_1.json")), "--route", "2"]);
    let own = &read(&chat.join("scenario_1.json"))["OPT_behavior_1_opt_ROUTE-2"]["opt_time_5"];
    for (name, of) in
        [("speed_mps", "OPT_ADV_SPEED"), ("trigger_m", "OPT_ADV_DISTANCE"), ("act_within_m", "OPT_STOP_DISTANCE")]
    {
        for end in ["low", "high"] {
            let number = ranges["program"]["parameters"][format!("roadside_{name}_{end}")].as_f64();
            assert_eq!(number, own[of][end].as_f64(), "{name} {end}");
        }
    }
}
