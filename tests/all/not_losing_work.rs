//! Work is not lost, and failures leave nothing behind: the run folders that stay, the latest run, the effect of Ctrl-C, and
//! what is told from the start.

use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::backends::experiment;
use crate::harness::{Ran, evodrive, files, folder_below, home, run, text};

fn call(command: &str, path: &Path, out: &Path, more: &[&str]) -> Ran {
    Ran::of(
        evodrive().args([command, path.to_str().unwrap(), "--no-report", "--out", out.to_str().unwrap()]).args(more),
    )
}

fn latest(out: &Path) -> Option<String> {
    std::fs::read_to_string(out.join("LATEST")).ok()
}

/// A cassette without its last exchange: the run finds out late that an answer is missing.
fn cut(cassette: &Path, to: &Path) {
    let whole = std::fs::read_to_string(cassette).unwrap();
    let lines: Vec<&str> = whole.lines().collect();
    let last = lines.iter().rposition(|line| line.starts_with("{\"exchange\"")).unwrap();
    let kept: Vec<&str> = lines.iter().enumerate().filter(|(at, _)| *at != last).map(|(_, line)| *line).collect();
    std::fs::write(to, kept.join("\n") + "\n").unwrap();
}

#[test]
fn a_run_that_fails_leaves_no_folder_and_the_latest_run_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (experiment(folder.path(), "mine", ""), folder.path().join("out"));
    // Refused before the folder: the recording does not exist.
    let refused = call("run", &path, &out, &[]);
    assert_eq!(refused.code, 2, "{}", refused.stderr);
    assert!(!out.exists(), "nothing was begun");
    call("record", &path, &out, &[]).root();
    let (first, marked) = (folder_below(&out), latest(&out).expect("a latest run"));
    assert!(first.ends_with(&marked));
    // Found out in the middle: an answer is missing. The folder of another seed was made, and is gone again.
    let short = folder.path().join("short.jsonl");
    cut(&folder.path().join("mine.jsonl"), &short);
    let missed = call("run", &path, &out, &["--cassette", short.to_str().unwrap(), "--set", "describes=another"]);
    assert_eq!(missed.code, 3, "{}", missed.stderr);
    assert!(missed.stderr.contains("run folder: "), "the folder was there: {}", missed.stderr);
    let folders = || std::fs::read_dir(&out).unwrap().filter(|e| e.as_ref().unwrap().path().is_dir()).count();
    assert_eq!((folders(), latest(&out)), (1, Some(marked.clone())));
    // The command that is proposed is the one that was typed, and repairs it.
    let proposed = missed.stderr.split_once("to record it: ").expect("a command").1.lines().next().unwrap();
    let words = ["record", "--no-report", "--cassette", "--set", "describes=another", "short.jsonl"];
    assert!(words.iter().all(|word| proposed.contains(word)), "{proposed}");
    let repaired = Ran::of(Command::new("sh").args(["-c", proposed]).current_dir(home()));
    repaired.root();
    assert_eq!(folders(), 2);
    assert_ne!(latest(&out), Some(marked), "a run that ended well is the latest");
    // Alone in a new place it leaves nothing at all.
    let elsewhere = folder.path().join("elsewhere");
    cut(&folder.path().join("mine.jsonl"), &short);
    let missed = call("run", &path, &elsewhere, &["--cassette", short.to_str().unwrap()]);
    assert_eq!((missed.code, elsewhere.exists()), (3, false), "{}", missed.stderr);
    // A plan that cannot be made leaves nothing either; one that can is no run.
    std::fs::write(&short, "no cassette\n").unwrap();
    let plan = ["plan", path.to_str().unwrap(), "--out", elsewhere.to_str().unwrap(), "--cassette"];
    let planned = Ran::of(evodrive().args(plan).arg(&short));
    assert_eq!((planned.code, elsewhere.exists()), (5, false), "{}", planned.stderr);
}

/// The command behind these words, as it would be copied.
fn proposed<'t>(text: &'t str, words: &str) -> &'t str {
    let (_, rest) = text.split_once(words).unwrap_or_else(|| panic!("no {words:?} in {text}"));
    rest.lines().next().unwrap_or_default().trim()
}

fn typed(command: &str) -> Ran {
    Ran::of(Command::new("sh").args(["-c", command]).current_dir(home()))
}

