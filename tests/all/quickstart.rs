//! The quickstart as a user runs it: one root, twice; what a missing answer, a flipped byte and a kill do.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use evodrive::epoch::Progress;
use evodrive::evidence::RecordedRun;
use evodrive::evidence::tables::{markdown, metadrive_main, plain, proposals};
use evodrive::store::read_events;

use crate::harness::{copy_dir, evodrive, files, folder_below, home, run, text};

pub fn golden_root() -> String {
    let text = text("golden/quickstart.toml");
    let golden: toml::Table = text.parse().unwrap();
    golden["root"].as_str().unwrap().to_string()
}

const QUICKSTART: &str = "experiments/quickstart.toml";

/// One finished run, shared: tests that change something copy its folder.
pub fn finished() -> &'static (tempfile::TempDir, PathBuf) {
    static RUN: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    RUN.get_or_init(|| {
        let out = tempfile::tempdir().unwrap();
        let ran = run(&["run", QUICKSTART, "--out", out.path().to_str().unwrap()]);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        assert_eq!(ran.root(), golden_root(), "if this is meant, run .ci/bless and say why");
        let folder = folder_below(out.path());
        (out, folder)
    })
}

pub fn copied(to: &Path) -> PathBuf {
    let from = &finished().1;
    let folder = to.join(from.file_name().unwrap());
    copy_dir(from, &folder);
    folder
}

#[test]
fn a_run_is_checked_from_its_folder_and_reaches_the_golden_root_again() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let again = run(&["check", folder.to_str().unwrap(), "--jobs", "1"]);
    assert_eq!((again.code, again.root()), (0, golden_root()), "{}", again.stderr);
    assert!(again.stderr.contains("rollouts: 0 simulated"), "{}", again.stderr);
}

#[test]
fn json_gives_one_object_with_root_and_result() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let ran = run(&["--json", "check", folder.to_str().unwrap()]);
    let object: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(object["root"], golden_root());
    assert!(object["result"]["lineages"].as_array().unwrap().len() >= 2);
}

#[test]
fn a_missing_answer_ends_with_its_own_exit_code_and_names_slot_role_and_nearest_exchange() {
    let dir = tempfile::tempdir().unwrap();
    let cassette = text("cassettes/quickstart.jsonl");
    let lines: Vec<&str> = cassette.lines().collect();
    let gone = lines
        .iter()
        .position(|l| l.starts_with("{\"exchange\"") && l.contains("\"attack_critic\""))
        .expect("an exchange");
    let shortened: Vec<&str> = lines.iter().enumerate().filter(|(i, _)| *i != gone).map(|(_, l)| *l).collect();
    let path = dir.path().join("short.jsonl");
    std::fs::write(&path, shortened.join("\n") + "\n").unwrap();
    let out = dir.path().join("runs");
    let ran = run(&["run", QUICKSTART, "--cassette", path.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    for word in ["attack_critic", "nearest recorded exchange", "first difference", "evodrive record"] {
        assert!(ran.stderr.contains(word), "{word:?} is not in {}", ran.stderr);
    }
}

/// Beginning of an object's record in a pack (docs/FORMAT.md), and a place behind its header.
const OBJECT: &[u8] = b"EVOBJCT1";
const IN_OBJECT: usize = 60;

#[test]
fn a_flipped_byte_of_a_stored_object_is_named_and_the_rest_stays() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let clean = run(&["fsck", "--read", folder.to_str().unwrap()]);
    assert_eq!(clean.code, 0, "{}", clean.stdout);
    let pack = std::fs::read_dir(folder.join("store"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .max_by_key(|p| std::fs::metadata(p).unwrap().len())
        .unwrap();
    let mut bytes = std::fs::read(&pack).unwrap();
    // Behind the header of the next object: where the middle falls hangs on the threads, and a header or a memo has no object's digest.
    let middle = bytes.len() / 2;
    let object = middle + bytes[middle..].windows(OBJECT.len()).position(|window| window == OBJECT).expect("an object");
    bytes[object + IN_OBJECT] ^= 0x20;
    std::fs::write(&pack, bytes).unwrap();
    let damaged = run(&["--json", "fsck", "--read", folder.to_str().unwrap()]);
    assert_eq!(damaged.code, 5, "{}", damaged.stderr);
    let object: serde_json::Value = serde_json::from_str(&damaged.stdout).unwrap();
    assert_eq!(object["clean"], false);
    assert!(object["damage"][0]["digest"].as_str().is_some_and(|d| d.len() == 64), "{object}");
}

#[test]
fn a_changed_event_of_the_transcript_is_found() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let path = folder.join("transcript.jsonl");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replacen("\"attack\":0.0", "\"attack\":1.0", 1)).unwrap();
    assert_eq!(run(&["fsck", folder.to_str().unwrap()]).code, 5);
    assert_eq!(run(&["check", folder.to_str().unwrap()]).code, 5);
}

#[test]
fn a_run_cut_off_anywhere_is_resumed_to_the_same_root() {
    for share in [0.1, 0.55, 0.9] {
        let dir = tempfile::tempdir().unwrap();
        let folder = copied(dir.path());
        let path = folder.join("transcript.jsonl");
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..(bytes.len() as f64 * share) as usize]).unwrap();
        let resumed = run(&["resume", folder.to_str().unwrap()]);
        assert_eq!((resumed.code, resumed.root()), (0, golden_root()), "{share}: {}", resumed.stderr);
    }
}

