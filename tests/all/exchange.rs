//! Models behind files and programs, with the binary as a user starts it.

use evodrive::llm::{Cassette, Model, ModelSpec, Request, Schema};
use evodrive::scripted::Scripted;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::backends::experiment as small;
use crate::harness::{Ran, evodrive, folder_below, home, run, text};

/// The live example with another model as actor and repair.
fn experiment(dir: &Path, model: &str) -> PathBuf {
    let example = text("experiments/live_example.toml");
    let (before, rest) = example.split_once("[models.local]").unwrap();
    let (_, after) = rest.split_once("# A model of Anthropic").unwrap();
    let whole = format!("{before}[models.local]\n{model}\n# A model of Anthropic{after}");
    let path = dir.join("mine.toml");
    std::fs::write(&path, whole).unwrap();
    path
}

fn record(dir: &Path, experiment: &Path, jobs: &str) -> std::process::Command {
    let mut command = evodrive();
    command.args(["record", "--no-report", "--jobs", jobs]).arg(experiment);
    command.arg("--out").arg(dir.join("runs")).arg("--cassette").arg(dir.join("mine.jsonl"));
    command
}

const EXCHANGE: &str = "kind = \"exchange\"\nmodel = \"a-person\"\nprovenance = \"typed by hand\"\n";

/// Role and reply file of every open question of a run; none before the run has a folder.
fn open(runs: &Path) -> Vec<(String, PathBuf)> {
    let Ok(mut folders) = std::fs::read_dir(runs) else { return vec![] };
    let Some(folder) = folders.find_map(|entry| Some(entry.ok()?.path()).filter(|path| path.is_dir())) else {
        return vec![];
    };
    let ran = run(&["exchange", "status", folder.to_str().unwrap(), "--json"]);
    let Ok(status) = serde_json::from_str::<serde_json::Value>(&ran.stdout) else { return vec![] };
    let of = |entry: &serde_json::Value| (entry["slot"]["role"].to_string(), entry["reply"].as_str().unwrap().into());
    status["open"].as_array().into_iter().flatten().map(of).collect()
}

/// Answers questions with a text that no role can use.
fn answer(open: &[(String, PathBuf)]) {
    for (role, reply) in open {
        let elsewhere = reply.with_extension("part");
        std::fs::write(&elsewhere, format!("I do not know ({role}).")).unwrap();
        std::fs::rename(&elsewhere, reply).unwrap();
    }
}

#[test]
fn questions_in_files_are_answered_while_the_recording_waits_and_after_it_was_stopped() {
    let dir = tempfile::tempdir().unwrap();
    let (file, runs) = (experiment(dir.path(), EXCHANGE), dir.path().join("runs"));
    let mut waiting = record(dir.path(), &file, "2").stderr(std::process::Stdio::null()).spawn().unwrap();
    let asked = (0..1200).find_map(|_| {
        std::thread::sleep(Duration::from_millis(100));
        Some(open(&runs)).filter(|open| open.len() == 2)
    });
    answer(&asked.expect("two slots ask at once"));
    waiting.kill().unwrap();
    waiting.wait().unwrap();
    // What was answered meanwhile is taken, what is asked from here on is answered beside it.
    let mut again = record(dir.path(), &file, "2").stderr(std::process::Stdio::null()).spawn().unwrap();
    let ended = loop {
        answer(&open(&runs));
        std::thread::sleep(Duration::from_millis(100));
        if let Some(status) = again.try_wait().unwrap() {
            break status;
        }
    };
    assert!(ended.success());
    let cassette = Cassette::load(&dir.path().join("mine.jsonl")).unwrap();
    let asked: Vec<_> = cassette.exchanges().iter().filter(|e| e.model.kind == "exchange").collect();
    assert_eq!(asked.len(), 8, "actor and repair of four slots");
    assert!(asked.iter().all(|e| e.metadata.as_ref().is_some_and(|m| m.model == "typed by hand")));
    let folder = folder_below(&runs);
    let status = run(&["exchange", "status", folder.to_str().unwrap()]);
    assert!(status.stdout.starts_with("0 questions wait, 8 are answered"), "{}", status.stdout);
    let replayed = Ran::of(
        evodrive()
            .args(["run", "--no-report"])
            .arg(&file)
            .arg("--out")
            .arg(dir.path().join("again"))
            .arg("--cassette")
            .arg(dir.path().join("mine.jsonl")),
    );
    assert_eq!(replayed.code, 0, "{}", replayed.stderr);
    // No patch could be read, so no critic was asked, and none is named.
    assert!(replayed.stdout.contains("proposals from: exchange (local, a-person);"), "{}", replayed.stdout);
}

