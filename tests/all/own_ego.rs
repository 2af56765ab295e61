//! A planner of one's own: the examples in Python drive, are recorded, and replay without Python.

use std::path::Path;
use std::process::Command;

use crate::backends::experiment;
use crate::harness::{Ran, evodrive, home, skip};

/// Returns `true` if Python is here; its absence is told at the end of `cargo test`.
pub fn python() -> bool {
    let there = Command::new("python3").arg("--version").output().is_ok_and(|ran| ran.status.success());
    if !there {
        skip("no python3: the examples of docs/EGOS.md were not driven");
    }
    there
}

pub fn copied(folder: &Path, names: &[&str]) {
    for name in names {
        std::fs::copy(home().join("examples/own_ego").join(name), folder.join(name)).unwrap();
    }
}

pub fn driver(planner: &str) -> String {
    format!(
        "[[lineage]]\nid = \"cat-mine\"\nfamily = \"cat\"\nego = \"command\"\n\
         [driver]\ncommand = [\"python3\", \"{planner}\"]\nfiles = [\"{planner}\", \"evodrive_driver.py\"]\n\
         cassette = \"mine.jsonl.zst\"\nprocesses = 2\nrepeat_share = 0.5\n"
    )
}

fn call(command: &str, path: &Path, out: &Path) -> Ran {
    Ran::of(evodrive().args([command, path.to_str().unwrap(), "--no-report", "--out", out.to_str().unwrap()]))
}

#[test]
fn a_planner_is_recorded_and_its_run_replays_without_it() {
    if !python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    copied(folder.path(), &["evodrive_driver.py", "idm.py"]);
    let path = experiment(folder.path(), "mine", &driver("idm.py"));
    let recorded = call("record", &path, &folder.path().join("a"));
    let root = recorded.root();
    let said = |what: &str| recorded.stderr.lines().find(|line| line.contains(what)).unwrap_or_default().to_string();
    assert!(said("rollouts in").ends_with("; 0 of them failed"), "{}", recorded.stderr);
    let digest = said("digest = ").rsplit("digest = ").next().unwrap().to_string();
    // Texts call the planner by its name and the method by its family's, whatever the lineage's id.
    assert!(recorded.stdout.contains("\nreplay, idm.py  -"), "{}", recorded.stdout);
    let of = crate::harness::folder_below(&folder.path().join("a")).display().to_string();
    for table in ["metadrive-main", "metadrive-policy", "metadrive-contacts"] {
        let printed = crate::harness::run(&["table", table, "--run", &of]).stdout;
        assert!(printed.contains("\n| CAT | idm.py | ") && !printed.contains("| command |"), "{printed}");
    }
    let proposals = crate::harness::run(&["table", "proposals", "--run", &of]).stdout;
    assert!(proposals.contains("| idm.py | "), "{proposals}");
    // The page says who drives, and how often it crashes into anybody beside how often it is attacked.
    assert_eq!(crate::harness::run(&["report", &of]).code, 0);
    let page = std::fs::read_to_string(Path::new(&of).join("report.html")).unwrap();
    let (above, _) = page.split_once("<script id=\"data\"").unwrap();
    assert!(above.contains("driver under test (idm.py)") && above.contains(" % of the scenes (any crash "), "{above}");
    assert!(
        crate::harness::report_data(&page)[0]["lineages"].as_array().unwrap().iter().all(|of| of["ego"] == "idm.py")
    );
    // A program that was evolved against a planner leaves its run too: who plays it names the ego.
    let here = |args: &[&str]| Ran::of(evodrive().current_dir(folder.path()).args(args));
    let run = crate::harness::folder_below(&folder.path().join("a")).display().to_string();
    assert_eq!(here(&["program", "export", &run, "cat-mine/parent", "--out", "planned.json"]).code, 0);
    here(&["scenes", "generate", "mine.toml", "--out", "mine.pool"]);
    let apply = |more: &[&str]| here(&[&["apply", "planned.json", "--scenes", "mine.pool"], more].concat());
    for more in [["--driver", "idm.py"], ["--ego", "idm"]] {
        let applied = apply(&more);
        assert_eq!(applied.code, 0, "{}", applied.stderr);
    }
    let unnamed = apply(&[]);
    assert!(unnamed.code == 2 && unnamed.stderr.contains("--driver planner.py"), "{}", unnamed.stderr);
    // A changed file is another ego, whose rollouts nobody recorded.
    let idm = std::fs::read_to_string(folder.path().join("idm.py")).unwrap();
    std::fs::write(folder.path().join("idm.py"), idm.replace("1.5, 2.0", "1.4, 2.0")).unwrap();
    let changed = call("run", &path, &folder.path().join("b"));
    assert!(changed.code == 2 && changed.stderr.contains("digest is"), "{}", changed.stderr);
    // Without its files a planner is known by the digest alone.
    std::fs::remove_file(folder.path().join("idm.py")).unwrap();
    let missing = call("run", &path, &folder.path().join("c"));
    assert!(missing.code == 2 && missing.stderr.contains("driver.files is \"idm.py\""), "{}", missing.stderr);
    assert!(missing.stderr.contains(&format!("write into [driver]: digest = {digest}")), "{}", missing.stderr);
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("[driver]\n", &format!("[driver]\ndigest = {digest}\n"))).unwrap();
    assert_eq!(call("run", &path, &folder.path().join("d")).root(), root);
}