#[test]
fn a_run_that_is_killed_is_resumed_to_the_same_root() {
    let out = tempfile::tempdir().unwrap();
    let mut child = evodrive()
        .args(["run", QUICKSTART, "--out", out.path().to_str().unwrap(), "--no-report"])
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // Killed as soon as the first epoch has been settled.
    let mut stderr = std::io::BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while std::io::BufRead::read_line(&mut stderr, &mut line).unwrap() > 0 && !line.contains("/e0 settled") {}
    child.kill().unwrap();
    child.wait().unwrap();
    let folder = folder_below(out.path());
    let resumed = run(&["resume", folder.to_str().unwrap()]);
    assert_eq!((resumed.code, resumed.root()), (0, golden_root()), "{}", resumed.stderr);
}

#[test]
fn lineage_and_show_tell_of_patches_prompts_gates_and_rollouts() {
    let folder = finished().1.to_str().unwrap();
    let lineage = run(&["lineage", "cat-idm", "--run", folder]);
    assert_eq!(lineage.code, 0, "{}", lineage.stderr);
    assert!(lineage.stdout.contains("hypothesis:") && lineage.stdout.contains("@@"), "{}", lineage.stdout);
    let show = run(&["show", &an_evaluated_attempt(), "--run", folder]);
    for word in ["[system]", "[reply]", "gates:", "route:", "labels:", "hypervolume"] {
        assert!(show.stdout.contains(word), "{word:?} is not in {}", show.stdout);
    }
    let nobody = run(&["show", "cat-idm/e99s0", "--run", folder]);
    assert_eq!(nobody.code, 2);
    assert!(nobody.stderr.contains("no attempt `cat-idm/e99s0`"), "{}", nobody.stderr);
}

fn an_evaluated_attempt() -> String {
    let result = run(&["--json", "lineage", "--run", finished().1.to_str().unwrap()]);
    let object: serde_json::Value = serde_json::from_str(&result.stdout).unwrap();
    object["lineages"][0]["chain"][1]["solution_id"].as_str().unwrap().to_string()
}

#[test]
fn the_result_matches_its_golden_text() {
    let folder = &finished().1;
    let ran = run(&["check", folder.to_str().unwrap()]);
    let kept: Vec<&str> = ran
        .stdout
        .lines()
        .filter(|l| !["root: ", "run folder: ", "report: ", "why a number: "].iter().any(|p| l.starts_with(p)))
        .collect();
    let golden = text("golden/quickstart.txt");
    assert_eq!(kept.join("\n") + "\n", golden, "if this is meant, run .ci/bless and say why");
}

#[test]
fn news_of_a_refused_proposal_names_its_first_gate_with_what_it_says() {
    let events = read_events(&finished().1.join("transcript.jsonl")).unwrap();
    let run = RecordedRun::read(&events).unwrap();
    let mut refusals = 0;
    for attempt in &run.attempts {
        let Progress::Attempt { refused, .. } = Progress::attempt(attempt) else { panic!("news of an attempt") };
        let first = attempt.exit.gates().and_then(|gates| gates.failed().next());
        let first = first.map(|verdict| (verdict.gate.name(), verdict.problems[0].clone()));
        assert_eq!(refused, first, "{}", attempt.id);
        refusals += usize::from(first.is_some());
    }
    assert_eq!(refusals, 6, "as the summary counts");
}

