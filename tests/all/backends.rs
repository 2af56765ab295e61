//! Another simulator behind the binary: recorded by worker processes, replayed without them, and refused where they err.

use std::path::{Path, PathBuf};

use crate::harness::{Ran, evodrive, folder_below, home};

/// Writes an experiment of one small epoch with this table for `simulator.backend`, below a folder.
pub fn experiment(folder: &Path, name: &str, backend: &str) -> PathBuf {
    let base = home().join("experiments/quickstart.toml");
    let text = format!(
        "base = {base:?}\nname = \"{name}\"\ncassette = \"{name}.jsonl\"\n\
         [split]\nevolution = {{ count = 6 }}\nheld_out = 3\nwindow = 3\n\
         [budget]\nepochs = 1\nslots = 1\nmax_repair_rounds = 0\nprobe_scenes = 1\nfinalists = 1\n\
         [scenes]\nsource = \"synth\"\ncount = 12\nseed = 7\n{backend}\n"
    );
    let path = folder.join(format!("{name}.toml"));
    std::fs::write(&path, text).unwrap();
    path
}

/// The table of a worker, with what our own one says of itself.
pub fn worker(command: &[&str]) -> String {
    let said = Ran::of(evodrive().arg("worker").stdin(std::process::Stdio::null()));
    let hello: serde_json::Value = serde_json::from_str(said.stdout.lines().next().unwrap()).unwrap();
    format!(
        "[simulator.backend]\nname = {}\nversion = {}\ndigest = {}\noptions = {{ plant = \"physical\" }}\n\
         cassette = \"rollouts.jsonl.zst\"\n\
         [simulator.backend.worker]\ncommand = {command:?}\nworkers = 2\nseconds = 20\nretries = 0\n",
        hello["backend"], hello["version"], hello["digest"]
    )
}

fn call(command: &str, path: &Path, out: &Path) -> Ran {
    Ran::of(evodrive().args([command, path.to_str().unwrap(), "--no-report", "--out", out.to_str().unwrap()]))
}

/// The labels of a run, without the keys and digests that name them.
fn labels(out: &Path) -> String {
    let text = std::fs::read_to_string(folder_below(out).join("result.json")).unwrap();
    let result: serde_json::Value = serde_json::from_str(&text).unwrap();
    let of = |lineage: &serde_json::Value| {
        let parts = ["parent", "evolved", "front", "hypervolume_by_epoch"].map(|part| lineage[part].to_string());
        parts.join(" ")
    };
    let lineages: Vec<String> = result["result"]["lineages"].as_array().unwrap().iter().map(of).collect();
    format!("{} {} {lineages:?}", result["result"]["replay"], result["result"]["exits"])
}

#[test]
fn a_run_behind_our_own_worker_has_our_own_labels_and_replays_without_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let plain = experiment(folder.path(), "plain", "");
    assert_eq!(call("record", &plain, &path("a")).code, 0);
    let named = experiment(folder.path(), "named", "[simulator]\nbackend = \"evodrive\"\n");
    assert_eq!(call("record", &named, &path("n")).code, 0);
    let own = experiment(folder.path(), "own", &worker(&[env!("CARGO_BIN_EXE_evodrive"), "worker"]));
    let recorded = call("record", &own, &path("b"));
    let root = recorded.root();
    assert!(recorded.stderr.contains("rollouts in"), "{}", recorded.stderr);
    assert_eq!(labels(&path("a")), labels(&path("b")));
    // Nobody to start: the cassette answers.
    let gone = std::fs::read_to_string(&own).unwrap().replace(env!("CARGO_BIN_EXE_evodrive"), "/nowhere/at/all");
    std::fs::write(&own, gone).unwrap();
    assert_eq!(call("run", &own, &path("c")).root(), root);
    // An emptied cassette misses, and says what would fill it.
    let cassette = path("rollouts.jsonl.zst");
    let text = zstd::stream::decode_all(&std::fs::read(&cassette).unwrap()[..]).unwrap();
    let header = text.split(|byte| *byte == b'\n').next().unwrap();
    std::fs::write(path("rollouts.jsonl.zst"), zstd::bulk::compress(header, 3).unwrap()).unwrap();
    let missed = call("run", &own, &path("d"));
    assert_eq!(missed.code, 3, "{}", missed.stderr);
    assert!(
        missed.stderr.contains("no recorded rollout") && missed.stderr.contains("evodrive record"),
        "{}",
        missed.stderr
    );
    let agreed = |first: &str, second: &str| {
        Ran::of(evodrive().arg("agree").args([first, second].map(|out| folder_below(&path(out)))))
    };
    let same = agreed("a", "c");
    assert_eq!(same.code, 0, "{}", same.stderr);
    assert!(
        same.stdout.contains("Disagreements: 0") && same.stdout.contains("| 100.0 [100.0, 100.0]"),
        "{}",
        same.stdout
    );
}

