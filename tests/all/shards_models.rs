//! Studies that are recorded by shards with a program as their model: asked by the workers where it says what has to travel, else by the plan.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use evodrive::llm::Cassette;

use crate::harness::{Ran, copy_dir, evodrive, folder_below};
use crate::own_ego::python;
use crate::shards_lineage::{Plain, small};

/// Says what was recorded of a question, notes that it was asked, and fails behind a limit. Where it is to see them together it waits for the
/// other lineages.
const ANSWER: &str = r#"import json, os, sys, time
here = os.path.dirname(os.path.abspath(__file__))
asked = json.loads(sys.stdin.readline())
slot = asked["slot"]
place = [slot["lineage"], slot["epoch"], slot["slot"], slot["role"], slot["round"]]
key = "\n".join([*map(str, place), *(of["text"] for of in asked["messages"])])
log, limit = os.path.join(here, "asked.log"), os.path.join(here, "limit")
before = open(log).read().count("\n") if os.path.exists(log) else 0
if os.path.exists(limit) and before >= int(open(limit).read()):
    sys.exit("no more answers today")
if os.path.exists(os.path.join(here, "together")) and place[1:4] == [0, 0, "actor"]:
    # Of the first slots of all lineages none is answered before all of them are asked.
    met, until = os.path.join(here, "met"), time.monotonic() + 120
    os.makedirs(met, exist_ok=True)
    open(os.path.join(met, slot["lineage"]), "w").close()
    while len(os.listdir(met)) < 3:
        if time.monotonic() > until:
            sys.exit("lineages are asked one after the other")
        time.sleep(0.05)
with open(log, "a") as said:
    said.write(f"{slot['role']}\n")
sys.stdout.write(json.load(open(os.path.join(here, "answers.json")))[key])
"#;

/// Returns what the stand-in answers in the small study, as the table that the program reads.
fn answers() -> &'static str {
    static ANSWERS: OnceLock<String> = OnceLock::new();
    ANSWERS.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        Plain::record(&small(folder.path(), ""), &folder.path().join("stand-in"));
        let answers = Cassette::load(&folder.path().join("apart.jsonl")).unwrap();
        let of = |recorded: &evodrive::llm::Recorded| {
            let slot = &recorded.slot;
            let mut key = format!("{}\n{}\n{}\n{}\n{}", slot.lineage, slot.epoch, slot.slot, slot.role, slot.round);
            recorded.messages.iter().for_each(|(_, text)| key += &format!("\n{text}"));
            (key, String::from_utf8(recorded.bytes.clone()).unwrap().into())
        };
        let table: serde_json::Map<String, serde_json::Value> = answers.exchanges().iter().map(of).collect();
        serde_json::Value::from(table).to_string()
    })
}

/// The small study with a program as actor and repair, which answers as the stand-in would; `command` is that model's.
fn study(command: impl Fn(&Path) -> String) -> Plain {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("answers.json"), answers()).unwrap();
    std::fs::write(folder.path().join("answer.py"), ANSWER).unwrap();
    let more = format!(
        "[roles]\nactor = \"mine\"\nrepair = \"mine\"\n[models.mine]\nkind = \"command\"\nmodel = \"mine-1\"\nprovenance = \"a table\"\n\
         [models.mine.command]\ntimeout_s = 60\n{}\n",
        command(folder.path())
    );
    let experiment = small(folder.path(), &more);
    let root = Plain::record(&experiment, &folder.path().join("plain"));
    Plain { folder, experiment, root }
}

/// A copy of the study whose program travels, which is recorded once.
fn travelling() -> Plain {
    static STUDY: OnceLock<Plain> = OnceLock::new();
    let recorded = STUDY.get_or_init(|| {
        study(|_| "program = [\"python3\", \"answer.py\"]\nfiles = [\"answer.py\", \"answers.json\"]".into())
    });
    let folder = tempfile::tempdir().unwrap();
    copy_dir(recorded.folder.path(), folder.path());
    let experiment = folder.path().join(recorded.experiment.file_name().unwrap());
    Plain { folder, experiment, root: recorded.root.clone() }
}

/// Takes the recording's cassette away: its bytes, and how many questions it took.
fn forgotten(study: &Plain) -> (Vec<u8>, usize) {
    let (cassette, log) = (study.path("apart.jsonl"), study.path("asked.log"));
    let taken = (std::fs::read(&cassette).unwrap(), std::fs::read_to_string(&log).unwrap().lines().count());
    std::fs::remove_file(&cassette).unwrap();
    std::fs::remove_file(&log).unwrap();
    taken
}