#[test]
fn what_is_proposed_for_another_setting_works_as_typed_and_leaves_the_experiments_cassette_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (experiment(folder.path(), "mine", ""), folder.path().join("out"));
    call("record", &path, &out, &[]).root();
    let cassette = folder.path().join("mine.jsonl");
    let before = std::fs::read(&cassette).unwrap();
    for set in ["models.scripted.sampling.seed=3", "seed=5", "budget.slots=2"] {
        let missed = call("run", &path, &out, &["--set", set]);
        assert_eq!(missed.code, 3, "{set}: {}", missed.stderr);
        let plan = ["plan", path.to_str().unwrap(), "--out", out.to_str().unwrap(), "--set", set];
        let planned = run(&plan);
        let (record, next) = (proposed(&missed.stderr, "to record it: "), proposed(&planned.stdout, "next: "));
        for command in [record, next] {
            assert!(
                command.contains(" record ") && command.contains(set) && command.contains("--cassette"),
                "{command}"
            );
        }
        let recorded = typed(record);
        assert!(!recorded.stdout.contains("report: "), "none was written: {}", recorded.stdout);
        let root = recorded.root();
        assert!(std::fs::read(&cassette).unwrap() == before, "{set}: the experiment's cassette has grown");
        // From that cassette the plan is complete, and what it proposes replays.
        let own = record.rsplit_once("--cassette ").unwrap().1;
        let planned = run(&[&plan[..], &["--cassette", own]].concat());
        assert_eq!(planned.code, 0, "{}", planned.stderr);
        assert_eq!(typed(proposed(&planned.stdout, "next: ")).root(), root, "{set}");
    }
    // Who records another setting into it all the same is shown a way that loses nothing.
    let (elsewhere, set) = (folder.path().join("elsewhere"), ["--set", "seed=6"]);
    let refused = call("record", &path, &elsewhere, &set);
    assert!(refused.code == 2 && refused.stderr.contains("did not ask for"), "{}", refused.stderr);
    assert_eq!(refused.stderr.matches(" resume ").count(), 1, "one way, the one that works: {}", refused.stderr);
    let root = typed(proposed(&refused.stderr, "in a cassette of its own: ")).root();
    assert!(std::fs::read(&cassette).unwrap() == before && !root.is_empty());
    let kept = folder_below(&elsewhere);
    let none = run(&["resume", kept.to_str().unwrap(), "--cassette", "other.jsonl"]);
    assert!(none.code == 2 && none.stderr.contains("expected a recording that is not finished"), "{}", none.stderr);
}

#[test]
fn a_folder_that_was_only_planned_is_said_to_hold_no_run() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (experiment(folder.path(), "mine", ""), folder.path().join("out"));
    run(&["plan", path.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    let table = run(&["table", "metadrive-main", folder_below(&out).to_str().unwrap()]);
    assert!(table.code == 2 && table.stderr.contains("no run was carried out here yet"), "{}", table.stderr);
}

/// A model that answers so often and then gives up: a program of the kind `command`.
fn unreliable(folder: &Path) -> PathBuf {
    let counter = folder.join("asked");
    let script = format!(
        "n=$(cat {0} 2>/dev/null || echo 0); echo $((n+1)) > {0}; cat > /dev/null; [ $n -lt $(cat {0}.most) ] && echo '{{}}'",
        counter.display()
    );
    let roles = ["actor", "attack_critic", "isolation_critic", "realism_critic", "repair", "structural_critic"];
    let roles: String = roles.iter().map(|role| format!("{role} = \"mine\"\n")).collect();
    let models = format!(
        "[roles]\n{roles}[models.mine]\nkind = \"command\"\nmodel = \"a-shell\"\nprovenance = \"a shell\"\n\
         [models.mine.command]\nprogram = [\"sh\", \"-c\", {script:?}]\ntimeout_s = 20\n"
    );
    experiment(folder, "unreliable", &models)
}

#[test]
fn a_recording_that_fails_leaves_a_folder_only_if_somebody_answered() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (unreliable(folder.path()), folder.path().join("out"));
    let most = |count: &str| std::fs::write(folder.path().join("asked.most"), count).unwrap();
    most("0");
    let failed = call("record", &path, &out, &[]);
    assert_eq!((failed.code, out.exists()), (2, false), "{}", failed.stderr);
    std::fs::remove_file(folder.path().join("asked")).unwrap();
    most("1");
    let failed = call("record", &path, &out, &[]);
    let kept = folder_below(&out);
    let go_on = format!("resume {}", kept.display());
    assert!(failed.code == 2 && failed.stderr.contains(&go_on), "{}", failed.stderr);
    assert_eq!(latest(&out), None, "it did not end well");
    most("1000");
    let asked = || std::fs::read_to_string(folder.path().join("asked")).unwrap().trim().parse::<u32>().unwrap();
    let before = asked();
    run(&["resume", kept.to_str().unwrap()]).root();
    assert!(latest(&out).is_some_and(|name| kept.ends_with(name)));
    let again = asked();
    let fresh = folder.path().join("fresh");
    std::fs::write(folder.path().join("asked"), "0").unwrap();
    call("record", &path, &fresh, &["--cassette", folder.path().join("fresh.jsonl").to_str().unwrap()]).root();
    // One question was asked twice: the one that had no answer.
    assert_eq!(again - before + 1, asked(), "what was answered is not asked again");
}