#[test]
fn processes_that_err_end_a_recording_with_nothing_recorded() {
    let cases: [(&[&str], &str); 5] = [
        (&["/nowhere/at/all"], "its start: expected a process"),
        (&["sh", "-c", "echo hello"], "its greeting: expected one JSON object"),
        (&["sh", "-c", "printf '{\"evodrive'"], "found 10 bytes and the end of the process"),
        (&["sh", "-c", "exit 3"], "its greeting: expected a line, found the end of the process"),
        (&["sh", "-c", "head -c 17000000 /dev/zero"], "a line of at most 16777216 bytes"),
    ];
    for (command, expected) in cases {
        let folder = tempfile::tempdir().unwrap();
        let path = experiment(folder.path(), "bad", &worker(command));
        let ran = call("record", &path, &folder.path().join("out"));
        assert_eq!(ran.code, 2, "{command:?}: {}", ran.stderr);
        assert!(ran.stderr.contains(expected), "{command:?}: {}", ran.stderr);
        assert!(!folder.path().join("rollouts.jsonl.zst").exists());
    }
}

#[test]
fn a_process_that_hangs_is_ended_and_refused() {
    let folder = tempfile::tempdir().unwrap();
    let table = worker(&["sh", "-c", "exec sleep 600"]).replace("seconds = 20", "seconds = 0.2");
    let path = experiment(folder.path(), "slow", &table);
    let ran = call("record", &path, &folder.path().join("out"));
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("expected a line within 0.2 s, found nothing"), "{}", ran.stderr);
}

#[test]
fn a_table_that_names_no_backend_is_refused_with_its_field() {
    let folder = tempfile::tempdir().unwrap();
    let good = worker(&["own"]);
    let cases = [
        (good.replace("workers = 2", "workers = 0"), "simulator.backend.worker.workers"),
        (good.replace("seconds = 20", "seconds = -1"), "simulator.backend.worker.seconds"),
        (good.replace("command = [\"own\"]", "command = []"), "simulator.backend.worker.command"),
        (good.replace("name = ", "nmae = "), "nmae"),
        (good.replace("digest = \"", "digest = \"zz"), "64 hex digits"),
        ("[simulator]\nbackend = \"carla\"\n".to_string(), "expected \"evodrive\" or a table"),
    ];
    for (table, expected) in cases {
        let path = experiment(folder.path(), "bad", &table);
        let ran = call("run", &path, &folder.path().join("out"));
        assert_eq!(ran.code, 2, "{table}: {}", ran.stderr);
        assert!(ran.stderr.contains(expected), "{}: {table}", ran.stderr);
    }
}

