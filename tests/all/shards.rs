//! A study done in shards: planned, worked on apart, merged. It ends in the root of the plain run, and nothing that is
//! damaged, foreign, cut or doubled can change that.

use std::path::{Path, PathBuf};
use std::process::Stdio;

use crate::backends::{experiment, worker};
use crate::harness::{Ran, evodrive, folder_below};

/// A small recorded study, the root of its plain run, and its folder.
struct Recorded {
    folder: tempfile::TempDir,
    experiment: PathBuf,
    root: String,
}

impl Recorded {
    fn new(backend: &str) -> Recorded {
        let folder = tempfile::tempdir().unwrap();
        let experiment = experiment(folder.path(), "apart", backend);
        let text = std::fs::read_to_string(&experiment).unwrap();
        let text = text
            .replace("epochs = 1\nslots = 1", "epochs = 2\nslots = 3")
            .replace("probe_scenes = 1", "probe_scenes = 3");
        std::fs::write(&experiment, text).unwrap();
        let plain = folder.path().join("plain");
        let ran = Ran::of(evodrive().arg("record").arg(&experiment).args(["--no-report", "--out"]).arg(&plain));
        let root = ran.root();
        Recorded { folder, experiment, root }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn shard(&self, verb: &str, more: &[&str]) -> (Ran, serde_json::Value) {
        let ran = Ran::of(
            evodrive()
                .args(["--json", "shard", verb])
                .arg(&self.experiment)
                .arg("--out")
                .arg(self.path("apart"))
                .args(more),
        );
        let said = serde_json::from_str(&ran.stdout).unwrap_or_else(|_| panic!("{}{}", ran.stdout, ran.stderr));
        (ran, said)
    }

    /// The shards to do, in pieces of at most seven tasks.
    fn plan(&self) -> (serde_json::Value, Vec<PathBuf>) {
        let (ran, said) = self.shard("plan", &["--size", "7"]);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        let to_do =
            said["to_do"].as_array().unwrap().iter().map(|path| PathBuf::from(path.as_str().unwrap())).collect();
        (said, to_do)
    }

    /// Plans, works and merges until nothing is missing: the number of rounds.
    fn rounds(&self) -> usize {
        for round in 0..40 {
            let (said, to_do) = self.plan();
            if said["complete"] == true {
                return round;
            }
            assert!(!to_do.is_empty(), "{said}");
            assert_eq!(work(&to_do).code, 0);
            assert_eq!(self.shard("merge", &[]).0.code, 0);
        }
        panic!("40 rounds are not enough");
    }

    /// The run that follows: its root, and how many rollouts it simulated itself.
    fn run(&self) -> (String, serde_json::Value) {
        let run = || {
            let mut command = evodrive();
            command.arg("run").arg(&self.experiment).args(["--no-report", "--out"]).arg(self.path("apart"));
            command
        };
        let said: serde_json::Value = serde_json::from_str(&Ran::of(run().arg("--json")).stdout).unwrap();
        (Ran::of(&mut run()).root(), said["rollouts"]["simulated"].clone())
    }
}

fn work(shards: &[PathBuf]) -> Ran {
    Ran::of(evodrive().args(["--jobs", "1", "shard", "work"]).args(shards))
}

fn result_of(shard: &Path) -> PathBuf {
    shard.with_extension("result")
}

#[test]
fn a_study_done_in_shards_ends_in_the_root_of_the_plain_run() {
    let study = Recorded::new("");
    let (_, to_do) = study.plan();
    assert!(to_do.len() >= 4, "too few shards to show anything: {to_do:?}");
    // Two machines with nothing but the study and their shards; one of the shards is done on both.
    let run = folder_below(&study.path("apart"));
    for (machine, own) in [("one", &to_do[..3]), ("two", &to_do[2..])] {
        let there = study.path(machine);
        std::fs::create_dir(&there).unwrap();
        for file in ["experiment.toml", "scenes.pool"] {
            std::fs::copy(run.join(file), there.join(file)).unwrap();
        }
        for shard in own {
            let copy = there.join(shard.file_name().unwrap());
            std::fs::copy(shard, &copy).unwrap();
            let ran = Ran::of(evodrive().args(["shard", "work"]).arg(&copy).arg("--study").arg(&there));
            assert_eq!(ran.code, 0, "{}", ran.stderr);
        }
    }
    let there = [study.path("one"), study.path("two")];
    let (merged, said) = study.shard("merge", &["--results", there[0].to_str().unwrap(), there[1].to_str().unwrap()]);
    assert_eq!(merged.code, 0, "{}", merged.stderr);
    assert_eq!(said["results"], to_do.len() + 1);
    assert!(said["known"].as_u64().unwrap() > 0, "what was done twice is known the second time: {said}");
    // The rest of the rounds on this machine. What was merged is not planned again.
    for shard in &to_do {
        let name = result_of(shard).file_name().unwrap().to_owned();
        let from = if there[0].join(&name).exists() { &there[0] } else { &there[1] };
        std::fs::copy(from.join(&name), result_of(shard)).unwrap();
    }
    let rounds = study.rounds();
    assert!(rounds <= 8, "{rounds} rounds");
    assert_eq!(study.run(), (study.root.clone(), serde_json::json!(0)));
}

#[test]
fn another_simulators_rollouts_are_recorded_by_shards_and_replayed_without_it() {
    let study = Recorded::new(&worker(&[env!("CARGO_BIN_EXE_evodrive"), "worker"]));
    let cassette = study.path("rollouts.jsonl.zst");
    std::fs::remove_file(&cassette).unwrap();
    let (said, _) = study.plan();
    assert_eq!(said["undisturbed"], 9, "every scene without a program: {said}");
    study.rounds();
    let gone = std::fs::read_to_string(&study.experiment).unwrap();
    std::fs::write(&study.experiment, gone.replace(env!("CARGO_BIN_EXE_evodrive"), "/nowhere/at/all")).unwrap();
    assert_eq!(study.run().0, study.root);
    // The cassette alone is enough, too: a folder without the merged records.
    let cold =
        Ran::of(evodrive().arg("run").arg(&study.experiment).args(["--no-report", "--out"]).arg(study.path("cold")));
    assert_eq!(cold.root(), study.root);
}

/// Harm to a result or a shard: its name, the change, the exit code and what the refusal says.
type Harm = (&'static str, fn(&str) -> String, i32, &'static str);

fn without_last_task(text: &str) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_string).collect();
    let tasks = lines.len() - 2;
    lines.remove(tasks);
    let end = lines[tasks].replace(&format!("\"tasks\":{tasks}"), &format!("\"tasks\":{}", tasks - 1));
    lines[tasks] = end;
    lines.join("\n") + "\n"
}