#[test]
fn an_interrupted_recording_finds_its_planner_again_and_a_finished_one_names_no_folder() {
    if !python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    copied(folder.path(), &["evodrive_driver.py", "idm.py"]);
    let idm = std::fs::read_to_string(folder.path().join("idm.py")).unwrap();
    let head = "import os, sys\nif os.path.exists('begun') and not os.path.exists('ready'):\n    sys.exit('not yet')\n";
    let decide = "    def decide(self, scene, step):\n";
    // The third rollout of a process is its last: what came before is recorded, and stays.
    let ends = "        Idm.begun = getattr(Idm, 'begun', 0) + (step['step'] == 0)\n        if Idm.begun == 3 and not os.path.exists('ready'):\n            open('begun', 'w').close()\n            sys.exit('no more')\n";
    assert!(idm.contains(decide));
    std::fs::write(folder.path().join("idm.py"), format!("{head}{}", idm.replace(decide, &format!("{decide}{ends}"))))
        .unwrap();
    let path = experiment(folder.path(), "mine", &driver("idm.py"));
    let out = folder.path().join("a");
    let stopped = call("record", &path, &out);
    assert!(stopped.code != 0 && stopped.stderr.contains("not yet"), "{}", stopped.stderr);
    std::fs::write(folder.path().join("ready"), "").unwrap();
    let run = std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path()).find(|path| path.is_dir()).unwrap();
    Ran::of(evodrive().args(["resume", run.to_str().unwrap()])).root();
    let files = std::fs::read_dir(&run).unwrap().map(|entry| entry.unwrap().path());
    let files: Vec<_> = files.filter(|path| path.is_file()).collect();
    assert!(files.iter().any(|path| path.ends_with("run.json")), "{files:?}");
    for kept in files {
        let text = String::from_utf8_lossy(&std::fs::read(&kept).unwrap()).into_owned();
        assert!(!text.contains(folder.path().to_str().unwrap()), "{} names a folder of this machine", kept.display());
    }
    // The copy in a run folder starts nobody.
    std::fs::remove_file(folder.path().join("mine.jsonl.zst")).unwrap();
    let copy = run.join("experiment.toml");
    let again = call("record", &copy, &folder.path().join("b"));
    assert!(again.code == 2 && again.stderr.contains("starts no planner"), "{}", again.stderr);
}

/// The planner itself is named as for `init`; it is the planner that a file with a table `[driver]` names.
#[test]
fn egos_and_apply_take_the_planner_itself_and_a_table_that_names_it_for_the_same_ego() {
    if !python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path();
    copied(home, &["evodrive_driver.py", "idm.py"]);
    std::fs::create_dir(home.join("below")).unwrap();
    std::fs::rename(home.join("idm.py"), home.join("below/idm.py")).unwrap();
    std::fs::rename(home.join("evodrive_driver.py"), home.join("below/evodrive_driver.py")).unwrap();
    let table = "[driver]\ncommand = [\"python3\", \"below/idm.py\"]\n\
                 files = [\"below/idm.py\", \"below/evodrive_driver.py\"]\ncassette = \"x.jsonl\"\n";
    std::fs::write(home.join("table.toml"), table).unwrap();
    let here = |args: &[&str]| Ran::of(evodrive().current_dir(home).args(args));
    let path = experiment(home, "mine", "");
    let egos = here(&["egos", path.to_str().unwrap(), "--driver", "below/idm.py", "--driver", "table.toml", "--json"]);
    assert_eq!(egos.code, 0, "{}", egos.stderr);
    let object: serde_json::Value = serde_json::from_str(&egos.stdout).unwrap();
    let figures = |at: usize| object["egos"][at]["figures"].clone();
    assert_eq!(figures(4), figures(5), "{object}");
    assert_ne!(figures(4), figures(0), "it drives otherwise than replay: {object}");
    here(&["record", path.to_str().unwrap(), "--no-report"]).root();
    let run = crate::harness::folder_below(&home.join("runs")).display().to_string();
    assert_eq!(here(&["program", "export", &run, "cat-idm/parent", "--out", "program.json"]).code, 0);
    here(&["scenes", "generate", path.to_str().unwrap(), "--out", "mine.pool"]);
    let applied =
        |driver: &str| here(&["apply", "program.json", "--scenes", "mine.pool", "--driver", driver, "--json"]);
    let (itself, named) = (applied("below/idm.py"), applied("table.toml"));
    assert!(itself.code == 0 && itself.stdout == named.stdout, "{} {}", itself.stderr, named.stderr);
    let missing = applied("idm.py");
    assert!(missing.code == 2 && missing.stderr.contains("--driver idm.py: no such file"), "{}", missing.stderr);
}