#[test]
fn status_without_a_folder_takes_the_run_that_is_being_recorded_and_not_the_latest() {
    let dir = tempfile::tempdir().unwrap();
    let (path, runs) = (small(dir.path(), "earlier", ""), dir.path().join("runs"));
    let begin = |path: &Path| {
        let mut command = evodrive();
        command.args(["record", "--no-report"]).arg(path).arg("--out").arg(&runs);
        command
    };
    Ran::of(&mut begin(&path)).root();
    let status = || Ran::of(evodrive().args(["exchange", "status"]).current_dir(dir.path())).stdout;
    assert!(status().starts_with("0 questions wait, 0 are answered: runs/earlier-"), "{}", status());
    let roles = "[roles]\nactor = \"me\"\n[models.me]\n";
    let path = small(dir.path(), "asks", &format!("{roles}{EXCHANGE}"));
    let mut waiting = begin(&path).stderr(std::process::Stdio::null()).spawn().unwrap();
    let asked = (0..600).find_map(|_| {
        std::thread::sleep(Duration::from_millis(100));
        Some(status()).filter(|status| status.starts_with("3 questions wait, 0 are answered: runs/asks-"))
    });
    waiting.kill().unwrap();
    waiting.wait().unwrap();
    assert!(asked.is_some(), "{}", status());
}

#[test]
fn a_program_answers_or_is_named_with_what_it_complained_of() {
    let dir = tempfile::tempdir().unwrap();
    let model = |script: &str| {
        format!(
            "kind = \"command\"\nmodel = \"a-script\"\nprovenance = \"sh\"\n[models.local.command]\nprogram = [\"sh\", \"-c\", {script:?}]\ntimeout_s = 60\n"
        )
    };
    let bad = experiment(dir.path(), &model("echo the key is missing >&2; exit 7"));
    let ran = Ran::of(&mut record(dir.path(), &bad, "1"));
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    for word in ["exit code 7", "the key is missing", "repeat the command"] {
        assert!(ran.stderr.contains(word), "{word}: {}", ran.stderr);
    }
    let good = experiment(dir.path(), &model("grep -c messages"));
    let ran = Ran::of(&mut record(dir.path(), &good, "1"));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let cassette = Cassette::load(&dir.path().join("mine.jsonl")).unwrap();
    let asked: Vec<_> = cassette.exchanges().iter().filter(|e| e.model.kind == "command").collect();
    assert!(!asked.is_empty() && asked.iter().all(|e| e.bytes == b"1\n"), "one line of JSON reached it");
}

#[test]
fn settings_of_these_kinds_that_cannot_work_are_named() {
    let dir = tempfile::tempdir().unwrap();
    for (model, word) in [
        ("kind = \"exchange\"\nmodel = \"x\"\n", "models.local.provenance"),
        ("kind = \"command\"\nmodel = \"x\"\nprovenance = \"x\"\n", "models.local.command.program"),
        (
            "kind = \"exchange\"\nmodel = \"x\"\nprovenance = \"x\"\nresponse_format = \"json_schema\"\n",
            "models.local.response_format",
        ),
    ] {
        let ran = Ran::of(&mut record(dir.path(), &experiment(dir.path(), model), "1"));
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        assert!(ran.stderr.contains(word), "{word}: {}", ran.stderr);
    }
}