fn of_another_run(text: &str) -> String {
    let at = text.find("\"experiment\":\"").unwrap() + 14;
    let digit = if &text[at..=at] == "0" { "1" } else { "0" };
    format!("{}{digit}{}", &text[..at], &text[at + 1..])
}

#[test]
fn a_result_that_is_cut_altered_or_foreign_is_refused_with_its_place_and_nothing_is_lost() {
    let study = Recorded::new("");
    let (_, to_do) = study.plan();
    assert_eq!(work(&to_do).code, 0);
    let harms: [Harm; 7] = [
        ("half a line", |text| text[..text.len() - 9].to_string(), 5, "half a line of"),
        (
            "the last line is gone",
            |text| text.lines().take(2).map(|line| format!("{line}\n")).collect(),
            5,
            "the end of the file",
        ),
        ("the last task is left out", without_last_task, 5, "the result of a task"),
        ("a digit is another one", |text| text.replacen("\"record\":{\"", "\"record\":{ \"", 1), 5, "with digest"),
        ("NaN", |text| text.replacen("\"record\":{", "\"record\":NaN,\"x\":{", 1), 5, "line 2"),
        ("of another release", |text| text.replacen("\"sim\":", "\"sim\":9", 1), 2, "versions is"),
        ("of another run", of_another_run, 2, "experiment is"),
    ];
    for (what, harm, code, expected) in harms {
        let harmed = result_of(&to_do[0]);
        let good = std::fs::read_to_string(&harmed).unwrap();
        std::fs::write(&harmed, harm(&good)).unwrap();
        let (ran, said) = study.shard("merge", &[]);
        assert_eq!(ran.code, code, "{what}: {}", ran.stderr);
        let refused = said["refused"].to_string();
        assert!(refused.contains(expected), "{what}: {refused}");
        assert!(refused.contains(".result"), "{what}: {refused}");
        assert_eq!(said["results"], to_do.len() - 1, "{what}: the others are merged");
        std::fs::write(&harmed, good).unwrap();
    }
    // A refused result is planned as missing, until it is there.
    let (said, _) = study.plan();
    assert!(said["unmerged"].as_u64().unwrap() > 0, "{said}");
    study.shard("merge", &[]);
    study.rounds();
    assert_eq!(study.run().0, study.root);
}