#[test]
fn examples_drive_the_held_out_scenes_and_a_planner_that_crashes_says_where() {
    if !python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    copied(folder.path(), &["evodrive_driver.py", "gym_policy.py", "gym_policy.toml", "idm.py"]);
    let path = experiment(folder.path(), "mine", &driver("idm.py"));
    let policy = folder.path().join("gym_policy.toml");
    let ran =
        Ran::of(evodrive().args(["egos", path.to_str().unwrap(), "--driver", policy.to_str().unwrap(), "--json"]));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let object: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    let egos = object["egos"].as_array().unwrap();
    assert_eq!(egos.len(), 6, "replay, idm, pdm, frenet, the experiment's and the named one: {object}");
    for ego in &egos[4..] {
        let driven = ego["figures"]["route_completion"].as_f64().unwrap();
        assert!(driven > 0.3 && ego["figures"]["off_road_rate"] == 0.0, "{ego}");
    }
    let crashes = "import sys\nprint('{\"evodrive_driver\":1}', flush=True)\nsys.stdin.readline()\nsys.stdin.readline()\nraise ValueError('no weights')\n";
    std::fs::write(folder.path().join("idm.py"), crashes).unwrap();
    let ran = Ran::of(evodrive().args(["egos", path.to_str().unwrap()]));
    assert_eq!(ran.code, 2, "{}", ran.stdout);
    for part in [
        "planner `python3 idm.py`, decision 0 (0.0 s): the process ended",
        "ValueError: no weights",
        "the ego drove no scene",
    ] {
        assert!(ran.stderr.contains(part), "{part}: {}", ran.stderr);
    }
    let times = |part: &str| ran.stderr.matches(part).count();
    let like = [times("ValueError: no weights"), times("\nnot driven: "), times(" more like it\n")];
    assert_eq!(like, [1, 1, 1], "{}", ran.stderr);
    let no_number = "from evodrive_driver import serve\nclass Lost:\n    def decide(self, scene, step):\n        return float('nan'), 0.0\nserve(Lost())\n";
    std::fs::write(folder.path().join("idm.py"), no_number).unwrap();
    let ran = Ran::of(evodrive().args(["egos", path.to_str().unwrap()]));
    let said = "decide answered (nan, 0.0) at 0.0 s; expected (acceleration_mps2, steering_rad)";
    assert!(ran.code == 2 && ran.stderr.contains(said), "{}", ran.stderr);
}

