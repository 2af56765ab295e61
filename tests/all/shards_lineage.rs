//! Shards of whole lineages: every lineage is gone to its end elsewhere, in few rounds, and the run ends in the root of the plain run.

use std::path::{Path, PathBuf};

use crate::backends::{experiment, worker};
use crate::harness::{Ran, evodrive, folder_below};
use crate::own_ego::{copied, driver, python};

/// A small recorded study of three lineages, and the root of its plain run.
pub struct Plain {
    pub folder: tempfile::TempDir,
    pub experiment: PathBuf,
    pub root: String,
}

impl Plain {
    fn new(more: &str) -> Plain {
        let folder = tempfile::tempdir().unwrap();
        let experiment = small(folder.path(), more);
        let root = Plain::record(&experiment, &folder.path().join("plain"));
        Plain { folder, experiment, root }
    }

    pub fn record(experiment: &Path, out: &Path) -> String {
        Ran::of(evodrive().arg("record").arg(experiment).args(["--no-report", "--out"]).arg(out)).root()
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn shard(&self, verb: &str, more: &[&str]) -> (Ran, serde_json::Value) {
        let mut command = evodrive();
        command.args(["--json", "shard", verb]).arg(&self.experiment).arg("--out").arg(self.path("apart")).args(more);
        let ran = Ran::of(&mut command);
        let said = serde_json::from_str(&ran.stdout).unwrap_or_else(|_| panic!("{}{}", ran.stdout, ran.stderr));
        (ran, said)
    }

    pub fn plan(&self, more: &[&str]) -> (serde_json::Value, Vec<PathBuf>) {
        let (ran, said) = self.shard("plan", &[&["--whole-lineages"], more].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        let path = |path: &serde_json::Value| PathBuf::from(path.as_str().unwrap());
        let to_do = said["to_do"].as_array().unwrap().iter().map(path).collect();
        (said, to_do)
    }

    /// Rounds until nothing is missing. Shards are done on machines that have the study alone, in another order than planned.
    pub fn rounds(&self, more: &[&str]) -> usize {
        for round in 0..20 {
            let (said, to_do) = self.plan(more);
            if said["complete"] == true {
                return round;
            }
            assert!(!to_do.is_empty(), "{said}");
            for shard in to_do.iter().rev() {
                assert_eq!(self.elsewhere(shard).code, 0);
            }
            let (ran, _) = self.shard("merge", &["--audit", "0.2"]);
            assert_eq!(ran.code, 0, "{}", ran.stderr);
        }
        panic!("20 rounds are not enough");
    }

    /// Does a shard in a folder with nothing but the study, and brings the result back.
    fn elsewhere(&self, shard: &Path) -> Ran {
        let there = tempfile::tempdir_in(self.folder.path()).unwrap();
        let run = folder_below(&self.path("apart"));
        for file in ["experiment.toml", "scenes.pool"] {
            std::fs::copy(run.join(file), there.path().join(file)).unwrap();
        }
        if run.join("planner").exists() {
            std::fs::create_dir(there.path().join("planner")).unwrap();
            for file in std::fs::read_dir(run.join("planner")).unwrap() {
                let file = file.unwrap();
                std::fs::copy(file.path(), there.path().join("planner").join(file.file_name())).unwrap();
            }
        }
        let copy = there.path().join(shard.file_name().unwrap());
        std::fs::copy(shard, &copy).unwrap();
        let mut command = evodrive();
        command.args(["--jobs", "1", "shard", "work"]).arg(&copy).arg("--study").arg(there.path());
        let ran = Ran::of(&mut command);
        if ran.code == 0 {
            std::fs::copy(copy.with_extension("result"), shard.with_extension("result")).unwrap();
        }
        ran
    }

    /// The run that follows: its root, and how many rollouts it simulated itself.
    pub fn run(&self, verb: &str) -> (String, serde_json::Value) {
        let run = || {
            let mut command = evodrive();
            command.arg(verb).arg(&self.experiment).args(["--no-report", "--out"]).arg(self.path("apart"));
            command
        };
        let said: serde_json::Value = serde_json::from_str(&Ran::of(run().arg("--json")).stdout).unwrap();
        (Ran::of(&mut run()).root(), said["rollouts"]["simulated"].clone())
    }
}

/// Three epochs of three lineages; `more` is added.
pub fn small(folder: &Path, more: &str) -> PathBuf {
    let path = experiment(folder, "apart", more);
    let text = std::fs::read_to_string(&path).unwrap();
    let text =
        text.replace("epochs = 1\nslots = 1\nmax_repair_rounds = 0", "epochs = 3\nslots = 4\nmax_repair_rounds = 1");
    std::fs::write(&path, text.replace("probe_scenes = 1", "probe_scenes = 3")).unwrap();
    path
}

/// Lineages of one family, which are shown each other's cards.
const RELATED: &str = "[[lineage]]\nid = \"cat-one\"\nfamily = \"cat\"\nego = \"idm\"\n\
                       [[lineage]]\nid = \"cat-two\"\nfamily = \"cat\"\nego = \"idm\"\n\
                       [[lineage]]\nid = \"cat-three\"\nfamily = \"cat\"\nego = \"idm\"\n";

#[test]
fn a_recorded_study_takes_one_round_of_one_shard_a_lineage() {
    let study = Plain::new(RELATED);
    let (said, to_do) = study.plan(&[]);
    assert_eq!((to_do.len(), &said["lineages"]), (3, &3.into()));
    assert_eq!(said["names"][0].as_str().unwrap().split(' ').nth(1), Some("from"), "{said}");
    assert_eq!(study.rounds(&[]), 1);
    assert_eq!(study.run("run"), (study.root.clone(), 0.into()));
}

#[test]
fn a_study_that_is_recorded_by_shards_takes_a_round_an_epoch_and_asks_nobody_at_the_end() {
    let study = Plain::new("");
    let cassette = study.path("apart.jsonl");
    let answers = std::fs::read(&cassette).unwrap();
    std::fs::remove_file(&cassette).unwrap();
    let rounds = study.rounds(&["--record"]);
    // Cards of other lineages are part of an epoch's questions, so nobody can go further than the others are.
    assert_eq!(rounds, 3);
    let recording = folder_below(&study.path("apart")).join("recording");
    assert!(recording.exists());
    // What workers were answered is this recording's: another answer to the same question is refused.
    let results = folder_below(&study.path("apart")).join("shards");
    let result = std::fs::read_dir(results).unwrap().map(|entry| entry.unwrap().path());
    let mut result = result.filter(|path| path.extension().is_some_and(|ending| ending == "result"));
    let result = result.find(|path| std::fs::read_to_string(path).unwrap().contains("{\"answer\"")).expect("an answer");
    let honest = std::fs::read(&result).unwrap();
    altered(&result, "{\"answer\"", |line| {
        let mut line: serde_json::Value = serde_json::from_str(line).unwrap();
        line["reply"] = "another answer".into();
        line.to_string()
    });
    let (ran, _) = study.shard("merge", &[]);
    assert_eq!(ran.code, 4, "{}", ran.stderr);
    std::fs::write(&result, honest).unwrap();
    assert_eq!(study.run("record"), (study.root.clone(), 0.into()));
    assert_eq!(std::fs::read(&cassette).unwrap(), answers);
}

#[test]
fn an_evaluator_that_turns_candidates_away_costs_rounds_and_changes_no_root() {
    let routing = "[world.routing]\nrollout_budget = 2\nmin_labels = 3\naudit_share = 0.5\n";
    let study = Plain::new(routing);
    let rounds = study.rounds(&[]);
    assert!((1..=4).contains(&rounds), "{rounds}");
    assert_eq!(study.run("run"), (study.root.clone(), 0.into()));
}

#[test]
fn a_lineage_goes_on_from_where_the_run_stands() {
    let study = Plain::new("");
    // The first rounds by task, the rest of the way as a whole.
    for _ in 0..3 {
        let (ran, said) = study.shard("plan", &[]);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        for shard in said["to_do"].as_array().unwrap() {
            assert_eq!(study.elsewhere(Path::new(shard.as_str().unwrap())).code, 0);
        }
        assert_eq!(study.shard("merge", &[]).0.code, 0);
    }
    let (said, to_do) = study.plan(&[]);
    assert!(said["names"].to_string().contains("epoch"), "{said}");
    let text = std::fs::read_to_string(&to_do[0]).unwrap();
    assert!(text.contains("\"kind\":\"rollout\""), "what is on record travels");
    assert!(study.rounds(&[]) <= 2);
    assert_eq!(study.run("run"), (study.root.clone(), 0.into()));
}

#[test]
fn another_simulator_is_asked_where_the_lineage_is_gone() {
    let study = Plain::new(&worker(&[env!("CARGO_BIN_EXE_evodrive"), "worker"]));
    std::fs::remove_file(study.path("rollouts.jsonl.zst")).unwrap();
    // Scenes without a program first: all lineages rest on them.
    let rounds = study.rounds(&[]);
    assert!(rounds <= 3, "{rounds}");
    let gone = std::fs::read_to_string(&study.experiment).unwrap();
    std::fs::write(&study.experiment, gone.replace(env!("CARGO_BIN_EXE_evodrive"), "/nowhere/at/all")).unwrap();
    assert_eq!(study.run("run").0, study.root);
}

#[test]
fn a_planner_travels_with_its_shards_and_a_machine_without_it_says_so() {
    if !python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    copied(folder.path(), &["idm.py", "evodrive_driver.py"]);
    let experiment = experiment(folder.path(), "apart", &driver("idm.py"));
    let root = Plain::record(&experiment, &folder.path().join("plain"));
    let study = Plain { folder, experiment, root };
    std::fs::remove_file(study.path("mine.jsonl.zst")).unwrap();
    let (_, to_do) = study.plan(&[]);
    let run = folder_below(&study.path("apart"));
    let kept = run.join("planner/idm.py");
    let text = std::fs::read(&kept).unwrap();
    std::fs::write(&kept, b"print('another planner')").unwrap();
    let ran = study.elsewhere(&to_do[0]);
    assert_eq!(ran.code, 69, "{}", ran.stderr);
    assert!(ran.stderr.contains("lacks idm.py, which the shard needs"), "{}", ran.stderr);
    std::fs::write(&kept, text).unwrap();
    // Python is needed too.
    let mut command = evodrive();
    command.args(["shard", "work"]).arg(&to_do[0]).arg("--study").arg(&run).env("PATH", "");
    let ran = Ran::of(&mut command);
    assert_eq!(ran.code, 69, "{}", ran.stderr);
    assert!(ran.stderr.contains("cannot be started"), "{}", ran.stderr);
    study.rounds(&[]);
    for file in ["idm.py", "evodrive_driver.py"] {
        std::fs::remove_file(study.path(file)).unwrap();
    }
    let text = std::fs::read_to_string(run.join("experiment.toml")).unwrap();
    let digest = text.lines().find(|line| line.starts_with("digest")).expect("the planner's digest");
    let declared = std::fs::read_to_string(&study.experiment).unwrap();
    std::fs::write(&study.experiment, declared.replace("[driver]\n", &format!("[driver]\n{digest}\n"))).unwrap();
    assert_eq!(study.run("run").0, study.root);
}

/// Replaces the first line of a result that holds `part`.
fn altered(result: &Path, part: &str, change: impl Fn(&str) -> String) {
    let text = std::fs::read_to_string(result).unwrap();
    let line = text.lines().find(|line| line.contains(part)).unwrap_or_else(|| panic!("{part}"));
    std::fs::write(result, text.replacen(line, &change(line), 1)).unwrap();
}

#[test]
fn a_lineages_result_that_lies_about_a_record_or_its_key_is_refused_and_named() {
    let study = Plain::new("");
    let (_, to_do) = study.plan(&[]);
    for shard in &to_do {
        assert_eq!(study.elsewhere(shard).code, 0);
    }
    let result = to_do[0].with_extension("result");
    let honest = std::fs::read(&result).unwrap();
    // A record with its own digest, as whoever lies would write it.
    altered(&result, "\"outcome\"", |line| {
        let mut line: serde_json::Value = serde_json::from_str(line).unwrap();
        line["record"]["decision"] = "the worker's own words".into();
        let record = line["record"].to_string();
        let digest = evodrive::kernel::Digest::of_bytes(record.as_bytes());
        format!("{{\"task\":{},\"digest\":\"{digest}\",\"record\":{record}}}", line["task"])
    });
    let (ran, said) = study.shard("merge", &["--audit", "1"]);
    assert_eq!(ran.code, 4, "{}", ran.stderr);
    assert_eq!(said["refused_results"][0], result.to_str().unwrap());
    assert!(said["refused"].to_string().contains("the worker's own words"), "{said}");
    // An honest record under the key of another task would be believed by the run.
    std::fs::write(&result, &honest).unwrap();
    let text = String::from_utf8(honest.clone()).unwrap();
    let tasks: Vec<&str> = text.lines().filter(|line| line.contains("\"of\":{\"kind\":\"label\"")).collect();
    let key = |line: &str| line.split('"').nth(3).unwrap().to_string();
    let (one, other) = (key(tasks[0]), key(tasks[1]));
    let swapped = text.replace(&one, "#").replace(&other, &one).replace('#', &other);
    std::fs::write(&result, swapped).unwrap();
    let (ran, said) = study.shard("merge", &[]);
    assert_eq!(ran.code, 5, "{}", ran.stderr);
    assert!(said["refused"].to_string().contains("the key"), "{said}");
    std::fs::write(&result, honest).unwrap();
    let (ran, said) = study.shard("merge", &["--audit", "1"]);
    assert!(ran.code == 0 && said["records"].as_u64().unwrap() > 0, "{said}");
    assert_eq!(study.rounds(&[]), 0);
    assert_eq!(study.run("run"), (study.root.clone(), 0.into()));
}

#[test]
fn a_killed_way_loses_nothing() {
    let study = Plain::new("");
    let (_, to_do) = study.plan(&[]);
    for shard in &to_do {
        let mut command = evodrive();
        command.args(["--jobs", "1", "shard", "work"]).arg(shard).stderr(std::process::Stdio::null());
        let mut worker = command.stdout(std::process::Stdio::null()).spawn().unwrap();
        while !std::fs::read_dir(shard.parent().unwrap()).unwrap().any(|entry| {
            let name = entry.unwrap().file_name();
            name.to_string_lossy().ends_with(".work")
        }) && worker.try_wait().unwrap().is_none()
        {
            std::thread::yield_now();
        }
        worker.kill().unwrap();
        worker.wait().unwrap();
        assert_eq!(Ran::of(evodrive().args(["shard", "work"]).arg(shard)).code, 0);
    }
    assert_eq!(study.shard("merge", &["--audit", "1"]).0.code, 0);
    assert_eq!(study.rounds(&[]), 0);
    assert_eq!(study.run("run"), (study.root.clone(), 0.into()));
}