/// Starts a command and waits until it says something.
fn until(command: &mut Command, word: &str) -> (Child, std::io::BufReader<std::process::ChildStderr>) {
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut stderr = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains(word) {
        line.clear();
        assert!(stderr.read_line(&mut line).unwrap() > 0, "it ended before it said {word:?}");
    }
    (child, stderr)
}

/// Ctrl-C, as a terminal sends it.
fn interrupt(child: &Child) {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
}

#[test]
fn ctrl_c_ends_a_run_cleanly_and_says_how_it_goes_on() {
    let golden: toml::Table = text("golden/quickstart.toml").parse().unwrap();
    let out = tempfile::tempdir().unwrap();
    let args = ["run", "experiments/quickstart.toml", "--no-report", "--out", out.path().to_str().unwrap()];
    let (mut child, mut stderr) = until(evodrive().args(args), "/e0 settled");
    interrupt(&child);
    let mut printed = String::new();
    std::io::Read::read_to_string(&mut stderr, &mut printed).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{printed}");
    let folder = folder_below(out.path());
    let command = format!("resume {}", folder.display());
    assert!(printed.contains("interrupted") && printed.contains(&command), "{printed}");
    assert_eq!(latest(out.path()), None, "it is not finished");
    assert!(!folder.join("result.json").exists());
    assert_eq!(run(&["fsck", "--read", folder.to_str().unwrap()]).code, 0);
    // A command that only compares does not take it for a finished one.
    assert_eq!(run(&["check", folder.to_str().unwrap()]).code, 5);
    let resumed = run(&["resume", folder.to_str().unwrap()]);
    assert_eq!((resumed.code, resumed.root().as_str()), (0, golden["root"].as_str().unwrap()), "{}", resumed.stderr);
    assert!(latest(out.path()).is_some_and(|name| folder.ends_with(name)));
}

#[test]
fn ctrl_c_ends_a_recording_that_waits_for_a_reply_and_the_question_stays() {
    let folder = tempfile::tempdir().unwrap();
    let roles = ["actor", "attack_critic", "isolation_critic", "realism_critic", "repair", "structural_critic"];
    let roles: String = roles.iter().map(|role| format!("{role} = \"me\"\n")).collect();
    let models =
        format!("[roles]\n{roles}[models.me]\nkind = \"exchange\"\nmodel = \"a-person\"\nprovenance = \"a person\"\n");
    let (path, out) = (experiment(folder.path(), "asks", &models), folder.path().join("out"));
    let args = ["record", path.to_str().unwrap(), "--no-report", "--open", "1", "--out", out.to_str().unwrap()];
    let (mut child, mut stderr) = until(evodrive().args(args), "waits for a reply");
    interrupt(&child);
    let mut printed = String::new();
    std::io::Read::read_to_string(&mut stderr, &mut printed).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{printed}");
    let run_folder = folder_below(&out);
    let question = files(&run_folder.join("exchange/me"), ".request.md");
    assert_eq!(question.len(), 1, "the question stays");
    // Somebody else begins in that folder by `resume` without a name.
    std::fs::rename(&out, folder.path().join("runs")).unwrap();
    let (mut child, _stderr) =
        until(evodrive().args(["resume", "--open", "1"]).current_dir(folder.path()), "waits for a reply");
    child.kill().unwrap();
    child.wait().unwrap();
    let moved = folder.path().join("runs").join(run_folder.file_name().unwrap());
    assert_eq!(files(&moved.join("exchange/me"), ".request.md"), question, "the same question, once");
}

/// An experiment that waits for an answer, and the folder with the file that it leaves once the answer was asked for.
struct Waits {
    folder: tempfile::TempDir,
    experiment: PathBuf,
}