/// The order of a set of texts, and so whatever is chosen by it, is the same within one Python process, and another one in the next.
#[test]
fn a_planner_that_hangs_on_pythons_hash_of_texts_is_refused_before_anything_rests_on_it() {
    if !python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    copied(folder.path(), &["evodrive_driver.py"]);
    let planner = |gain: &str| {
        let text = format!(
            "import hashlib\nfrom evodrive_driver import serve\nclass Mine:\n    def decide(self, scene, step):\n        \
             return 0.001 * ({gain} % 1000), 0.0\nserve(Mine())\n"
        );
        std::fs::write(folder.path().join("mine.py"), text).unwrap();
    };
    planner("hash('lane follow')");
    // So small a share draws none of the few rollouts.
    let table = driver("mine.py").replace("repeat_share = 0.5", "repeat_share = 0.000001");
    let path = experiment(folder.path(), "mine", &table);
    let egos = || Ran::of(evodrive().args(["egos", path.to_str().unwrap()]));
    let out = folder.path().join("out");
    for refused in [egos(), call("record", &path, &out)] {
        let said = &refused.stderr;
        assert!(refused.code != 0 && said.contains("played again in another process"), "{} {said}", refused.code);
        assert!(said.contains("PYTHONHASHSEED was 1 and 2") && said.contains("after 1 decisions"), "{said}");
    }
    // The run folder is that of the planner as it was: there is nothing to go on with.
    let refused = call("record", &path, &out).stderr;
    let next = format!("\n  repair the planner, then `{} record {} ", env!("CARGO_BIN_EXE_evodrive"), path.display());
    assert!(refused.contains(&next) && !refused.contains(" resume "), "{next}: {refused}");
    planner("int(hashlib.sha256(b'lane follow').hexdigest()[:8], 16)");
    let driven = egos();
    assert_eq!(driven.code, 0, "{}", driven.stderr);
    let few = "in another process, all equal; driver.repeat_share = 1 plays every one again";
    for ran in [driven, call("record", &path, &out)] {
        let said = ran.stderr.lines().find(|line| line.ends_with(few)).unwrap_or_else(|| panic!("{}", ran.stderr));
        let counts: Vec<usize> = said.split(' ').filter_map(|word| word.parse().ok()).collect();
        assert!(counts[0] >= 1 && counts[0] < counts[1], "{said}");
    }
    // Who fixes the salt says so in the experiment, where it is part of the planner's identity.
    planner("hash('lane follow')");
    let fixed = table.replace("[\"python3\", ", "[\"env\", \"PYTHONHASHSEED=0\", \"python3\", ");
    assert_ne!(fixed, table);
    std::fs::write(&path, std::fs::read_to_string(&path).unwrap().replace(&table, &fixed)).unwrap();
    let driven = egos();
    assert_eq!(driven.code, 0, "{}", driven.stderr);
}

/// An experiment named without a folder, from its own; another seed's recording keeps the first one's rollouts; a replay that fails leaves a
/// finished run as it was; and a folder with another run's rollouts is not called whole.
#[test]
fn one_cassette_holds_the_rollouts_of_several_recordings_and_no_failed_replay_moves_a_finished_run() {
    if !python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path();
    copied(home, &["evodrive_driver.py", "idm.py"]);
    experiment(home, "mine", &driver("idm.py").replace("mine.jsonl.zst", "motion.jsonl"));
    let here = |args: &[&str]| Ran::of(evodrive().current_dir(home).args(args));
    let root = here(&["record", "mine.toml", "--no-report", "--out", "a"]).root();
    let other =
        here(&["record", "mine.toml", "--no-report", "--out", "b", "--set", "scenes.seed=8", "--cassette", "o.jsonl"]);
    let other_root = other.root();
    assert!(other.stderr.contains(" of other recordings"), "{}", other.stderr);
    assert_ne!(root, other_root);
    // Both replay from the one cassette, and from their folders.
    assert_eq!(here(&["run", "./mine.toml", "--no-report", "--out", "c"]).root(), root);
    let again = ["run", "mine.toml", "--no-report", "--out", "d", "--set", "scenes.seed=8", "--cassette", "o.jsonl"];
    assert_eq!(here(&again).root(), other_root);
    let below = |out: &str| crate::harness::folder_below(&home.join(out));
    let (first, second) = (below("a"), below("b"));
    let kept = std::fs::read(first.join("rollouts.jsonl")).unwrap();
    // With the second one's rollouts alone the first experiment has none, and its finished run keeps its own.
    std::fs::write(home.join("motion.jsonl"), std::fs::read(second.join("rollouts.jsonl")).unwrap()).unwrap();
    let failed = here(&["run", "mine.toml", "--no-report", "--out", "a"]);
    assert!(failed.code != 0 && failed.stderr.contains("no recorded rollout"), "{}", failed.stderr);
    assert_eq!(std::fs::read(first.join("rollouts.jsonl")).unwrap(), kept);
    let (checked, verified) = (here(&["check", first.to_str().unwrap()]), here(&["verify", first.to_str().unwrap()]));
    assert_eq!((checked.code, verified.code), (0, 0), "{} {}", checked.stderr, verified.stderr);
    assert!(verified.stderr.contains("without asking it"), "{}", verified.stderr);
    for ran in [&checked, &verified] {
        assert!(ran.stderr.contains("recorded events and the result are as recorded"), "{}", ran.stderr);
    }
    let whole = here(&["fsck", "--read", first.to_str().unwrap()]);
    assert_eq!(whole.code, 0, "{} {}", whole.stdout, whole.stderr);
    std::fs::copy(second.join("rollouts.jsonl"), first.join("rollouts.jsonl")).unwrap();
    let damaged = here(&["fsck", "--read", first.to_str().unwrap()]);
    let said = format!("{} {}", damaged.stdout, damaged.stderr);
    assert!(damaged.code == 5 && said.contains("a recorded rollout of every scene"), "{said}");
}