#[test]
fn the_tables_of_a_terminal_keep_to_its_width_and_say_what_markdown_says() {
    let events = read_events(&finished().1.join("transcript.jsonl")).unwrap();
    let runs = [RecordedRun::read(&events).unwrap()];
    let words = |text: &str| text.split(|c: char| !c.is_alphanumeric()).map(String::from).collect::<BTreeSet<_>>();
    for (name, table) in [("metadrive-main", metadrive_main(&runs)), ("proposals", proposals(&runs))] {
        let table = table.unwrap();
        let shown = plain(&table, 80);
        let (columns, _) = shown.split_once("\n- ").unwrap();
        let wide: Vec<&str> = columns.lines().filter(|line| line.chars().count() > 80).collect();
        assert!(wide.is_empty(), "{name}: {wide:#?}");
        let lost: Vec<String> =
            words(&markdown(&table).replace("&lt;", "<")).difference(&words(&shown)).cloned().collect();
        assert!(lost.is_empty(), "{name}: {lost:?}");
    }
}

#[test]
fn the_report_is_one_file_that_asks_the_network_for_nothing() {
    let html = std::fs::read_to_string(finished().1.join("report.html")).unwrap();
    assert!(html.contains("default-src 'none'"));
    for word in ["src=\"http", "href=\"http", "@import", "fetch(", "XMLHttpRequest"] {
        assert!(!html.contains(word), "{word} is in the report");
    }
}

#[test]
fn the_tables_of_the_run_hold_its_result_with_intervals_and_what_is_missing() {
    let folder = finished().1.to_str().unwrap();
    let result: serde_json::Value =
        serde_json::from_slice(&std::fs::read(finished().1.join("result.json")).unwrap()).unwrap();
    let printed = run(&["--json", "table", "metadrive-policy", "--run", folder]);
    assert_eq!(printed.code, 0, "{}", printed.stderr);
    let table: serde_json::Value = serde_json::from_str(&printed.stdout).unwrap();
    let rows = table["rows"].as_array().unwrap();
    let measured: Vec<&serde_json::Value> = rows.iter().filter(|row| row["missing"] == false).collect();
    assert_eq!((rows.len(), measured.len()), (11, 4), "the recorded scenes without a program stand first");
    assert_eq!(measured[0]["method"], "Replay (no program)");
    let lineages = result["lineages"].as_array().or(result["result"]["lineages"].as_array()).unwrap();
    for row in &measured[1..] {
        let lineage = lineages.iter().find(|of| of["lineage"] == row["lineages"][0]).expect("a lineage of the run");
        assert_eq!((&row["held_out_scenes"], &row["proposals"]), (&80.into(), &"scripted".into()));
        for (role, who) in [("parent", "parent"), ("evolved", "evolved"), ("endpoint", "endpoint")] {
            if lineage[role].is_null() {
                assert!(row["values"][format!("{who}_attack")]["ours"].is_null(), "nobody was accepted: {row}");
                continue;
            }
            // R is the worse one of two means, and each has a column.
            let penalty = lineage[role]["realism_penalty_pct"].as_f64().unwrap();
            let of = |key: &str| row["values"][format!("{who}_{key}")]["ours"]["value"].as_f64();
            if let Some(successes) = of("success_rp_pct") {
                assert!((of("rp_pct").unwrap().max(successes) - penalty).abs() < 1e-9, "{row}");
            }
            let recorded = [
                (format!("{who}_attack"), lineage[role]["objectives"]["attack"].as_f64().unwrap()),
                (format!("{who}_rp_pct"), of("rp_pct").unwrap()),
            ];
            for (key, recorded) in recorded {
                let ours = &row["values"][&key]["ours"];
                assert!((ours["value"].as_f64().unwrap() - recorded).abs() < 1e-9, "{key}: {ours}, {recorded}");
                let (low, high) = (ours["interval"][0].as_f64().unwrap(), ours["interval"][1].as_f64().unwrap());
                // No success in any scene has none in any resample.
                let spreads = low < high || recorded == 0.0;
                assert!(low <= recorded + 1e-9 && recorded <= high + 1e-9 && spreads, "{key}: {ours}");
            }
        }
    }
    let rollouts: u64 = measured[1..].iter().map(|row| row["rollouts"].as_u64().unwrap()).sum();
    // A run makes some more: labels of front and parent on the scenes of all windows so far.
    assert!(rollouts > 300 && rollouts <= table["runs"][0]["rollouts"].as_u64().unwrap(), "{rollouts}");
    let main = run(&["table", "metadrive-main", "--run", folder]).stdout;
    for word in ["| CAT | IDM | 0.", "| AT | IDM | 0.", "KING with IDM", "(RL) is absent", "not a language model"] {
        assert!(main.contains(word), "{word:?} is not in {main}");
    }
    assert!(!main.contains("| KING"), "a row of the paper's without one of ours says nothing: {main}");
    assert_eq!(main, run(&["table", "metadrive-main", "--run", folder]).stdout);
    let latex = run(&["table", "metadrive-main", "--run", folder, "--format", "latex"]).stdout;
    assert!(latex.contains("\\toprule") && !latex.contains("10.66\\%"), "{latex}");
    let both = run(&["table", "metadrive-main", "--run", folder, "--format", "latex", "--paper-rows"]).stdout;
    assert!(both.contains("10.66\\%"), "{both}");
    let csv = run(&["table", "metadrive-main", "--run", folder, "--format", "csv"]).stdout;
    assert_eq!(csv.lines().count(), 1 + 4, "{csv}");
    let twice = run(&["table", "metadrive-main", "--run", folder, "--run", folder]);
    assert_eq!(twice.code, 2, "{}", twice.stdout);
    assert!(twice.stderr.contains("row CAT with ego idm"), "{}", twice.stderr);
}