/// An experiment whose `more` waits for somebody: a model or a planner.
fn waits(more: impl Fn(&Path) -> String) -> Waits {
    let folder = tempfile::tempdir().unwrap();
    let more = more(folder.path());
    let experiment = experiment(folder.path(), "waits", &more);
    Waits { folder, experiment }
}

/// Every role asks the model `mine`.
fn all_roles(model: &str) -> String {
    let roles = ["actor", "attack_critic", "isolation_critic", "realism_critic", "repair", "structural_critic"];
    let roles: String = roles.iter().map(|role| format!("{role} = \"mine\"\n")).collect();
    format!("[roles]\n{roles}[models.mine]\n{model}")
}

impl Waits {
    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Records until somebody was asked, presses Ctrl-C, and says what was told until the end.
    fn stopped(&self, asked: impl Fn() -> bool) -> String {
        let out = self.file("out");
        let args = ["record", self.experiment.to_str().unwrap(), "--no-report", "--out", out.to_str().unwrap()];
        let (mut child, mut stderr) = until(evodrive().args(args), "run folder: ");
        let come = (0..1200).any(|_| {
            std::thread::sleep(std::time::Duration::from_millis(100));
            asked()
        });
        assert!(come, "nobody was asked");
        interrupt(&child);
        let mut printed = String::new();
        std::io::Read::read_to_string(&mut stderr, &mut printed).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{printed}");
        let command = format!("resume {}", folder_below(&out).display());
        assert!(printed.contains("replies have 3 s left") && printed.contains(&command), "{printed}");
        printed
    }
}

/// A shell that leaves a file when it is asked, and another one when it answers half a minute later.
fn slow(folder: &Path) -> String {
    format!("touch {0}/asked; [ -e {0}/ready ] || {{ sleep 30; touch {0}/answered; }}", folder.display())
}

#[test]
fn ctrl_c_is_heard_while_a_program_is_asked_for_a_reply() {
    let waiting = waits(|folder| {
        let script = format!("{}; echo '{{}}'", slow(folder));
        all_roles(&format!(
            "kind = \"command\"\nmodel = \"a-shell\"\nprovenance = \"a shell\"\n[models.mine.command]\n\
             program = [\"sh\", \"-c\", {script:?}]\ntimeout_s = 600\n"
        ))
    });
    waiting.stopped(|| waiting.file("asked").exists());
    assert!(!waiting.file("answered").exists(), "it was waited for");
}

#[cfg(feature = "live")]
#[test]
#[expect(clippy::disallowed_methods, reason = "the server that is slow")]
fn ctrl_c_is_heard_while_a_server_is_asked_for_a_reply_and_the_call_counts_as_spent() {
    let server = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap();
    let waiting = waits(|_| {
        all_roles(&format!(
            "kind = \"openai_compatible\"\nmodel = \"slow\"\nresponse_format = \"json_schema\"\n[models.mine.sampling]\nmax_tokens = 10\n\
             [models.mine.client]\nbase_url = \"http://{address}/v1\"\ntimeout_s = 600\nattempts_max = 1\nwait_s_max = 1\n\
             incomplete_replies = \"keep\"\ninput_usd_per_million = 0.0\noutput_usd_per_million = 0.0\n[spend]\nusd_max = 1.0\ntokens_max = 10_000_000\n"
        ))
    });
    let (asked, answered) = (waiting.file("asked"), waiting.file("answered"));
    let (noted, late) = (asked.clone(), answered.clone());
    std::thread::spawn(move || {
        let (stream, _) = server.accept().unwrap();
        std::fs::write(noted, "").unwrap();
        std::thread::sleep(std::time::Duration::from_secs(30));
        // The folder may be gone by then.
        let _ = std::fs::write(late, "");
        drop(stream);
    });
    waiting.stopped(|| asked.exists());
    assert!(!answered.exists(), "it was waited for");
    let spend = std::fs::read_to_string(folder_below(&waiting.file("out")).join("spend.json")).unwrap();
    let page: serde_json::Value = serde_json::from_str(&spend).unwrap();
    assert!(page["models"]["mine"]["output"].as_u64() == Some(10), "an answer that is lost may be billed: {spend}");
}