#[test]
fn a_models_name_is_held_to_the_letters_of_run_names() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["../../outside", "a/b", "..", "Local", "a b", "\\u0000"] {
        let text = format!("[roles]\nactor = \"{name}\"\n[models.\"{name}\"]\n{EXCHANGE}");
        let path = small(dir.path(), "named", &text);
        let ran = Ran::of(&mut record(dir.path(), &path, "1"));
        assert_eq!(ran.code, 2, "{name}: {}", ran.stderr);
        assert!(ran.stderr.contains("lower-case letters, digits, `-` or `_`"), "{name}: {}", ran.stderr);
    }
    let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["named.toml"], "nothing is written");
}

/// Stops a recording that has a question of each of its three lineages open; returns the experiment and the folder of its questions.
#[cfg(unix)]
fn asking(dir: &Path) -> (PathBuf, PathBuf) {
    let roles = "[roles]\nactor = \"me\"\n[models.me]\n";
    let path = small(dir, "asks", &format!("{roles}{EXCHANGE}"));
    let mut waiting = record(dir, &path, "1").stderr(std::process::Stdio::null()).spawn().unwrap();
    let runs = dir.join("runs");
    let asked = (0..600).find_map(|_| {
        std::thread::sleep(Duration::from_millis(100));
        Some(open(&runs)).filter(|open| open.len() == 3)
    });
    waiting.kill().unwrap();
    waiting.wait().unwrap();
    let reply = asked.expect("a slot of every lineage asks")[0].1.clone();
    (path, home().join(reply).parent().unwrap().to_path_buf())
}

#[cfg(unix)]
#[test]
fn pipes_and_links_in_the_folder_of_questions_are_named_and_not_waited_for_or_followed() {
    use std::os::unix::fs::symlink;
    let dir = tempfile::tempdir().unwrap();
    let (path, questions) = asking(dir.path());
    let outside = dir.path().join("outside");
    std::fs::create_dir(&outside).unwrap();
    std::fs::write(outside.join("secret"), "of somebody").unwrap();
    let reply = questions.join("1.reply.txt");
    let fifo = || assert!(std::process::Command::new("mkfifo").arg(&reply).status().unwrap().success());
    let link = || symlink(outside.join("secret"), &reply).unwrap();
    let folder = || std::fs::create_dir(&reply).unwrap();
    let gone = || {
        if reply.is_dir() && !reply.is_symlink() {
            std::fs::remove_dir(&reply).unwrap();
        } else {
            std::fs::remove_file(&reply).unwrap();
        }
    };
    let laid: [(&str, &dyn Fn()); 3] = [("a pipe or a device", &fifo), ("a link", &link), ("a folder", &folder)];
    let run_folder = questions.parent().unwrap().parent().unwrap();
    for (what, lay) in laid {
        lay();
        let status = run(&["exchange", "status", run_folder.to_str().unwrap()]);
        let again = Ran::of(&mut record(dir.path(), &path, "1"));
        for ran in [status, again] {
            assert_eq!(ran.code, 2, "{what}: {}", ran.stderr);
            let named = ran.stderr.contains("1.reply.txt") && ran.stderr.contains(&format!("found {what}"));
            assert!(named, "{what}: {}", ran.stderr);
        }
        gone();
    }
    // A folder of questions that leads out of the run folder, and one of them all that does.
    for linked in [questions.as_path(), questions.parent().unwrap()] {
        let aside = linked.with_extension("aside");
        std::fs::rename(linked, &aside).unwrap();
        symlink(&outside, linked).unwrap();
        let ran = Ran::of(&mut record(dir.path(), &path, "1"));
        assert_eq!(ran.code, 2, "{}: {}", linked.display(), ran.stderr);
        assert!(ran.stderr.contains("expected a folder, found a link"), "{}", ran.stderr);
        std::fs::remove_file(linked).unwrap();
        std::fs::rename(&aside, linked).unwrap();
    }
    let there: Vec<_> = std::fs::read_dir(&outside).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(there, ["secret"], "nothing was written outside");
    assert_eq!(std::fs::read(outside.join("secret")).unwrap(), b"of somebody");
}