#[test]
fn a_program_that_travels_is_asked_by_the_workers_in_a_round_an_epoch() {
    if !python() {
        return;
    }
    let study = travelling();
    let (answers, questions) = forgotten(&study);
    assert!(questions > 20, "{questions}");
    assert_eq!(study.rounds(&["--record"]), 3);
    let run = folder_below(&study.path("apart"));
    assert_eq!(study.run("record"), (study.root.clone(), 0.into()));
    // Who answered, and how, came with the answers.
    assert_eq!(std::fs::read(study.path("apart.jsonl")).unwrap(), answers);
    for folder in [study.folder.path(), &run.join("planner")] {
        assert!(!folder.join("asked.log").exists(), "asked here, in {}", folder.display());
    }
}

#[test]
fn a_program_that_does_not_travel_is_asked_by_the_plan_in_two_rounds_an_epoch() {
    if !python() {
        return;
    }
    let study = study(|folder| format!("program = [\"python3\", {:?}]", folder.join("answer.py")));
    let (answers, questions) = forgotten(&study);
    // All lineages of an epoch are asked together.
    std::fs::write(study.path("together"), "").unwrap();
    let rounds = study.rounds(&["--record", "--open", "24"]);
    assert!((3..=3 * 2 + 2).contains(&rounds), "{rounds}");
    assert_eq!(study.run("record"), (study.root.clone(), 0.into()));
    assert_eq!(std::fs::read(study.path("apart.jsonl")).unwrap(), answers);
    assert_eq!(std::fs::read_to_string(study.path("asked.log")).unwrap().lines().count(), questions);
}

/// A shard of a study in a folder that has all it needs.
fn first_shard(study: &Plain) -> (PathBuf, PathBuf) {
    let (_, to_do) = study.plan(&["--record"]);
    (folder_below(&study.path("apart")), to_do[0].clone())
}

fn work(run: &Path, shard: &Path) -> std::process::Command {
    let mut command = evodrive();
    command.args(["--jobs", "1", "shard", "work"]).arg(shard).arg("--study").arg(run);
    command
}

#[test]
fn a_machine_without_the_program_says_so() {
    if !python() {
        return;
    }
    let study = travelling();
    forgotten(&study);
    let (run, shard) = first_shard(&study);
    let ran = Ran::of(work(&run, &shard).env("PATH", ""));
    assert_eq!(ran.code, 69, "{}", ran.stderr);
    assert!(ran.stderr.contains("`python3` cannot be started"), "{}", ran.stderr);
    let table = run.join("planner/answers.json");
    let text = std::fs::read(&table).unwrap();
    std::fs::write(&table, "{}").unwrap();
    let ran = Ran::of(&mut work(&run, &shard));
    assert_eq!(ran.code, 69, "{}", ran.stderr);
    assert!(ran.stderr.contains("lacks answers.json, which the shard needs"), "{}", ran.stderr);
    std::fs::write(&table, text).unwrap();
    assert_eq!(Ran::of(&mut work(&run, &shard)).code, 0);
}

#[test]
fn what_a_worker_was_answered_before_it_failed_is_not_asked_again() {
    if !python() {
        return;
    }
    let study = travelling();
    forgotten(&study);
    let (run, shard) = first_shard(&study);
    let (log, limit) = (run.join("planner/asked.log"), run.join("planner/limit"));
    // Not among what is asked for here: the program itself goes on where its files lie.
    for file in ["answer.py", "answers.json"] {
        std::fs::rename(study.path(file), study.path(&format!("{file}.away"))).unwrap();
    }
    std::fs::write(&limit, "3").unwrap();
    let ran = Ran::of(&mut work(&run, &shard));
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("no more answers today"), "{}", ran.stderr);
    std::fs::remove_file(&limit).unwrap();
    assert_eq!(Ran::of(&mut work(&run, &shard)).code, 0);
    let result = std::fs::read_to_string(shard.with_extension("result")).unwrap();
    let of_the_program = |line: &&str| line.contains("\"role\":\"actor\"") || line.contains("\"role\":\"repair\"");
    let answers = result.lines().filter(|line| line.starts_with("{\"answer\"")).filter(of_the_program).count();
    assert!(answers > 3, "{answers}");
    assert_eq!(std::fs::read_to_string(&log).unwrap().lines().count(), answers);
}