/// A planner that is stopped in the middle of a rollout has not failed in its scene: nothing is recorded of that.
#[test]
fn ctrl_c_is_heard_while_a_planner_decides_and_its_scene_is_not_called_failed() {
    let waiting = waits(|folder| {
        let script = format!(
            "echo '{{\"evodrive_driver\":1}}'\nwhile read -r line; do case $line in *'\"type\":\"step\"'*)\n{}\n\
             echo '{{\"acceleration_mps2\":0,\"steering_rad\":0}}';; esac; done\n",
            slow(folder)
        );
        std::fs::write(folder.join("planner.sh"), script).unwrap();
        "[[lineage]]\nid = \"cat-mine\"\nfamily = \"cat\"\nego = \"command\"\n[driver]\ncommand = [\"sh\", \"planner.sh\"]\n\
         files = [\"planner.sh\"]\ncassette = \"planner.jsonl\"\ntimeout_s = 600\n"
            .into()
    });
    waiting.stopped(|| waiting.file("asked").exists());
    assert!(!waiting.file("answered").exists(), "it was waited for");
    std::fs::write(waiting.file("ready"), "").unwrap();
    let folder = folder_below(&waiting.file("out"));
    let resumed = run(&["resume", folder.to_str().unwrap()]);
    resumed.root();
    assert!(resumed.stderr.contains("; 0 of them failed"), "{}", resumed.stderr);
}

#[test]
fn ctrl_c_ends_a_training_at_its_checkpoint_which_it_goes_on_from() {
    let folder = tempfile::tempdir().unwrap();
    let mut table: toml::Table = text("experiments/train/sac-metadrive.toml").parse().unwrap();
    for pool in ["scenes", "validation"] {
        table[pool].as_table_mut().unwrap().insert("count".into(), 6.into());
    }
    let training = table["training"].as_table_mut().unwrap();
    for (key, value) in [("steps_before", 200), ("episodes_per_round", 2), ("evaluate_every", 20)] {
        training.insert(key.into(), value.into());
    }
    let sac = training["sac"].as_table_mut().unwrap();
    ["batch", "hidden"].into_iter().for_each(|key| drop(sac.insert(key.into(), 16.into())));
    std::fs::write(folder.path().join("small.toml"), toml::to_string(&table).unwrap()).unwrap();
    let train = ["train", "small.toml", "--out", "weights", "--checkpoints", "kept"];
    let (mut child, mut stderr) = until(evodrive().args(train).current_dir(folder.path()), "validation: ");
    interrupt(&child);
    let mut printed = String::new();
    std::io::Read::read_to_string(&mut stderr, &mut printed).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{printed}");
    let proposed = printed.split_once("to go on: ").expect("a command").1.lines().next().unwrap();
    assert!(proposed.ends_with("train small.toml --out weights --checkpoints kept --resume"), "{proposed}");
    let more = Ran::of(evodrive().args(train).args(["--resume", "--evaluations", "1"]).current_dir(folder.path()));
    assert!(more.code == 0 && more.stderr.contains("goes on after "), "{}", more.stderr);
    assert!(!folder.path().join("weights").exists(), "it is not finished");
}

#[test]
fn a_run_tells_its_epochs_share_and_folder_from_the_start_in_a_file_and_on_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (experiment(folder.path(), "mine", ""), folder.path().join("out"));
    let ran = call("record", &path, &out, &["--set", "budget.epochs=2"]);
    ran.root();
    let lines: Vec<&str> = ran.stderr.lines().collect();
    let at =
        |word: &str| lines.iter().position(|line| line.contains(word)).unwrap_or_else(|| panic!("{word}: {lines:?}"));
    let (place, first) = (at("run folder: "), at("epoch 1 of 2, 0 % of"));
    assert!(place < first && first < at("/e0s0"), "{lines:?}");
    assert!(
        lines
            .iter()
            .any(|line| line.contains("/e0 settled") && line.contains(" a second, ") || line.contains(" a minute, ")),
        "{lines:?}"
    );
    assert!(!ran.stderr.contains('\u{1b}'), "no terminal's commands in a file");
    let Ok(found) = Command::new("script").arg("--version").output() else {
        return crate::harness::skip("no `script`, which gives a command a terminal");
    };
    assert!(found.status.success());
    let again = format!(
        "{} run {} --no-report --out {} --set budget.epochs=2",
        env!("CARGO_BIN_EXE_evodrive"),
        path.display(),
        out.display()
    );
    let mut command = Command::new("script");
    command.args(["-qec", &again, "/dev/null"]).current_dir(home());
    let screen = Ran::of(command.stdin(Stdio::null()));
    assert_eq!(screen.code, 0, "{}", screen.stdout);
    let place = folder_below(&out);
    let name = place.file_name().unwrap().to_str().unwrap();
    let both = |line: &str| line.contains("epoch 1 of 2") && line.contains(name);
    assert!(screen.stdout.split(['\r', '\n']).any(both), "one line has both: {}", screen.stdout);
}