/// A driver that ends where somebody is near has fewer labels, and is not to look safer for it.
#[test]
fn scenes_in_which_the_planner_ends_are_counted_where_the_result_is_told() {
    if !python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    copied(folder.path(), &["evodrive_driver.py", "idm.py"]);
    let idm = std::fs::read_to_string(folder.path().join("idm.py")).unwrap();
    let decide = "    def decide(self, scene, step):\n";
    let ends = "        if SCENE_ENDS(scene):\n            raise ValueError('sensor lost')\n";
    let which = "def SCENE_ENDS(scene):\n    return scene['scene'].endswith(('1', '3', '5', '7', '9'))\n\n\nclass ";
    let text = idm.replace(decide, &format!("{decide}{ends}")).replacen("class ", which, 1);
    std::fs::write(folder.path().join("idm.py"), text).unwrap();
    let path = experiment(folder.path(), "mine", &driver("idm.py"));
    let table = std::fs::read_to_string(&path).unwrap().replace("held_out = 3", "held_out = 6");
    std::fs::write(&path, table).unwrap();
    let recorded = Ran::of(evodrive().args([
        "record",
        path.to_str().unwrap(),
        "--out",
        folder.path().join("a").to_str().unwrap(),
    ]));
    assert_eq!(recorded.code, 0, "{}", recorded.stderr);
    let line = recorded.stdout.lines().find(|line| line.contains("held-out scenes the parent is labelled in"));
    let line = line.unwrap_or_else(|| panic!("{}", recorded.stdout));
    assert!(line.contains("of 6 held-out scenes") && line.contains("the process ended"), "{line}");
    // What the planner printed before it ended may hold anything and stands in no record.
    assert!(!line.contains("sensor lost"), "{line}");
    let page = crate::harness::folder_below(&folder.path().join("a")).join("report.html");
    let report = crate::harness::report_data(&std::fs::read_to_string(page).unwrap());
    assert_eq!(report[0]["unlabelled"][0], line);
    // So are those of the choice among finalists, which no held-out number shows.
    let choice = report[0]["unlabelled"][1].as_str().unwrap();
    assert!(choice.contains("evolution scenes a program that was compared for the choice has no label"), "{choice}");
    assert!(recorded.stdout.contains(choice), "{}", recorded.stdout);
    let (run, tables) = (crate::harness::folder_below(&folder.path().join("a")), folder.path().join("tables"));
    let laid_out = Ran::of(evodrive().args(["data", run.to_str().unwrap(), "--out", tables.to_str().unwrap()]));
    assert_eq!(laid_out.code, 0, "{}", laid_out.stderr);
    let listed = std::fs::read_to_string(tables.join("unlabelled.csv")).unwrap();
    let parents = listed.lines().filter(|line| line.starts_with("cat-mine,cat-mine/parent,held_out,")).count();
    let all: usize = line.split(" is labelled in ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(parents == 6 - all && listed.contains("the process ended"), "{listed}\n{line}");
}

#[test]
fn a_table_that_fits_no_lineage_is_refused_with_its_key() {
    let folder = tempfile::tempdir().unwrap();
    copied(folder.path(), &["evodrive_driver.py", "idm.py"]);
    let good = driver("idm.py");
    let cases = [
        (good.replace("ego = \"command\"", "ego = \"idm\""), "driver is given, expected nothing: no lineage has ego"),
        (good[..good.find("[driver]").unwrap()].to_string(), "lineage[0].ego is \"command\""),
        (good.replace("processes = 2", "processes = 0"), "driver.processes is 0"),
        (good.replace("processes", "proceses"), "did you mean `processes`"),
        (good.replace("idm.py\", \"evo", "gone.py\", \"evo"), "driver.files is \"gone.py\""),
        (good.replace("files =", "#"), "driver.files is missing"),
        (format!("{good}digest = \"{}\"\n", "0".repeat(64)), "which the files and arguments have"),
        (
            format!(
                "{good}[simulator.backend]\nname = \"x\"\nversion = \"1\"\ndigest = \"{}\"\ncassette = \"x\"\nworker = {{ command = [\"x\"], workers = 1, seconds = 1, retries = 0 }}\n",
                "0".repeat(64)
            ),
            "nothing: with [driver] the built-in simulator is used",
        ),
    ];
    for (table, expected) in cases {
        let path = experiment(folder.path(), "bad", &table);
        let ran = call("run", &path, &folder.path().join("out"));
        assert!(ran.code == 2 && ran.stderr.contains(expected), "{expected}: {}", ran.stderr);
    }
}