#[test]
fn help_texts_are_goldens() {
    let golden = text("golden/help.txt");
    let mut text = run(&["--help"]).stdout;
    for command in [
        "init",
        "plan",
        "run",
        "resume",
        "check",
        "verify",
        "record",
        "calibrate",
        "lineage",
        "show",
        "apply",
        "leaderboard",
        "fsck",
        "report",
        "watch",
        "claims",
        "paper",
        "figure",
        "table",
        "why",
        "credit",
        "impact",
        "world",
        "compare",
        "diff",
        "data",
        "agree",
        "options",
        "families",
        "formats",
        "features",
        "completions",
        "man",
        "worker",
        "bench",
        "train",
        "downstream",
        "egos",
        "transfer",
        "harden",
        "ask",
    ] {
        text += &format!("\n---- evodrive {command} --help\n{}", run(&[command, "--help"]).stdout);
    }
    text += &format!("\n---- evodrive exchange status --help\n{}", run(&["exchange", "status", "--help"]).stdout);
    for command in ["new", "import", "edit", "set", "check", "diff", "show", "export"] {
        text += &format!("\n---- evodrive program {command} --help\n{}", run(&["program", command, "--help"]).stdout);
    }
    for command in ["freeze", "show", "run", "compare", "play"] {
        text += &format!("\n---- evodrive suite {command} --help\n{}", run(&["suite", command, "--help"]).stdout);
    }
    for command in ["plan", "work", "merge", "withdraw"] {
        text += &format!("\n---- evodrive shard {command} --help\n{}", run(&["shard", command, "--help"]).stdout);
    }
    text += &format!("\n---- evodrive policy import --help\n{}", run(&["policy", "import", "--help"]).stdout);
    for command in ["create", "inspect", "verify", "import"] {
        text += &format!("\n---- evodrive bundle {command} --help\n{}", run(&["bundle", command, "--help"]).stdout);
    }
    let scenes = [
        "import", "generate", "check", "filter", "merge", "split", "list", "show", "best", "draw", "browse", "export",
        "compare", "stats",
    ];
    for command in scenes {
        text += &format!("\n---- evodrive scenes {command} --help\n{}", run(&["scenes", command, "--help"]).stdout);
    }
    assert_eq!(text, golden, "if this is meant, run .ci/bless and say why");
}

