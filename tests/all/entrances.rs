//! Everything that comes from outside goes through the same checks, whatever way it comes: docs/QUALITY.md lists which check stands at
//! which entrance, and here each of them gets the bad input and is to refuse it, with its place and what to do.
#![cfg(target_os = "linux")]

use std::ffi::OsStr;
use std::io::Write;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use evodrive::scene::Scene;
use evodrive::scene::pool::{self, Pool};
use evodrive::sim::Plant;
use evodrive::suite::Suite;
use serde_json::{Value, json};

use crate::backends::{experiment, worker};
use crate::harness::{Ran, evodrive, folder_below, home, skip, text};

/// Sends an entrance the bad input of a check: returns nothing where it is refused as it should be, else what was seen.
type Trial = fn(&Path) -> Result<(), String>;

/// Entrance, check, trial. Those of Python are carried out in Python.
const TRIALS: [(&str, &str, Trial); 24] = [
    ("arguments", "name", odd_arguments),
    ("arguments", "length", long_name),
    ("arguments", "threads", many_jobs),
    ("arguments", "shown", |dir| shown(&here(dir, &["run", "a\u{202e}b\u{1b}[2J.toml"]), "a\\u{202e}b\\u{1b}[2J.toml")),
    ("arguments", "cut", |dir| cut(&here(dir, &["run", &"a".repeat(100_000)]))),
    ("scene files", "scene", |dir| refused(&imported(dir, 1e7, "far"), 0, &["farther than 100 km"])),
    ("scene files", "name", odd_file),
    ("scene files", "shown", |dir| shown(&imported(dir, 1.0, "a\u{202e}b"), "a\\u{202e}b")),
    ("pools", "scene", far_pool),
    ("suites", "scene", far_suite),
    ("TOML", "size", heavy_toml),
    ("TOML", "shown", |dir| shown(&keyed(dir, "a\u{202e}b"), "a\\u{202e}b")),
    ("TOML", "cut", |dir| cut(&keyed(dir, &"a".repeat(3_000_000)))),
    ("worker", "scene", far_request),
    ("worker", "size", long_request),
    ("worker", "shown", |_| shown(&asked(br#"{"a\u202eb": 1}"#), "a\\u{202e}b")),
    ("worker", "cut", |_| cut(&asked(format!("{{\"{}\": 1}}", "a".repeat(3_000_000)).as_bytes()))),
    ("programs", "size", long_line),
    ("programs", "shown", |dir| said_by_programs(dir, |ran| shown(ran, "b\\u{202e}c"))),
    ("programs", "cut", |dir| said_by_programs(dir, cut)),
    ("programs", "keys", |dir| said_by_programs(dir, hidden)),
    ("run folders", "place", read_only),
    ("run folders", "lock", odd_lock),
    ("run folders", "cost", emptied_cost),
];

/// The list in docs/QUALITY.md: entrance and check.
fn listed() -> Vec<(String, String)> {
    let page = text("docs/QUALITY.md");
    let (_, rest) = page.split_once("## Entrances").expect("the section");
    let lines = rest.lines().skip_while(|line| !line.starts_with("- ")).map_while(|line| line.strip_prefix("- "));
    let rows = lines.map(|line| line.split_once(": ").expect("an entrance and its checks"));
    rows.flat_map(|(entrance, checks)| checks.split(", ").map(|check| (entrance.to_string(), check.to_string())))
        .collect()
}

#[test]
fn every_entrance_refuses_the_bad_input_of_every_check_that_the_page_lists() {
    let mut listed = listed();
    let python: Vec<String> =
        listed.extract_if(.., |(entrance, _)| entrance == "Python").map(|(_, check)| check).collect();
    let mut tried: Vec<(String, String)> =
        TRIALS.iter().map(|(entrance, check, _)| (entrance.to_string(), check.to_string())).collect();
    listed.sort();
    tried.sort();
    assert_eq!(tried, listed, "docs/QUALITY.md lists what is tried here");
    let wrong: Vec<String> = TRIALS
        .iter()
        .filter_map(|(entrance, check, trial)| {
            let dir = tempfile::tempdir().unwrap();
            trial(dir.path()).err().map(|seen| format!("{entrance}, {check}: {seen}"))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    // The package is built and tried by .ci/python.
    let tests = text("bridges/python/tests/test_entrances.py");
    for check in python {
        assert!(tests.contains(&format!("def test_{check}(")), "Python, {check}: no test of that name");
    }
}

fn here(dir: &Path, args: &[&str]) -> Ran {
    Ran::of(evodrive().current_dir(dir).args(args))
}

fn refused(ran: &Ran, code: i32, words: &[&str]) -> Result<(), String> {
    let all = format!("{}{}", ran.stdout, ran.stderr);
    let told = if all.len() > 2000 { "a long text".into() } else { all.clone() };
    match words.iter().find(|word| !all.contains(**word)) {
        _ if ran.code != code => Err(format!("exit {}, expected {code}: {told}", ran.code)),
        Some(word) => Err(format!("{word:?} is not in: {told}")),
        None => Ok(()),
    }
}

/// Checks that characters that act on a terminal are printed as their numbers.
fn shown(ran: &Ran, escaped: &str) -> Result<(), String> {
    let all = format!("{}{}", ran.stdout, ran.stderr);
    if all.contains(['\u{202e}', '\u{1b}']) || !all.contains(escaped) {
        return Err(format!("exit {}, expected {escaped}, found {all:?}", ran.code));
    }
    Ok(())
}

/// A text without end is cut, and what was left out is said.
fn cut(ran: &Ran) -> Result<(), String> {
    let (bytes, said) = (ran.stdout.len() + ran.stderr.len(), format!("{}{}", ran.stdout, ran.stderr));
    if bytes > 100_000 || !said.contains("are left out here") || ran.code != 2 {
        return Err(format!("exit {}, {bytes} bytes printed", ran.code));
    }
    Ok(())
}

fn odd_name(ending: &str) -> PathBuf {
    PathBuf::from(OsStr::from_bytes(&[b"caf\xe9", ending.as_bytes()].concat()))
}

/// Every command, as the golden of their help texts lists them.
fn commands() -> Vec<Vec<String>> {
    let help = text("golden/help.txt");
    let usage = help.lines().filter_map(|line| line.trim().strip_prefix("Usage: evodrive "));
    let words = |line: &str| {
        line.split(' ')
            .take_while(|word| word.starts_with(|c: char| c.is_ascii_lowercase()))
            .map(String::from)
            .collect()
    };
    usage.map(words).filter(|words: &Vec<String>| !words.is_empty()).collect()
}

fn odd_arguments(dir: &Path) -> Result<(), String> {
    let commands = commands();
    if commands.len() < 60 {
        return Err(format!("{} commands in golden/help.txt", commands.len()));
    }
    for words in commands {
        let ran = Ran::of(evodrive().current_dir(dir).args(&words).arg(odd_name(".toml")));
        refused(&ran, 2, &["expected UTF-8, found \"caf\\xE9.toml\"", "mv"])
            .map_err(|seen| format!("{words:?}: {seen}"))?;
    }
    let below = dir.join(odd_name(""));
    std::fs::create_dir(&below).unwrap();
    refused(&here(&below, &["families"]), 2, &["the folder of the command: expected UTF-8"])?;
    let left = std::fs::read_dir(dir).unwrap().count() + std::fs::read_dir(&below).unwrap().count();
    if left == 1 { Ok(()) } else { Err(format!("{left} files are there")) }
}

fn long_name(dir: &Path) -> Result<(), String> {
    let far = "n".repeat(250);
    let out = format!("{far}.pool");
    let fixture = home().join("tests/fixtures/commonroad/two_lanes_2018b.xml").display().to_string();
    let path = experiment(dir, "mine", "").display().to_string();
    for args in [
        &["scenes", "import", &fixture, "--out", &out][..],
        &["record", &path, "--cassette", &out],
        &["record", &path, "--out", &"n".repeat(300)],
        &["check", &far],
        &["scenes", "list", &"n".repeat(300)],
    ] {
        refused(&here(dir, args), 2, &[]).map_err(|seen| format!("{}: {seen}", args[0]))?;
    }
    // Nothing was computed for a file that cannot be written.
    if dir.join("runs").exists() {
        Err("a run was begun".into())
    } else {
        refused(&here(dir, &["record", &path, "--cassette", &out]), 2, &["choose a shorter name"])
    }
}

fn many_jobs(dir: &Path) -> Result<(), String> {
    let path = experiment(dir, "mine", "").display().to_string();
    let fixture = home().join("tests/fixtures/commonroad/two_lanes_2018b.xml").display().to_string();
    for args in [&["run", &path][..], &["scenes", "import", &fixture, "--out", "x.pool"]] {
        let ran = here(dir, &[args, &["--jobs", "20000"]].concat());
        refused(&ran, 2, &["at most 1024 worker threads, found 20000"]).map_err(|seen| format!("{args:?}: {seen}"))?;
    }
    Ok(())
}

/// Runs `scenes import` on a scene of this name in which the numbers of somebody's drive are scaled by `metre`.
fn imported(dir: &Path, metre: f64, name: &str) -> Ran {
    let object = |id: i64, x: f64| {
        json!({
            "id": id, "type": "vehicle", "length": 4.6, "width": 1.9, "heading": vec![0.0; 30], "valid": vec![true; 30],
            "position": (0..30).map(|k| json!({"x": metre * (x + f64::from(k)), "y": 0.0, "z": 0.0})).collect::<Vec<_>>(),
            "velocity": vec![json!({"x": 10.0, "y": 0.0}); 30],
        })
    };
    let scene = json!({
        "name": name, "scenario_id": name, "objects": [object(7, 0.0), object(9, 20.0)],
        "roads": [{"id": 50, "map_element_id": 2, "type": "lane", "geometry": [{"x": -20.0, "y": 0.0}, {"x": 90.0, "y": 0.0}]}],
        "tl_states": {}, "metadata": {"sdc_track_index": 0, "objects_of_interest": []},
    });
    std::fs::write(dir.join("one.json"), scene.to_string()).unwrap();
    here(dir, &["scenes", "import", "one.json", "--out", "one.pool"])
}

fn odd_file(dir: &Path) -> Result<(), String> {
    std::fs::create_dir(dir.join("scenes")).unwrap();
    std::fs::copy(
        home().join("tests/fixtures/commonroad/two_lanes_2018b.xml"),
        dir.join("scenes").join(odd_name(".xml")),
    )
    .unwrap();
    refused(
        &here(dir, &["scenes", "import", "scenes", "--out", "x.pool"]),
        2,
        &["expected a name in UTF-8", "rename it"],
    )
}

/// The shipped suite.
fn suite() -> Suite {
    let bytes = evodrive::store::read_text(&home().join("golden/suite/starter.suite"), 1 << 30).unwrap().unwrap();
    evodrive::suite::decode("starter.suite", &bytes).unwrap().suite
}

/// A sound scene.
fn scene() -> Scene {
    static SCENE: OnceLock<Scene> = OnceLock::new();
    SCENE.get_or_init(|| suite().pool.scenes.swap_remove(0)).clone()
}

fn far_pool(dir: &Path) -> Result<(), String> {
    let mut scene = scene();
    scene.ego.route[0].x = 1e7;
    std::fs::write(dir.join("far.pool"), pool::encode(&Pool::new(vec![scene], Vec::new()).unwrap())).unwrap();
    refused(&here(dir, &["scenes", "list", "far.pool"]), 2, &["points_are_finite_and_near: ego.route"])
}

fn far_suite(dir: &Path) -> Result<(), String> {
    let mut suite = suite();
    suite.pool.scenes[0].ego.route[0].x = 1e7;
    std::fs::write(dir.join("far.suite"), evodrive::suite::encode(&suite).unwrap().0).unwrap();
    refused(
        &here(dir, &["suite", "run", "far.suite", "--driver", "idm"]),
        2,
        &["points_are_finite_and_near: ego.route"],
    )
}

fn heavy_toml(dir: &Path) -> Result<(), String> {
    let tables: String = (0..60_000).map(|k| format!("k{k}={{a.b.c=1}}\n")).collect();
    std::fs::write(dir.join("heavy.toml"), tables).unwrap();
    refused(&here(dir, &["run", "heavy.toml"]), 2, &["bytes of memory"])
}

/// Runs an experiment that has a key of this name.
fn keyed(dir: &Path, key: &str) -> Ran {
    let path = experiment(dir, "mine", &format!("[memory]\n\"{key}\" = 1"));
    here(dir, &["run", path.to_str().unwrap()])
}

/// A request to a worker, with a scene that was changed.
fn request(change: impl FnOnce(&mut Scene)) -> Vec<u8> {
    let mut scene = scene();
    let plant = Plant::new(&scene).unwrap();
    let (first_step, steps) = (plant.first_step(), plant.steps());
    change(&mut scene);
    let asked = json!({
        "request": "00".repeat(32), "scene": scene, "first_step": first_step, "steps": steps, "ego": "idm", "seed": 7,
        "adversaries": [], "options": {"plant": "physical"},
    });
    asked.to_string().into_bytes()
}

/// Sends a line to a worker and returns its output.
fn asked(line: &[u8]) -> Ran {
    let mut started = evodrive();
    started.arg("worker").stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut worker = started.spawn().unwrap();
    // It may have refused the line before its end.
    let _ = worker.stdin.take().unwrap().write_all(&[line, b"\n"].concat());
    let ended = worker.wait_with_output().unwrap();
    Ran {
        code: ended.status.code().unwrap_or(-1),
        stdout: String::from_utf8_lossy(&ended.stdout).into_owned(),
        stderr: String::from_utf8_lossy(&ended.stderr).into_owned(),
    }
}

fn far_request(_: &Path) -> Result<(), String> {
    refused(&asked(&request(|_| ())), 0, &["\"end\":"])?;
    for far in [1e6, 1e7, 1e16] {
        let ran = asked(&request(|scene| scene.ego.route[0].x = far));
        refused(&ran, 0, &["failure", "points_are_finite_and_near: ego.route"])
            .map_err(|seen| format!("{far}: {seen}"))?;
    }
    let many = asked(&request(|scene| {
        scene.ego.route = (0..9).map(|k| evodrive::kernel::Vec2::new(f64::from(k % 2) * 9e3, 0.0)).collect()
    }));
    refused(&many, 0, &["failure", "route_is_plausible"])
}

fn long_request(_: &Path) -> Result<(), String> {
    refused(&asked(&vec![b'['; 33 << 20]), 2, &["standard input: a request: expected at most 33554432 bytes"])
}

/// A planner, a simulator's worker and a model that are this shell script, each asked by `record`.
fn programs(dir: &Path, script: &str) -> Vec<(&'static str, Ran)> {
    std::fs::write(dir.join("bad.sh"), script).unwrap();
    let script = dir.join("bad.sh").display().to_string();
    let planner = "[[lineage]]\nid = \"cat-mine\"\nfamily = \"cat\"\nego = \"command\"\n\
                   [driver]\ncommand = [\"sh\", \"bad.sh\"]\nfiles = [\"bad.sh\"]\ncassette = \"mine.jsonl.zst\"\nprocesses = 1\n";
    let model = format!(
        "[roles]\nactor = \"me\"\n[models.me]\nkind = \"command\"\nmodel = \"x\"\nprovenance = \"sh\"\n\
         [models.me.command]\nprogram = [\"sh\", \"{script}\"]\ntimeout_s = 60\n"
    );
    let all = [("planner", planner.to_string()), ("simulator", worker(&["sh", &script])), ("model", model)];
    all.into_iter()
        .map(|(name, table)| {
            let path = experiment(dir, name, &table);
            let mut command = evodrive();
            command.current_dir(dir).args(["record", "--no-report", "--jobs", "1", "--out", name]).arg(path);
            (name, Ran::of(command.env("MY_API_KEY", "geheim-0815-4711").env("DB_PASSWORD", "hush77")))
        })
        .collect()
}

/// Says too much of everything on its standard error, and ends.
const TALKS: &str = "head -c 50000000 /dev/zero | tr '\\0' a >&2\n\
                     printf '\\nb\\342\\200\\256c key %s, API_KEY=abc123 and %s\\n' \"$MY_API_KEY\" \"$DB_PASSWORD\" >&2\nexit 3\n";

fn said_by_programs(dir: &Path, check: impl Fn(&Ran) -> Result<(), String>) -> Result<(), String> {
    static RAN: OnceLock<Vec<(&str, Ran)>> = OnceLock::new();
    let all = RAN.get_or_init(|| programs(dir, TALKS));
    all.iter().try_for_each(|(name, ran)| check(ran).map_err(|seen| format!("{name}: {seen}")))
}

fn hidden(ran: &Ran) -> Result<(), String> {
    let all = format!("{}{}", ran.stdout, ran.stderr);
    match ["geheim", "abc123", "hush77"].iter().find(|key| all.contains(**key)) {
        Some(key) => Err(format!("{key} is told: {}", &all[all.len().saturating_sub(2000)..])),
        None => refused(ran, 2, &["key [key], API_KEY=[key] and [key]"]),
    }
}

/// A line without an end.
fn long_line(dir: &Path) -> Result<(), String> {
    let script = "head -c 40000000 /dev/zero | tr '\\0' a\nsleep 60\n";
    for (name, ran) in programs(dir, script) {
        let words: &[&str] = if name == "model" { &["more than 1048576 bytes"] } else { &["more than 16777216 bytes"] };
        let words = if name == "simulator" { &["at most 16777216 bytes"][..] } else { words };
        refused(&ran, 2, words).map_err(|seen| format!("{name}: {seen}"))?;
    }
    Ok(())
}

/// A finished run in a folder, and its root.
fn recorded(dir: &Path) -> (PathBuf, String) {
    let path = experiment(dir, "mine", "");
    let ran = Ran::of(evodrive().current_dir(dir).args(["record", "--no-report"]).arg(path));
    let root = ran.root();
    (folder_below(&dir.join("runs")), root)
}

/// Names, bytes and times of all files of a folder.
fn state(dir: &Path) -> Vec<(PathBuf, Vec<u8>, std::time::SystemTime)> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            all.extend(state(&entry))
        } else {
            let changed = entry.metadata().unwrap().modified().unwrap();
            all.push((entry.clone(), std::fs::read(&entry).unwrap(), changed));
        }
    }
    all.sort();
    all
}

fn read_only(dir: &Path) -> Result<(), String> {
    let (run, root) = recorded(dir);
    let before = state(&run);
    let script = "mount --bind runs runs && mount -o remount,bind,ro runs || exit 9\nexec \"$@\"";
    let run_text = run.display().to_string();
    for (args, words) in [
        (&["check", &run_text][..], root.as_str()),
        (&["verify", &run_text], root.as_str()),
        (&["data", &run_text, "--out", "tables"], "attempts"),
        (
            &["bundle", "create", &run_text, "--out", "mine.evodrive", "--date", "2026-11-22", "--license", "MIT"],
            root.as_str(),
        ),
        (&["fsck", &run_text, "--read"], "no damage found"),
        (&["lineage", &run_text], "cat"),
        (&["table", "metadrive-main", "--run", &run_text], "CAT"),
        (&["scenes", "best", "--run", &run_text], ""),
    ] {
        let mut command = Command::new("unshare");
        command.args(["--map-root-user", "--mount", "sh", "-c", script, "sh", env!("CARGO_BIN_EXE_evodrive")]);
        let ran = Ran::of(command.args(args).current_dir(dir));
        if ran.stderr.contains("mount:") || ran.stderr.contains("unshare:") {
            skip(&format!("no folder that cannot be written to: {}", ran.stderr.trim()));
            return Ok(());
        }
        refused(&ran, 0, &[words]).map_err(|seen| format!("{args:?}: {seen}"))?;
    }
    if state(&run) == before { Ok(()) } else { Err("the folder is another one than before".into()) }
}

fn odd_lock(dir: &Path) -> Result<(), String> {
    let (run, root) = recorded(dir);
    let lock = run.join("store/lock");
    let pack = std::fs::read(run.join("store/objects.pack")).unwrap();
    let run_text = run.display().to_string();
    let lays: [fn(&Path); 3] = [
        |lock| std::fs::create_dir(lock).unwrap(),
        |lock| std::os::unix::fs::symlink("/dev/zero", lock).unwrap(),
        |lock| assert!(Command::new("mkfifo").arg(lock).status().unwrap().success()),
    ];
    for lay in lays {
        cleared(&lock);
        lay(&lock);
        for command in ["check", "run", "fsck", "resume"] {
            let named = if command == "run" { dir.join("mine.toml").display().to_string() } else { run_text.clone() };
            let ran = here(dir, &[command, &named]);
            refused(&ran, 2, &["store/lock", "the lock is made again"]).map_err(|seen| format!("{command}: {seen}"))?;
        }
    }
    cleared(&lock);
    if std::fs::read(run.join("store/objects.pack")).unwrap() != pack {
        return Err("the pack is another one than before".into());
    }
    refused(&here(dir, &["check", &run_text]), 0, &[&root])
}

fn cleared(lock: &Path) {
    if lock.is_dir() && !lock.is_symlink() {
        std::fs::remove_dir(lock).unwrap();
    } else {
        std::fs::remove_file(lock).unwrap();
    }
}

fn emptied_cost(dir: &Path) -> Result<(), String> {
    let (run, root) = recorded(dir);
    let run_text = run.display().to_string();
    for cost in [&b""[..], b"{}", b"\xff\xfe", b"{\"format\": 1"] {
        for args in
            [&["report", &run_text][..], &["resume", &run_text], &["data", &run_text, "--out", "tables", "--overwrite"]]
        {
            std::fs::write(run.join("cost.json"), cost).unwrap();
            let ran = here(dir, args);
            let told = ran.stderr.matches("cost.json: expected what a run cost").count();
            if ran.code != 0 || told != 1 || args[0] == "resume" && ran.root() != root {
                return Err(format!("{args:?}: told {told} times: {}", ran.stderr));
            }
        }
    }
    Ok(())
}

/// A limit of a file's size ends no command: what is beyond it is refused with the file's name, and what was written before stays.
#[test]
fn a_limit_of_a_files_size_is_a_matter_of_the_place_and_loses_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let path = experiment(dir.path(), "mine", "");
    let limited = |kilobytes: u32, args: &[&str]| {
        let script = format!("ulimit -f {}; exec \"$@\"", kilobytes * 2);
        Ran::of(
            Command::new("sh")
                .args(["-c", &script, "sh", env!("CARGO_BIN_EXE_evodrive")])
                .args(args)
                .current_dir(dir.path()),
        )
    };
    for kilobytes in [0, 1, 16, 64] {
        let ran = limited(kilobytes, &["record", path.to_str().unwrap(), "--no-report"]);
        assert_eq!(ran.code, 2, "{kilobytes}: {}", ran.stderr);
        assert!(
            ran.stderr.contains("error: cannot ") && ran.stderr.contains("ulimit -f"),
            "{kilobytes}: {}",
            ran.stderr
        );
    }
    let whole = Ran::of(evodrive().current_dir(dir.path()).args(["record", "--no-report"]).arg(&path));
    let other = tempfile::tempdir().unwrap();
    let plain = experiment(other.path(), "mine", "");
    assert_eq!(
        whole.root(),
        Ran::of(evodrive().current_dir(other.path()).args(["record", "--no-report"]).arg(plain)).root()
    );
}

/// The answer of a `--json` command is JSON with the same texts, and nothing in it acts on a terminal.
#[test]
fn json_says_the_same_with_escapes_that_a_reader_undoes() {
    let dir = tempfile::tempdir().unwrap();
    let ran = here(dir.path(), &["run", "--json", "a\u{202e}b.toml"]);
    assert!(!ran.stdout.contains('\u{202e}') && !ran.stderr.contains('\u{202e}'), "{}", ran.stdout);
    let object: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert!(object["error"].as_str().unwrap().contains("a\u{202e}b.toml"), "{object}");
}