/// A recording that waits for replies: it ends with its test, also with one that fails.
struct Waiting(std::process::Child);

impl Drop for Waiting {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Returns what the stand-in would answer to a question that lies in a folder.
fn stand_in(question: &Path, seed: u32) -> Vec<u8> {
    let text = std::fs::read_to_string(question.with_extension("json")).unwrap();
    let asked: serde_json::Value = serde_json::from_str(&text).unwrap();
    let rates =
        ["malformed_json_rate", "out_of_range_rate", "foreign_mechanism_rate", "stale_hash_rate", "oversight_rate"];
    let model = ModelSpec {
        name: "scripted".into(),
        kind: "scripted".into(),
        model: "rules-1".into(),
        sampling: rates
            .iter()
            .map(|rate| (rate.to_string(), 0.0))
            .chain([("seed".to_string(), f64::from(seed))])
            .collect(),
        response_format: None,
        body: Default::default(),
        here: Default::default(),
    };
    let (slot, messages) = (&asked["slot"], &asked["messages"]);
    let request = Request {
        adapter_version: 1,
        slot: serde_json::from_value(slot.clone()).unwrap(),
        model,
        messages: serde_json::from_value(messages.clone()).unwrap(),
        schema: Schema::new(asked["schema"].clone()).unwrap(),
    };
    Scripted.complete(&request).unwrap().bytes
}

#[test]
fn a_draft_is_tried_before_it_is_the_answer_and_the_answer_keeps_each_try() {
    let dir = tempfile::tempdir().unwrap();
    let path = small(dir.path(), "tries", &format!("[roles]\nactor = \"me\"\n[models.me]\n{EXCHANGE}"));
    let (runs, cassette) = (dir.path().join("runs"), dir.path().join("mine.jsonl"));
    let mut waiting = Waiting(record(dir.path(), &path, "2").stderr(std::process::Stdio::null()).spawn().unwrap());
    let questions = (0..1200).find_map(|_| {
        std::thread::sleep(Duration::from_millis(100));
        Some(open(&runs)).filter(|open| open.len() == 3)
    });
    let questions = questions.expect("three slots ask at once");
    let question = |reply: &Path| {
        let number = reply.file_name().unwrap().to_string_lossy().replace(".reply.txt", "");
        reply.with_file_name(format!("{number}.request.md"))
    };
    let draft = dir.path().join("draft.json");
    let tried = |question: &Path, text: &[u8]| {
        std::fs::write(&draft, text).unwrap();
        run(&["ask", question.to_str().unwrap(), draft.to_str().unwrap(), "--json"])
    };
    let first = question(&questions[0].1);
    assert!(
        std::fs::read_to_string(&first).unwrap().contains("evodrive ask"),
        "the question says that it can be tried"
    );
    let any = stand_in(&first, 1);
    let says = |ran: &Ran| -> serde_json::Value { serde_json::from_str(&ran.stdout).unwrap() };
    let unreadable = tried(&first, b"I do not know.");
    assert!(
        unreadable.code == 1 && unreadable.stdout.contains("cannot be read"),
        "{}{}",
        unreadable.stdout,
        unreadable.stderr
    );
    // The same patch of a program that is not its parent: another gate than the reader.
    let mut patch: serde_json::Value = serde_json::from_slice(&any).unwrap();
    patch["program_patch"]["parent_program_hash"] = "0".repeat(64).into();
    let stale = tried(&first, patch.to_string().as_bytes());
    assert!(stale.code == 1 && says(&stale)["says"]["gates"]["parent"].is_array(), "{}{}", stale.stdout, stale.stderr);
    // Some of the stand-in's patches do nothing in the one scene that they are tried on.
    let (mut expected, mut passing) = (vec![false, false], None);
    for draft in (1..=5).map(|seed| stand_in(&first, seed)) {
        let ran = tried(&first, &draft);
        expected.push(ran.code == 0);
        if ran.code == 0 {
            passing = Some((draft, ran));
            break;
        }
        assert!(ran.code == 1 && says(&ran)["says"]["gates"].is_object(), "{}{}", ran.stdout, ran.stderr);
    }
    let (good, passes) = passing.expect("one of five patches does something");
    let verdict = says(&passes);
    assert!(verdict["passes"] == true, "{}{}", passes.stdout, passes.stderr);
    let compiled = &verdict["says"]["probe_scenes"];
    assert!(compiled["compiled"].as_u64() > Some(0) && !passes.stdout.contains("attack"), "{verdict}");
    // The same draft again is no other try.
    assert_eq!(says(&tried(&first, &good)), verdict);
    for refused in [tried(dir.path(), &good), tried(&first.with_file_name("99.request.md"), &good), tried(&first, b"")]
    {
        assert!(refused.code == 2 && refused.stderr.contains("expected"), "{}", refused.stderr);
    }
    for (_, reply) in &questions {
        let answer = stand_in(&question(reply), 1);
        std::fs::write(reply.with_extension("part"), answer).unwrap();
        std::fs::rename(reply.with_extension("part"), reply).unwrap();
    }
    let answered = tried(&first, b"too late");
    assert!(answered.code == 2 && answered.stderr.contains("answered already"), "{}", answered.stderr);
    while waiting.0.try_wait().unwrap().is_none() {
        answer(&open(&runs));
        std::thread::sleep(Duration::from_millis(100));
    }
    assert!(waiting.0.wait().unwrap().success());
    let recorded = Cassette::load(&cassette).unwrap();
    let tries = |of: &evodrive::llm::Recorded| of.metadata.as_ref().map(|of| of.tries.clone()).unwrap_or_default();
    let of_first = recorded.exchanges().iter().map(tries).filter(|tries| !tries.is_empty()).collect::<Vec<_>>();
    assert_eq!(of_first.len(), 1, "one question was tried: {of_first:?}");
    assert_eq!(of_first[0].iter().map(|of| of.passes).collect::<Vec<_>>(), expected);
    assert_eq!(of_first[0].last().unwrap().draft, evodrive::kernel::Digest::of_bytes(&good));
    let folder = folder_below(&runs);
    assert_eq!(run(&["check", folder.to_str().unwrap()]).code, 0, "a replay needs no try");
}

#[test]
fn a_program_tries_drafts_of_its_answer_and_is_told_where_only_if_it_wants_to() {
    let dir = tempfile::tempdir().unwrap();
    let drafts = dir.path().join("drafts");
    std::fs::create_dir(&drafts).unwrap();
    // Two drafts of every question that it may try, and the second again; the second's exit code is the answer.
    let script = format!(
        "question=$(sed -n 's/.*\"question\":\"\\([^\"]*\\)\".*/\\1/p'); \
         [ -n \"$question\" ] || {{ printf nothing; exit; }}; \
         for draft in one two two; do printf $draft > '{0}'/$$; '{1}' ask \"$question\" '{0}'/$$ > /dev/null; code=$?; done; printf $code",
        drafts.display(),
        env!("CARGO_BIN_EXE_evodrive"),
    );
    let answers = |name: &str, tries: &str| {
        let command = format!(
            "[roles]\nactor = \"me\"\n[models.me]\nkind = \"command\"\nmodel = \"a-script\"\nprovenance = \"sh\"\n\
             [models.me.command]\nprogram = [\"sh\", \"-c\", {script:?}]\ntimeout_s = 60\n{tries}"
        );
        let path = small(dir.path(), name, &command);
        Ran::of(&mut record(dir.path(), &path, "2")).root();
        let recorded = Cassette::load(&dir.path().join("mine.jsonl")).unwrap();
        std::fs::remove_file(dir.path().join("mine.jsonl")).unwrap();
        let own = recorded.exchanges().iter().filter(|of| of.model.kind == "command").cloned();
        own.map(|of| (of.bytes, of.metadata.unwrap().tries)).collect::<Vec<_>>()
    };
    let tried = answers("tries", "tries = true\n");
    let two = ["one", "two"].map(|draft| evodrive::kernel::Digest::of_bytes(draft.as_bytes()));
    assert!(!tried.is_empty());
    for (bytes, tries) in &tried {
        assert_eq!(bytes, b"1", "{}", String::from_utf8_lossy(bytes));
        assert!(tries.iter().map(|of| of.draft).eq(two) && tries.iter().all(|of| !of.passes), "{tries:?}");
    }
    let plain = answers("plain", "");
    assert!(plain.iter().all(|(bytes, tries)| bytes == b"nothing" && tries.is_empty()), "{plain:?}");
}

#[test]
fn a_programs_words_are_files_beside_the_experiment_wherever_the_command_is_typed() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("mine")).unwrap();
    std::fs::write(dir.path().join("mine/ask.sh"), "printf '{\"x\": 1}'; test \"$1\" = mine/absent").unwrap();
    let command = "[roles]\nactor = \"me\"\n[models.me]\nkind = \"command\"\nmodel = \"a-script\"\nprovenance = \"sh\"\n\
         [models.me.command]\nprogram = [\"sh\", \"mine/ask.sh\", \"mine/absent\"]\ntimeout_s = 60\n";
    let path = small(dir.path(), "beside", command);
    let elsewhere = tempfile::tempdir().unwrap();
    Ran::of(record(dir.path(), &path, "1").current_dir(elsewhere.path())).root();
}