#[test]
fn an_attempts_rollouts_are_exported_as_played_and_come_back() {
    let folder = finished().1.to_str().unwrap();
    let attempt = an_evaluated_attempt();
    for format in ["scenarionet", "commonroad"] {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().to_str().unwrap();
        let wanted = ["scenes", "export", "--run", folder, "--attempt", &attempt, "--format", format, "--out", out];
        let ran = run(&[&["--json"], &wanted[..]].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        let printed: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
        let exported: Vec<&str> =
            printed["scenes"].as_array().unwrap().iter().map(|s| s["scene"].as_str().unwrap()).collect();
        assert!(exported.len() >= 10 && exported.iter().all(|id| id.ends_with(&attempt)), "{exported:?}");
        let back = run(&["--json", "scenes", "list", out]);
        let back: serde_json::Value = serde_json::from_str(&back.stdout).unwrap();
        assert_eq!(back["left_out"], serde_json::json!([]), "{format}");
        let data_set = ["dataset_mapping.pkl", "dataset_summary.pkl"].map(|name| dir.path().join(name).exists());
        assert_eq!(data_set, [format == "scenarionet"; 2]);
        let mut read: Vec<&str> =
            back["scenes"].as_array().unwrap().iter().map(|s| s["id"].as_str().unwrap()).collect();
        read.sort_by_key(|id| exported.iter().position(|e| e == id));
        assert_eq!(read, exported, "{format}");
    }
}

#[test]
fn a_rollout_is_exported_for_players_and_drawn_with_its_logged_adversary() {
    let folder = finished().1.to_str().unwrap();
    let attempt = an_evaluated_attempt();
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let show = run(&["--json", "show", &attempt, "--run", folder]);
    let printed: serde_json::Value = serde_json::from_str(&show.stdout).unwrap();
    let labelled = printed["attempt"]["exit"]["score"]["scenes"].as_array().unwrap();
    let scene = labelled.iter().find(|s| s["acted"] == true).unwrap()["scene"].as_str().unwrap();
    let of = ["--run", folder, "--attempt", &attempt, "--scene", scene];
    let (svg, html, out) = (at("r.svg"), at("r.html"), at("out"));
    let pictures = ["--svg", svg.to_str().unwrap(), "--html", html.to_str().unwrap()];
    let drawn = run(&[&["scenes", "show"], &of[..], &pictures[..]].concat());
    assert_eq!(drawn.code, 0, "{}", drawn.stderr);
    assert!(drawn.stdout.starts_with(&format!("{attempt} in {scene}: ")), "{}", drawn.stdout);
    assert!(std::fs::read_to_string(&svg).unwrap().contains("<svg"));
    let page = std::fs::read_to_string(&html).unwrap();
    assert!(page.contains("\"role\":\"adversary\"") && page.contains(" as logged\",\"role\":\"ghost\""));
    let played = ["--format", "openscenario", "--out", out.to_str().unwrap()];
    let exported = run(&[&["scenes", "export"], &of[..], &played[..]].concat());
    assert_eq!(exported.code, 0, "{}", exported.stderr);
    let mut files: Vec<PathBuf> = std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    let scenario = std::fs::read_to_string(&files[1]).unwrap();
    let road = files[0].file_name().unwrap().to_str().unwrap();
    assert!(road.ends_with(".xodr") && scenario.contains(&format!("filepath=\"{road}\"")), "{files:?}");
}

#[test]
fn a_parents_rollouts_are_exported_too_and_with_the_egos_log_over_the_whole_horizon() {
    let folder = finished().1.to_str().unwrap();
    let dir = tempfile::tempdir().unwrap();
    let exported = |name: &str, more: &[&str]| {
        let out = dir.path().join(name);
        let what =
            ["scenes", "export", "--run", folder, "--attempt", "cat-idm/parent", "--format", "scenarionet", "--out"];
        let ran = run(&[&what[..], &[out.to_str().unwrap()], more].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        evodrive::formats::import_files(&files(&out, ".json")).scenes
    };
    let pool = evodrive::experiment::read_pool(&finished().1.join("scenes.pool")).unwrap();
    let (played, commanded) = (exported("played", &[]), exported("log", &["--ego-log"]));
    assert!(played.len() >= 10 && played.len() == commanded.len());
    let mut moved = 0;
    for scene in &commanded {
        let logged = pool.scenes.iter().find(|of| scene.id.starts_with(&format!("{} cat-idm/parent", of.id))).unwrap();
        assert_eq!((scene.steps, &scene.ego), (logged.steps, &logged.ego), "{}", scene.id);
        let others = scene.tracks.iter().filter(|track| !logged.tracks.contains(track)).count();
        assert!(others <= 1, "{}: only the adversary leaves its log", scene.id);
        moved += others;
    }
    assert!(moved > 0, "the parent acts in some scene");
    let cut = |scenes: &[evodrive::scene::Scene]| scenes.iter().map(|scene| scene.steps).min();
    assert!(cut(&played) < cut(&commanded), "a rollout ends with its contact, the log does not");
    let page = dir.path().join("page.html");
    let shown = ["scenes", "show", "--run", folder, "--attempt", "cat-idm/parent", "--ego-log", "--html"];
    let scene = ["--scene", pool.scenes.iter().find(|of| commanded[0].id.starts_with(&of.id)).unwrap().id.as_str()];
    let ran = run(&[&shown[..], &[page.to_str().unwrap()], &scene[..]].concat());
    assert!(ran.code == 0 && page.exists() && ran.stdout.contains("cat-idm/parent ego as logged"), "{}", ran.stderr);
}

#[test]
fn scenes_that_cannot_be_exported_are_bad_input_and_leave_nothing() {
    let folder = finished().1.to_str().unwrap();
    let pool = finished().1.join("scenes.pool");
    let pool = pool.to_str().unwrap();
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let to = ["--format", "commonroad", "--out", out.to_str().unwrap()];
    let attempt = an_evaluated_attempt();
    let cases: [(&[&str], &str); 6] = [
        (&[pool, "--scene", "nowhere"], "name one of the"),
        (&["--run", folder, "--attempt", "cat-idm/e99s0"], "no attempt"),
        (&["--run", folder, "--attempt", &attempt, "--scene", "nowhere"], "no scene `nowhere`"),
        (&[pool, "--attempt", &attempt], "is not a run folder: it is a file"),
        (&["--run", folder], "required"),
        (&["no/such.pool"], "no/such.pool"),
    ];
    for (what, word) in cases {
        let ran = run(&[&["scenes", "export"], what, &to[..]].concat());
        assert_eq!(ran.code, 2, "{what:?}: {}", ran.stderr);
        assert!(ran.stderr.contains(word), "{what:?}: {word:?} is not in {}", ran.stderr);
        assert!(!out.exists(), "{what:?}");
    }
}

#[test]
fn unusable_experiments_are_bad_input_with_file_place_and_remedy() {
    let dir = tempfile::tempdir().unwrap();
    let good = text(QUICKSTART);
    let no_calibration = good.replace("evodrive:recorded", "gone.toml");
    let cases = [
        ("missing field", good.replace("seed = 20261121", ""), "seed"),
        ("unknown field", good.replace("[split]", "[split]\nwidth = 3"), "width"),
        ("unknown family", good.replace("family = \"at\"", "family = \"atx\""), "did you mean `at`?"),
        ("unknown ego", good.replace("ego = \"idm\"", "ego = \"ghost\""), "ghost"),
        ("weights that do not sum", good.replace("map_validity = 0.1", "map_validity = 0.5"), "sum"),
        ("a calibration that is not there", no_calibration, "evodrive calibrate"),
        ("NaN", good.replace("ridge_lambda = 300.0", "ridge_lambda = nan"), "world.ridge_lambda"),
        ("truncated", good[..good.len() / 2].to_string(), ""),
        ("too many scenes", good.replace("held_out = 80", "held_out = 2000"), "2060"),
        ("no window", good.replace("window = 16", "window = 0"), "split.window"),
        ("no TOML", "\u{0}\u{1}[[[[".repeat(1000), ""),
    ];
    for (name, text, word) in cases {
        let path = dir.path().join("broken.toml");
        std::fs::write(&path, text).unwrap();
        let cassette = home().join("cassettes/quickstart.jsonl");
        let out = dir.path().join("runs");
        let ran = run(&[
            "run",
            path.to_str().unwrap(),
            "--cassette",
            cassette.to_str().unwrap(),
            "--out",
            out.to_str().unwrap(),
        ]);
        assert_eq!(ran.code, 2, "{name}: {}", ran.stderr);
        assert!(ran.stderr.contains(word), "{name}: {word:?} is not in {}", ran.stderr);
        assert!(!ran.stderr.contains("panicked"), "{name}: {}", ran.stderr);
    }
    assert_eq!(run(&["run", "no/such/file.toml"]).code, 2);
    assert_eq!(run(&["frobnicate"]).code, 2);
}