#[test]
fn agree_init_writes_a_study_that_both_simulators_can_record_and_agree_compares() {
    let folder = tempfile::tempdir().unwrap();
    let here = |args: &[&str]| Ran::of(evodrive().current_dir(folder.path()).args(args));
    experiment(folder.path(), "scenes", "");
    let made = here(&["scenes", "generate", "scenes.toml", "--out", "my.pool"]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let init = ["agree", "init", "mine", "--scenes", "my.pool", "--family", "cat"];
    let written = here(&init);
    assert_eq!(written.code, 0, "{}", written.stderr);
    assert!(written.stdout.contains("evodrive record mine/metadrive.toml"), "{}", written.stdout);
    // The shipped study's MetaDrive, plant, options and worker.
    let other = std::fs::read_to_string(folder.path().join("mine/metadrive.toml")).unwrap();
    let shipped = std::fs::read_to_string(home().join("experiments/agreement/metadrive.toml")).unwrap();
    for key in ["version = ", "digest = ", "options = ", "plan_around = ", "command = ", "rollouts = "] {
        let line = |text: &str| text.lines().find(|line| line.starts_with(key)).map(String::from);
        assert!(line(&other).is_some() && line(&other) == line(&shipped), "{key}: {other}");
    }
    // Our own worker in MetaDrive's place, as far as one goes without Python.
    let own = worker(&[env!("CARGO_BIN_EXE_evodrive"), "worker"]).replace("\"physical\"", "\"metadrive-0.4.3\"");
    let own = own.replace("[simulator.backend.worker]", "plan_around = \"evodrive\"\n[simulator.backend.worker]");
    let head = other.split("[simulator.backend]").next().unwrap();
    std::fs::write(folder.path().join("mine/metadrive.toml"), format!("{head}{own}")).unwrap();
    for file in ["mine/evodrive.toml", "mine/metadrive.toml"] {
        let recorded = here(&["record", file, "--no-report"]);
        assert_eq!(recorded.code, 0, "{file}: {}", recorded.stderr);
    }
    let agreed = here(&["agree", "mine-evodrive", "mine-metadrive"]);
    assert_eq!(agreed.code, 0, "{}", agreed.stderr);
    assert!(agreed.stdout.contains("Disagreements: 0"), "{}", agreed.stdout);
    assert!(agreed.stdout.contains("cat-replay"), "the recorded ego is compared, too: {}", agreed.stdout);
    // CommonRoad's scenes have no recorded ego: nobody repeats it there.
    let commonroad = home().join("tests/fixtures/commonroad");
    let written = here(&["agree", "init", "without", "--scenes", commonroad.to_str().unwrap()]);
    assert_eq!(written.code, 0, "{}", written.stderr);
    let study = std::fs::read_to_string(folder.path().join("without/study.toml")).unwrap();
    assert!(study.contains("family = \"strive\"") && !study.contains("replay"), "{study}");
    for (args, expected) in [
        (&init[..], "mine exists already; name another study"),
        (&["agree", "init", "two", "--scenes", "my.pool", "--family", "cta"][..], "did you mean `cat`"),
        (&["agree", "init", "two", "--scenes", "none.pool"][..], "none.pool"),
    ] {
        let refused = here(args);
        assert_eq!(refused.code, 2, "{args:?}: {}", refused.stderr);
        assert!(refused.stderr.contains(expected), "{}", refused.stderr);
    }
}

#[test]
fn our_own_simulator_predicts_labels_of_another_one_and_of_no_planner_or_itself() {
    let folder = tempfile::tempdir().unwrap();
    let sets = ["--set", "world.model=simulator", "--set", "budget.epochs=2", "--set", "budget.slots=6"];
    let call = |command: &str, path: &Path, out: &str| {
        let out = folder.path().join(out);
        let ran = Ran::of(
            evodrive()
                .args([command, path.to_str().unwrap(), "--no-report", "--out", out.to_str().unwrap()])
                .args(sets),
        );
        (ran, out)
    };
    let (refused, _) = call("record", &experiment(folder.path(), "plain", ""), "p");
    assert_eq!(refused.code, 2, "{}", refused.stderr);
    let says = "\"simulator\" needs [simulator.backend]";
    assert!(refused.stderr.contains("world.model") && refused.stderr.contains(says), "{}", refused.stderr);

    // A worker that is our own simulator: what it says is known before it is asked.
    let own = experiment(folder.path(), "own", &worker(&[env!("CARGO_BIN_EXE_evodrive"), "worker"]));
    let (recorded, out) = call("record", &own, "r");
    assert_eq!(recorded.code, 0, "{}", recorded.stderr);
    let events = std::fs::read_to_string(folder_below(&out).join("transcript.jsonl")).unwrap();
    let events: Vec<serde_json::Value> = events.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let exits = events.iter().filter(|event| event["kind"] == "attempt").map(|event| &event["body"]["exit"]);
    let labelled: Vec<&serde_json::Value> = exits.filter(|exit| !exit["score"].is_null()).collect();
    assert!(labelled.len() >= 4, "{} labels", labelled.len());
    for exit in labelled {
        for of in ["attack", "realism"] {
            let of = |side: &serde_json::Value| side[of].as_f64().unwrap();
            let (predicted, label) = (of(&exit["route"]["predicted"]), of(&exit["score"]["objectives"]));
            assert!((predicted - label).abs() < 1e-9, "{predicted} {label}");
        }
    }
    let root = recorded.root();
    let (replayed, _) = call("run", &own, "again");
    assert_eq!(replayed.root(), root, "{}", replayed.stderr);
}