#[test]
fn what_a_provider_said_is_sealed_and_cannot_be_rewritten() {
    let dir = tempfile::tempdir().unwrap();
    let script = "printf '{\"x\": 1}'";
    let command = format!(
        "[roles]\nactor = \"me\"\n[models.me]\nkind = \"command\"\nmodel = \"a-script\"\nprovenance = \"sh\"\n\
         [models.me.command]\nprogram = [\"sh\", \"-c\", {script:?}]\ntimeout_s = 60\n"
    );
    let path = small(dir.path(), "said", &command);
    let root = Ran::of(&mut record(dir.path(), &path, "1")).root();
    let folder = folder_below(&dir.path().join("runs"));
    let attempts: Vec<_> =
        crate::harness::events(&folder).into_iter().filter(|event| event["kind"] == "attempt").collect();
    assert!(attempts[0]["body"]["proposal"]["exchanges"][0]["metadata"].is_string(), "{}", attempts[0]);
    assert_eq!(run(&["check", folder.to_str().unwrap()]).root(), root);
    let cassette = folder.join("cassette.jsonl");
    let before = std::fs::read_to_string(&cassette).unwrap();
    assert!(before.contains("\"version\":\"1.2\""), "{}", &before[..200]);
    let rewritten = |keep: bool| {
        let mut other = Cassette::new("other");
        for of in Cassette::load(&cassette).unwrap().exchanges() {
            let mut metadata = of.metadata.clone();
            if let Some(metadata) = &mut metadata {
                metadata.model = "a better one".into();
            }
            other.push_with(&of.request(), of.bytes.clone(), metadata.filter(|_| keep)).unwrap();
        }
        String::from_utf8(other.to_bytes("said").unwrap()).unwrap()
    };
    let forged = [rewritten(true), rewritten(false), before.replacen("\"version\":\"1.2\"", "\"version\":\"1.1\"", 1)];
    for text in forged {
        assert_ne!(text, before);
        std::fs::write(&cassette, &text).unwrap();
        let dir = folder.to_str().unwrap();
        let bundle = folder.with_extension("evodrive");
        let fsck = run(&["fsck", "--read", dir]);
        assert!(fsck.code == 5 && fsck.stdout.contains("the provider said"), "{} {}", fsck.code, fsck.stdout);
        for command in
            [vec!["check", dir], vec!["verify", dir], vec!["bundle", "create", dir, "--out", bundle.to_str().unwrap()]]
        {
            let ran = run(&command);
            assert!(matches!(ran.code, 4 | 5), "{command:?}: {} {}", ran.code, ran.stderr);
        }
    }
}