#[test]
fn two_records_of_one_request_stop_the_merge_and_name_both_results() {
    let study = Recorded::new("");
    let (_, to_do) = study.plan();
    assert_eq!(work(&to_do).code, 0);
    // Another machine says another thing: a record that is whole and has its own digest.
    let text = std::fs::read_to_string(result_of(&to_do[0])).unwrap();
    let line = text.lines().find(|line| line.contains("\"record\"")).expect("a record");
    let mut other: serde_json::Value = serde_json::from_str(line).unwrap();
    other["record"]["ego"] = "somebody".into();
    let record = other["record"].to_string();
    let digest = evodrive::kernel::Digest::of_bytes(record.as_bytes());
    let task = &other["task"];
    let lie = format!("{{\"task\":{task},\"digest\":\"{digest}\",\"record\":{record}}}");
    let elsewhere = study.path("elsewhere");
    std::fs::create_dir(&elsewhere).unwrap();
    let name = result_of(&to_do[0]).file_name().unwrap().to_owned();
    std::fs::write(elsewhere.join(&name), text.replacen(line, &lie, 1)).unwrap();
    let (ran, said) = study.shard("merge", &["--results", elsewhere.to_str().unwrap()]);
    assert_eq!(ran.code, 4, "{}", ran.stderr);
    let message = said["error"].to_string();
    for part in [digest.to_hex().as_str(), task.as_str().unwrap(), "elsewhere", "apart", "nothing was merged"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    let (said, _) = study.plan();
    assert_eq!(said["missing"], said["unmerged"], "nothing was merged: {said}");
    // Without the lie everything is well; with it afterwards the run itself is the first witness.
    let honest = study.shard("merge", &[]);
    assert_eq!(honest.0.code, 0, "{}", honest.0.stderr);
    let (ran, _) = study.shard("merge", &["--results", elsewhere.to_str().unwrap()]);
    assert_eq!(ran.code, 4, "{}", ran.stderr);
    study.rounds();
    assert_eq!(study.run().0, study.root);
}

#[test]
fn a_shard_that_is_altered_cut_or_of_another_run_is_not_begun() {
    let study = Recorded::new("");
    let (_, to_do) = study.plan();
    let good = std::fs::read(&to_do[0]).unwrap();
    let refused = |bytes: &[u8], code: i32, expected: &str| {
        std::fs::write(&to_do[0], bytes).unwrap();
        let ran = work(&to_do[..1]);
        assert_eq!(ran.code, code, "{expected}: {}", ran.stderr);
        assert!(ran.stderr.contains(expected), "{expected}: {}", ran.stderr);
        assert!(!result_of(&to_do[0]).exists());
    };
    refused(&good[..good.len() - 5], 5, "half a line");
    let text = String::from_utf8(good.clone()).unwrap();
    refused(text.replacen("scene\":\"", "scene\":\"x", 1).as_bytes(), 5, "bytes with the digest of its name");
    std::fs::write(&to_do[0], &good).unwrap();
    // Another study: its folder is named by mistake.
    let other = experiment(study.folder.path(), "other", "");
    let ran = Ran::of(evodrive().arg("record").arg(&other).args(["--no-report", "--out"]).arg(study.path("others")));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let ran = Ran::of(
        evodrive().args(["shard", "work"]).arg(&to_do[0]).arg("--study").arg(folder_below(&study.path("others"))),
    );
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("another study: experiment is"), "{}", ran.stderr);
}

#[test]
fn a_killed_worker_loses_nothing() {
    let study = Recorded::new("");
    let (_, to_do) = study.plan();
    for shard in &to_do {
        let mut command = evodrive();
        command.args(["--jobs", "1", "shard", "work"]).arg(shard).stdout(Stdio::null()).stderr(Stdio::null());
        let mut worker = command.spawn().unwrap();
        worker.kill().unwrap();
        worker.wait().unwrap();
    }
    assert_eq!(study.shard("merge", &[]).0.code, 0, "half-done shards disturb no merge");
    study.rounds();
    assert_eq!(study.run().0, study.root);
}

/// Forges a record of a result: another ego's motion with its own digest, as a liar would write it. Returns the record's task.
fn made_up(result: &Path) -> String {
    let text = std::fs::read_to_string(result).unwrap();
    let line = text.lines().find(|line| line.contains("\"outcome\"")).expect("a rollout's record");
    let mut other: serde_json::Value = serde_json::from_str(line).unwrap();
    let covered = &mut other["record"]["decision"];
    *covered = serde_json::json!("the worker's own words");
    let record = other["record"].to_string();
    let digest = evodrive::kernel::Digest::of_bytes(record.as_bytes());
    let task = other["task"].as_str().unwrap().to_string();
    let lie = format!("{{\"task\":\"{task}\",\"digest\":\"{digest}\",\"record\":{record}}}");
    std::fs::write(result, text.replacen(line, &lie, 1)).unwrap();
    task
}

#[test]
fn an_audit_of_the_merge_names_the_worker_that_made_a_record_up_and_merges_the_others() {
    let study = Recorded::new("");
    let (_, to_do) = study.plan();
    assert_eq!(work(&to_do).code, 0);
    // A shard may hold labels alone, or what was played without a program alone.
    let holds = |shard: &&PathBuf| std::fs::read_to_string(result_of(shard)).unwrap().contains("\"outcome\"");
    let lying = result_of(to_do.iter().find(holds).expect("a shard with a rollout's record"));
    let honest = std::fs::read(&lying).unwrap();
    let task = made_up(&lying);
    let (ran, said) = study.shard("merge", &["--audit", "1"]);
    assert_eq!(ran.code, 4, "{}", ran.stderr);
    let refused = said["refused"].to_string();
    let name = lying.file_name().unwrap().to_str().unwrap().to_string();
    for part in [name.as_str(), &task, "decision", "the worker's own words", "computed here"] {
        assert!(refused.contains(part), "{part}: {refused}");
    }
    assert_eq!((&said["results"], said["refused"].as_array().unwrap().len()), (&(to_do.len() - 1).into(), 1));
    assert!(said["audited"].as_u64().unwrap() >= to_do.len() as u64, "{said}");
    // A draw that misses the lie lets it in: an audit is a sample, and says how many it looked at.
    let (ran, said) = study.shard("merge", &["--audit", "1e-9"]);
    assert_eq!((ran.code, &said["audited"]), (0, &0.into()), "{}", ran.stderr);
    // What was found out later is taken out by name; its result does not bring it back, the honest one does.
    let run = folder_below(&study.path("apart"));
    let run = run.to_str().unwrap();
    let ran =
        Ran::of(evodrive().args(["shard", "withdraw", &task[..16], "--run", run, "--reason", "node 7 was faulty"]));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let (ran, said) = study.shard("merge", &[]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    let refused = said["refused"].to_string();
    assert!(refused.contains("node 7 was faulty") && refused.contains(&task), "{refused}");
    let (said, _) = study.plan();
    assert!(said["missing"].as_u64().unwrap() > 0, "the run asks for it again: {said}");
    std::fs::write(&lying, honest).unwrap();
    assert_eq!(study.shard("merge", &["--audit", "0.3"]).0.code, 0);
    study.rounds();
    assert_eq!(study.run().0, study.root);
    let noted = std::fs::read_to_string(Path::new(run).join("withdrawn.jsonl")).unwrap();
    assert!(noted.lines().count() == 1 && noted.contains(&task) && noted.contains("node 7 was faulty"), "{noted}");
}

#[test]
fn an_audit_holds_records_to_the_motion_that_another_simulator_told() {
    let study = Recorded::new(&worker(&[env!("CARGO_BIN_EXE_evodrive"), "worker"]));
    std::fs::remove_file(study.path("rollouts.jsonl.zst")).unwrap();
    let to_do = (0..20)
        .find_map(|_| {
            let (_, to_do) = study.plan();
            assert_eq!(work(&to_do).code, 0);
            let has_label =
                |shard: &PathBuf| std::fs::read_to_string(result_of(shard)).unwrap().contains("\"outcome\"");
            if let Some(shard) = to_do.iter().find(|shard| has_label(shard)) {
                return Some(shard.clone());
            }
            assert_eq!(study.shard("merge", &["--audit", "1"]).0.code, 0);
            None
        })
        .expect("a shard with a label");
    made_up(&result_of(&to_do));
    let (ran, said) = study.shard("merge", &["--audit", "1"]);
    assert_eq!(ran.code, 4, "{}", ran.stderr);
    assert!(said["refused"].to_string().contains("decision"), "{said}");
}

#[test]
fn a_withdrawn_record_of_a_finished_run_is_no_damage_and_is_simulated_again() {
    let study = Recorded::new("");
    study.rounds();
    study.run();
    let folder = folder_below(&study.path("apart"));
    let run = folder.to_str().unwrap();
    let label = crate::harness::events(&folder)
        .into_iter()
        .find_map(|event| {
            event["body"].pointer("/parent_score/scenes/0/record").map(|record| record.as_str().unwrap().to_string())
        })
        .expect("a label");
    let withdraw = |record: &str| {
        Ran::of(evodrive().args(["shard", "withdraw", record, "--run", run, "--reason", "to see it again"]))
    };
    let ran = withdraw("0123");
    assert!(ran.code == 2 && ran.stderr.contains("hex digits"), "{}", ran.stderr);
    let ran = withdraw(&"0".repeat(64));
    assert!(ran.code == 2 && ran.stderr.contains("no record of"), "{}", ran.stderr);
    let ran = withdraw(&label);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let fsck = || Ran::of(evodrive().args(["fsck", "--read", run]));
    let ran = fsck();
    assert!(ran.code == 0 && ran.stdout.contains("1 records were withdrawn"), "{} {}", ran.code, ran.stdout);
    assert_eq!(study.run(), (study.root.clone(), serde_json::json!(1)), "it alone is simulated again");
    let ran = fsck();
    assert!(ran.code == 0 && !ran.stdout.contains("were withdrawn"), "{}", ran.stdout);
}
