//! Frozen suites: the same bytes and labels for any number of threads, planners of all kinds, thresholds, comparisons.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use serde_json::Value;

use crate::harness::{Ran, evodrive, home, run, skip};

/// A pool and a suite that the tests share.
struct Shared {
    folder: tempfile::TempDir,
}

impl Shared {
    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }
}

/// Families with samples, with reactive skills, and with inserted road users.
const PARENTS: [&str; 6] = ["--parents", "cat", "--parents", "seal", "--parents", "adv_bmt"];

fn shared() -> &'static Shared {
    static SHARED: OnceLock<Shared> = OnceLock::new();
    SHARED.get_or_init(|| {
        let shared = Shared { folder: tempfile::tempdir().unwrap() };
        let text = "base = \"evodrive:metadrive\"\nname = \"few\"\ndescribes = \"few scenes\"\ncassette = \"few.jsonl\"\n\
                    [scenes]\ncount = 14\nseed = 31\n[split]\nevolution = { count = 4 }\nheld_out = 4\nwindow = 4\n\
                    [[lineage]]\nid = \"cat-idm\"\nfamily = \"cat\"\nego = \"idm\"\n";
        std::fs::write(shared.folder.path().join("few.toml"), text).unwrap();
        let made = run(&["scenes", "generate", &shared.path("few.toml"), "--out", &shared.path("few.pool")]);
        assert_eq!(made.code, 0, "{}", made.stderr);
        let frozen = freeze(&shared, "one.suite", &["--jobs", "1"]);
        assert_eq!(frozen.code, 0, "{}", frozen.stderr);
        shared
    })
}

fn freeze(shared: &Shared, name: &str, more: &[&str]) -> Ran {
    let (pool, out) = (shared.path("few.pool"), shared.path(name));
    let wanted = ["suite", "freeze", "--scenes", &pool, "--per-family", "4", "--plain-share", "0.2", "--out", &out];
    run(&[&wanted[..], &PARENTS, more].concat())
}

fn json(ran: &Ran) -> Value {
    serde_json::from_str(&ran.stdout).unwrap_or_else(|error| panic!("{error}: {}{}", ran.stdout, ran.stderr))
}

/// `suite run` in the shared suite.
fn drive(more: &[&str]) -> Ran {
    let suite = shared().path("one.suite");
    run(&[&["--json", "suite", "run", &suite], more].concat())
}

fn python() -> bool {
    let there = Command::new("python3").arg("--version").output().is_ok_and(|ran| ran.status.success());
    if !there {
        skip("no python3: planners in suites were not driven");
    }
    there
}

/// A folder with the planners of the examples, and a planner made from the IDM by these replacements.
fn planner(name: &str, replaced: &[(&str, &str)]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(home().join("examples/own_ego/evodrive_driver.py"), folder.path().join("evodrive_driver.py"))
        .unwrap();
    let mut text = std::fs::read_to_string(home().join("examples/own_ego/idm.py")).unwrap();
    for (old, new) in replaced {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

/// Puts lines before a planner's own.
fn begun_with(path: &Path, lines: &str) {
    let text = std::fs::read_to_string(path).unwrap();
    std::fs::write(path, format!("{lines}{text}")).unwrap();
}

fn cases(of: &Value) -> Vec<&Value> {
    of["cases"].as_array().unwrap().iter().collect()
}

#[test]
fn a_suite_is_the_same_for_any_number_of_threads_and_its_labels_come_again() {
    let shared = shared();
    let bytes = |name: &str| std::fs::read(shared.path(name)).unwrap();
    // A suite is called like its file, so that another folder is needed.
    std::fs::create_dir_all(shared.folder.path().join("below")).unwrap();
    let again = freeze(shared, "below/one.suite", &["--jobs", "2"]);
    assert_eq!((again.code, bytes("below/one.suite") == bytes("one.suite")), (0, true), "{}", again.stderr);
    let shown = json(&run(&["--json", "suite", "show", &shared.path("one.suite")]));
    let count = |family: &str| cases(&shown).iter().filter(|case| case["family"] == family).count();
    assert_eq!(["cat", "seal", "adv_bmt"].map(count), [4, 4, 4]);
    assert_eq!(count("plain"), 3);
    assert!(shown["licences"][0]["terms"].as_str().unwrap().contains("MIT"), "{shown}");
    let [one, two] = ["1", "2"].map(|jobs| drive(&["--driver", "idm", "--jobs", jobs]));
    assert_eq!((one.code, &one.stdout), (0, &two.stdout), "{}", one.stderr);
    for (case, played) in cases(&shown).into_iter().zip(cases(&json(&one))) {
        let driven = &played["came"]["driven"];
        assert_eq!((&played["case"], &driven["trace"]), (&case["case"], &case["label"]["trace"]));
        assert_eq!(driven["completion"], case["label"]["route_completion"]);
    }
    // Another driver has other labels, and nothing is said against it.
    let still = drive(&["--driver", "standing"]);
    assert_eq!(still.code, 0, "{}", still.stderr);
    assert!(json(&still)["totals"][0]["completion"]["value"].as_f64().unwrap() < 0.2);
}

/// A road user that reacts to the ego reacts to the driver under test: the intervention travels, not only tracks.
#[test]
fn reactive_skills_travel_and_meet_whoever_drives() {
    let suite = evodrive::suite::decode("s", &unpacked(&shared().path("one.suite"))).unwrap().suite;
    let reacts = |case: &&evodrive::suite::Case| {
        case.intervention.actions.iter().any(|action| matches!(action, evodrive::sim::Action::FollowThenReact { .. }))
    };
    let reacting: Vec<_> = suite.cases.iter().filter(reacts).collect();
    assert!(!reacting.is_empty() && reacting.iter().all(|case| case.family == "seal"));
    let page = shared().path("play.html");
    let played = run(&[
        "suite",
        "play",
        &shared().path("one.suite"),
        "--case",
        &reacting[0].id,
        "--driver",
        "idm",
        "--driver",
        "standing",
        "--out",
        &page,
    ]);
    assert_eq!(played.code, 0, "{}", played.stderr);
    let text = std::fs::read_to_string(page).unwrap();
    assert!(text.contains("EvoPlayer.mount") && text.contains("standing: "), "both are on the page");
}

fn unpacked(path: &str) -> Vec<u8> {
    evodrive::store::read_text(Path::new(path), 1 << 30).unwrap().unwrap()
}

#[test]
fn thresholds_turn_the_exit_code_and_an_empty_selection_is_an_error() {
    let broken = drive(&["--driver", "idm", "--max-crash-rate", "0", "--min-completion", "0.1"]);
    let told = json(&broken);
    assert_eq!((broken.code, &told["holds"]), (1, &Value::Bool(false)), "{}", broken.stderr);
    let rule = &told["rules"][0];
    let scenes = rule["scenes"].as_array().unwrap();
    assert!(rule["rule"] == "max_crash_rate" && !scenes.is_empty(), "{rule}");
    let command = told["commands"][scenes[0].as_str().unwrap()].as_str().unwrap();
    assert!(command.contains("suite play") && command.contains("--driver idm"), "{command}");
    assert_eq!(told["rules"][1]["holds"], true);
    assert_eq!(drive(&["--driver", "idm", "--max-crash-rate", "1"]).code, 0);
    // Who stands still crashes seldom, and drives nowhere.
    let still = drive(&["--driver", "standing", "--max-crash-rate", "0.9", "--min-completion", "0.4"]);
    assert_eq!(still.code, 1);
    assert_eq!(json(&still)["rules"][1]["holds"], false);
    // It keeps to the road, and arrives nowhere.
    let away = drive(&["--driver", "standing", "--max-off-road", "0", "--min-arrived", "0.5"]);
    let rules = &json(&away)["rules"];
    let held: Vec<_> =
        (0..2).map(|k| (rules[k]["rule"].as_str().unwrap(), rules[k]["holds"].as_bool().unwrap())).collect();
    assert_eq!((away.code, held), (1, vec![("max_off_road", true), ("min_arrived", false)]));
    let refused = |more: &[&str], what: &str| {
        let ran = drive(more);
        assert!(ran.code == 2 && ran.stderr.contains(what), "{more:?}: {}", ran.stderr);
    };
    refused(&["--driver", "idm", "--max-crash-rate", "1.5"], "expected 0 to 1, found 1.5");
    refused(&["--driver", "idm", "--family", "catt"], "did you mean cat?");
    refused(&["--driver", "idm", "--family", "cat", "--case", "plain:nowhere"], "expected one of");
    refused(&["--driver", "idmm"], "did you mean idm?");
    // Thresholds may lie in the suite.
    let shared = shared();
    assert_eq!(freeze(shared, "strict.suite", &["--max-crash-rate", "0"]).code, 0);
    let strict = run(&["suite", "run", &shared.path("strict.suite"), "--driver", "idm"]);
    assert!(strict.code == 1 && strict.stdout.contains("BROKEN: max_crash_rate"), "{}", strict.stdout);
    let eased = run(&["suite", "run", &shared.path("strict.suite"), "--driver", "idm", "--max-crash-rate", "1"]);
    assert_eq!(eased.code, 0, "an option is above the file's: {}", eased.stdout);
}

/// The text of a file in the shared folder.
fn written(name: &str) -> String {
    std::fs::read_to_string(shared().path(name)).unwrap()
}

#[test]
fn a_failure_is_explained_wherever_it_is_told() {
    let files = ["why.xml", "why.csv", "why.html"].map(|name| shared().path(name));
    let told = drive(&["--driver", "idm", "--junit", &files[0], "--csv", &files[1], "--html", &files[2]]);
    let told = json(&told);
    let crashed: Vec<&Value> =
        cases(&told).into_iter().filter(|case| !case["came"]["driven"]["contact"].is_null()).collect();
    assert!(crashed.len() > 2, "{told}");
    for case in cases(&told) {
        let contact = &case["came"]["driven"]["contact"];
        assert_eq!(case["timeline"]["contact_s"], contact["time_s"], "{case}");
        if case["family"] == "plain" {
            assert!(case["realism"].is_null(), "{case}")
        } else {
            assert!((0.0..=1.0).contains(&case["realism"].as_f64().unwrap()), "{case}")
        }
        // A preventable contact leaves a chance as late as a careful driver's reaction.
        if contact["avoidable"] == true {
            let seen_s = case["timeline"]["visible_s"].as_f64().unwrap();
            let chances = case["timeline"]["chances"].as_array().unwrap();
            let last_s = chances.iter().filter_map(|chance| chance["last_s"].as_f64()).fold(0.0, f64::max);
            assert!(last_s >= seen_s + 1.15, "{case}");
        }
    }
    let kinds = told["failures"]["kinds"].as_array().unwrap();
    let counted: usize = kinds.iter().map(|kind| kind["cases"].as_array().unwrap().len()).sum();
    assert!(counted >= crashed.len() && kinds.len() > 1, "{}", told["failures"]);
    let [xml, csv, html] = ["why.xml", "why.csv", "why.html"].map(written);
    let within = |text: &str| text.matches(" before the contact").count();
    assert_eq!(within(&xml), crashed.len(), "{xml}");
    assert_eq!(
        csv.lines().filter(|line| line.contains(", seen") || line.contains("never seen")).count(),
        crashed.len()
    );
    assert_eq!(html.matches("<div class=\"line\"").count(), crashed.len());
    let headline = told["failures"]["headline"].as_str().unwrap();
    assert!(html.contains(headline) && headline.contains(" of one kind: "), "{headline}");
    // What is played first is the worst.
    let worst = kinds[0]["cases"][0].as_str().unwrap();
    assert!(html.contains(&format!("<b>{worst}</b> <button data-play=\"0\">")), "{worst}");
    let text = run(&["suite", "run", &shared().path("one.suite"), "--driver", "idm"]).stdout;
    assert!(text.contains(&format!("failures: {headline}")) && text.contains("worst first: "), "{text}");
}

#[test]
fn results_stand_side_by_side_with_the_scenes_that_were_lost_first() {
    let drivers = ["standing", "idm", "replay"];
    let results = drivers.map(|driver| shared().path(&format!("beside-{driver}.json")));
    for (driver, out) in drivers.iter().zip(&results) {
        assert_eq!(drive(&["--driver", driver, "--out", out]).code, 0, "{driver}");
    }
    let page = shared().path("beside.html");
    let suite = shared().path("one.suite");
    let wanted = ["suite", "compare", &results[0], &results[1], &results[2], "--suite", &suite, "--html", &page];
    let text = run(&wanted);
    assert_eq!(text.code, 0, "{}", text.stderr);
    let told = json(&run(&[&["--json"], &wanted[..]].concat()));
    let scenes = told["scenes"].as_array().unwrap();
    let changes: Vec<&str> = scenes.iter().map(|of| of["change"].as_str().unwrap()).collect();
    let lost = changes.iter().filter(|change| **change == "lost").count();
    assert!(scenes.len() == 15 && lost > 0 && changes[..lost].iter().all(|change| *change == "lost"), "{changes:?}");
    assert_eq!(told["compared"].as_array().unwrap().len(), 2, "each against the first");
    let html = written("beside.html");
    let mut at = 0;
    for scene in scenes {
        let name = format!("<b>{}</b>", scene["case"].as_str().unwrap());
        let next = html.find(&name).unwrap_or_else(|| panic!("{name}"));
        assert!(next > at, "{name} comes too early");
        at = next;
    }
    assert!(drivers.iter().all(|driver| html.contains(&format!("] {driver} ("))) && !html.contains("://"));
    assert!(
        text.stdout.contains("lost: the first passes, the last fails") && text.stdout.contains("[3] "),
        "{}",
        text.stdout
    );
    let one = run(&["suite", "compare", &results[0]]);
    assert!(one.code == 2 && one.stderr.contains("2 values required"), "{}", one.stderr);
    let other = run(&["suite", "compare", &results[0], &results[1], "--html", &shared().path("beside.pdf")]);
    assert!(other.code == 2 && other.stderr.contains("expected a name that ends in .html"), "{}", other.stderr);
}

#[test]
fn a_floor_of_realism_leaves_out_what_is_below_it_and_is_no_part_of_a_suite_without_one() {
    let least = |suite: &str| {
        let told = json(&run(&["--json", "suite", "run", suite, "--driver", "idm"]));
        cases(&told).into_iter().filter_map(|case| case["realism"].as_f64()).fold(f64::INFINITY, f64::min)
    };
    let shared = shared();
    assert!(least(&shared.path("one.suite")) < 0.9);
    let floored = freeze(shared, "floor.suite", &["--min-realism", "0.9"]);
    assert_eq!(floored.code, 0, "{}", floored.stderr);
    assert!(floored.stderr.contains("less realistic than --min-realism"), "{}", floored.stderr);
    assert!(least(&shared.path("floor.suite")) >= 0.9);
    let head = |name: &str| String::from_utf8_lossy(&unpacked(&shared.path(name))).contains("min_realism");
    assert_eq!([head("one.suite"), head("floor.suite")], [false, true]);
    let refused = freeze(shared, "no.suite", &["--min-realism", "90"]);
    assert!(
        refused.code == 2 && refused.stderr.contains("--min-realism: expected 0 to 1, found 90"),
        "{}",
        refused.stderr
    );
}

/// The cards of a page of scenes.
fn cards(page: &str) -> Vec<Value> {
    let (_, rest) = page.split_once("id=\"scenes\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn scenes_are_browsed_by_name_place_and_contact_and_a_page_of_many_stays_small() {
    let (pool, suite) = (shared().path("few.pool"), shared().path("one.suite"));
    let browse = |of: &str, name: &str, more: &[&str]| {
        let page = shared().path(name);
        let ran = run(&[&["--json", "scenes", "browse", of, "--html", &page], more].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        (json(&ran), written(name))
    };
    let (told, page) = browse(&pool, "pool.html", &[]);
    let all = cards(&page);
    assert_eq!((&told["scenes"], &told["shown"], all.len()), (&14.into(), &14.into(), 14));
    let names: std::collections::BTreeSet<&str> = all.iter().map(|card| card["name"].as_str().unwrap()).collect();
    assert!(names.len() == 14 && names.iter().all(|name| name.contains(' ')), "{names:?}");
    let listed = json(&run(&["--json", "scenes", "list", &pool]));
    for (card, row) in all.iter().zip(listed["scenes"].as_array().unwrap()) {
        assert_eq!((&card["id"], &card["users"]), (&row["id"], &row["tracks"]));
        let plan = &card["plan"];
        let drawn = |field: &str| plan[field].as_array().unwrap().len();
        assert!(drawn("lanes") > 0 && drawn("ego") >= 4 && serde_json::to_string(card).unwrap().len() < 6000, "{card}");
    }
    assert!(
        !page.contains("http://") && !page.contains("https://") && !page.contains(" src="),
        "it is whole by itself"
    );
    let (told, page) = browse(&pool, "three.html", &["--most", "3"]);
    assert_eq!((&told["shown"], cards(&page).len()), (&3.into(), 3));
    assert!(page.contains("3 of 14 scenes") && page.contains("11 are not on this page"), "what is left out is said");
    let (_, page) = browse(&suite, "suite.html", &[]);
    let shown = json(&run(&["--json", "suite", "show", &suite]));
    for (card, case) in cards(&page).iter().zip(cases(&shown)) {
        assert_eq!((&card["id"], &card["source"]), (&case["case"], &case["family"]));
        let class = evodrive::sim::timeline_text::class_in_words(case["class"].as_str().unwrap());
        assert_eq!(card["class"].as_str().unwrap(), class);
        assert!(card["command"].as_str().unwrap().contains("scenes show"), "{card}");
    }
}

#[test]
fn two_versions_of_a_planner_are_told_apart_and_recorded_answers_need_no_python() {
    if !python() {
        return;
    }
    let (before, old) = planner("planner.py", &[]);
    let (after, new) = planner("planner.py", &[("x > 0.0 and", "x > 25.0 and")]);
    let out = |folder: &tempfile::TempDir, name: &str| folder.path().join(name).display().to_string();
    let results = [out(&before, "old.json"), out(&after, "new.json")];
    let [old_word, new_word] = [&old, &new].map(|path| path.display().to_string());
    let first = drive(&["--driver", &old_word, "--out", &results[0]]);
    assert_eq!(first.code, 0, "{}", first.stderr);
    let (junit, csv, html) = (out(&after, "results.xml"), out(&after, "results.csv"), out(&after, "results.html"));
    let second = drive(&[
        "--driver",
        &new_word,
        "--out",
        &results[1],
        "--no-new-failures-against",
        &results[0],
        "--junit",
        &junit,
        "--csv",
        &csv,
        "--html",
        &html,
    ]);
    assert_eq!(second.code, 1, "{}{}", second.stdout, second.stderr);
    let told = json(&second);
    let rule = told["rules"].as_array().unwrap().iter().find(|rule| rule["rule"] == "no_new_failures").unwrap();
    let new_failures: Vec<&str> =
        rule["scenes"].as_array().unwrap().iter().map(|scene| scene.as_str().unwrap()).collect();
    assert!(!new_failures.is_empty());
    let compared = json(&run(&["--json", "suite", "compare", &results[0], &results[1]]));
    let discordant = compared["compared"]["discordant"].as_array().unwrap();
    let lost: Vec<&str> =
        discordant.iter().filter(|of| of["lost"] == true).map(|of| of["case"].as_str().unwrap()).collect();
    assert_eq!(lost, new_failures, "{compared}");
    assert!(compared["commands"][0].as_str().unwrap().contains("--recorded"), "{compared}");
    let xml = std::fs::read_to_string(&junit).unwrap();
    assert!(xml.contains("<failure type=\"no_new_failures\"") && xml.matches("<testcase ").count() == 16, "{xml}");
    assert_eq!(std::fs::read_to_string(&csv).unwrap().lines().count(), 16);
    assert!(std::fs::read_to_string(&html).unwrap().contains("EvoPlayer.mount"));
    let same = run(&["suite", "compare", &results[0], &results[0]]);
    assert!(same.stdout.contains("no difference in 15 scenes"), "{}", same.stdout);
    // Neither the planner nor Python is there any more.
    std::fs::remove_file(&new).unwrap();
    let suite = shared().path("one.suite");
    let alone = |more: &[&str]| {
        let wanted = [&["--json", "suite", "run", &suite, "--recorded", &results[1]], more].concat();
        Ran::of(evodrive().env("PATH", "").args(wanted))
    };
    for jobs in ["1", "2"] {
        let again = alone(&["--jobs", jobs]);
        assert_eq!((again.code, &json(&again)["cases"]), (0, &told["cases"]), "{}", again.stderr);
    }
    let played = Ran::of(evodrive().env("PATH", "").args([
        "suite",
        "play",
        &suite,
        "--case",
        lost[0],
        "--recorded",
        &results[0],
        "--recorded",
        &results[1],
        "--out",
        &out(&after, "p.html"),
    ]));
    assert_eq!(played.code, 0, "{}", played.stderr);
    // The same drive as a film, a strip and files for other programs, by the case and the result.
    let without = |words: &[&str]| Ran::of(evodrive().env("PATH", "").args(words));
    let film = out(&after, "p.gif");
    let play = |to: &str, more: &[&str]| {
        without(&[&["suite", "play", &suite, "--case", lost[0], "--recorded", &results[1], "--out", to], more].concat())
    };
    assert_eq!(play(&film, &[]).code, 0, "{}", play(&film, &["--overwrite"]).stderr);
    assert!(std::fs::read(&film).unwrap().starts_with(b"GIF89a"));
    let [other, both] = [play(&out(&after, "p.png"), &[]), play(&film, &["--recorded", &results[0], "--overwrite"])];
    assert!(
        other.code == 2 && other.stderr.contains("expected a name that ends in .html or .gif or .mp4"),
        "{}",
        other.stderr
    );
    assert!(both.code == 2 && both.stderr.contains("expected one driver for a film, found 2"), "{}", both.stderr);
    assert!(!after.path().join("p.png").exists());
    let strips = [0, 1].map(|at| {
        let to = out(&after, &format!("strip-{at}.svg"));
        let drawn = without(&["scenes", "draw", &suite, "--scene", lost[0], "--recorded", &results[at], "--out", &to]);
        assert_eq!(drawn.code, 0, "{}", drawn.stderr);
        drawn.stdout.lines().next().unwrap().to_string()
    });
    assert!(strips[1].contains("contact") && !strips[0].contains("contact with"), "{strips:?}");
    let folder = out(&after, "files");
    let export = [
        "scenes",
        "export",
        &suite,
        "--scene",
        lost[0],
        "--recorded",
        &results[1],
        "--format",
        "scenarionet",
        "--out",
        &folder,
    ];
    assert_eq!(without(&export).code, 0, "{}", without(&export).stderr);
    let pool = without(&["scenes", "draw", &results[1], "--recorded", &results[1], "--out", &out(&after, "no.svg")]);
    assert!(pool.code == 2 && pool.stderr.contains("expected the suite that this result is of"), "{}", pool.stderr);
    let board = Ran::of(evodrive().env("PATH", "").args([
        "leaderboard",
        &suite,
        "--recorded",
        &results[0],
        "--driver",
        "standing",
        "--driver",
        "idm",
        "--format",
        "markdown",
    ]));
    assert_eq!(board.code, 0, "{}", board.stderr);
    let rows: Vec<&str> = board.stdout.lines().filter(|line| line.starts_with("| ")).collect();
    assert!(rows[3].starts_with("| standing | 15 | 0 | 0.000"), "who stands still comes last: {}", board.stdout);
    // A changed result is not what its answers come to.
    let text = std::fs::read_to_string(&results[1]).unwrap();
    std::fs::write(&results[1], text.replacen("\"completion\":0.", "\"completion\":0.9", 1)).unwrap();
    let changed = alone(&[]);
    let both = ["recorded answers come to", "changed after it was written"];
    assert!(changed.code == 4 && both.iter().all(|said| changed.stderr.contains(said)), "{}", changed.stderr);
}

#[test]
fn a_planner_that_gives_no_drive_is_named_and_counted_apart_and_never_passes() {
    if !python() {
        return;
    }
    let decide = "    def decide(self, scene, step):\n";
    let with = |line: &str| format!("{decide}        {line}\n");
    let shown = json(&run(&["--json", "suite", "show", &shared().path("one.suite")]));
    let scene = &cases(&shown).into_iter().find(|case| case["family"] == "cat").unwrap()["scene"];
    let scene = scene.as_str().unwrap();
    let here = format!("if scene['scene'] == {scene:?} and step['step'] == 3:");
    let kinds = [
        ("ended", with(&format!("{here} sys.exit('no more')")), 10.0),
        ("junk", with(&format!("{here} sys.__stdout__.write('hello\\n'); sys.__stdout__.flush()")), 10.0),
        ("too_slow", with(&format!("{here} time.sleep(30)")), 0.5),
        ("inconsistent", with(&format!("{here} return random.random(), 0.0")), 10.0),
        ("abandoned", with(&format!("{here} import evodrive_driver; raise evodrive_driver.Abandon('no-lane')")), 10.0),
    ];
    for (kind, line, seconds) in kinds {
        // Who is told more is replayed without the planner, too.
        let more = if kind == "abandoned" { "observe = \"metadrive-1\"\nblind = false\n" } else { "" };
        let (folder, path) = planner("planner.py", &[(decide, &line)]);
        begun_with(&path, "import random, sys, time\n");
        let table = format!(
            "[driver]\ncommand = [\"python3\", \"planner.py\"]\nfiles = [\"planner.py\", \"evodrive_driver.py\"]\ncassette = \"x\"\n\
             timeout_s = {seconds}\nrepeat_share = 1.0\n{more}"
        );
        std::fs::write(folder.path().join("planner.toml"), table).unwrap();
        let word = folder.path().join("planner.toml").display().to_string();
        let xml = folder.path().join("r.xml").display().to_string();
        let out = folder.path().join("r.json").display().to_string();
        let selected = ["--family", "cat", "--family", "plain", "--max-crash-rate", "1"];
        let ran = drive(&[&["--driver", &word, "--junit", &xml, "--out", &out], &selected[..]].concat());
        let told = json(&ran);
        // What was recorded says the same without the planner.
        let again = drive(&["--recorded", &out, "--max-crash-rate", "1"]);
        assert_eq!((again.code, &json(&again)["cases"]), (1, &told["cases"]), "{kind}: {}", again.stderr);
        assert_eq!(ran.code, 1, "{kind}: {}", ran.stderr);
        let faults: Vec<&Value> = cases(&told).into_iter().filter(|case| case["came"]["fault"].is_object()).collect();
        assert!(!faults.is_empty(), "{kind}: {told}");
        for fault in &faults {
            assert_eq!((&fault["came"]["fault"]["kind"], &fault["scene"]), (&kind.into(), &scene.into()), "{fault}");
        }
        let all = &told["totals"][0];
        assert_eq!(all["faults"], faults.len());
        assert_eq!(all["driven"].as_u64().unwrap() + faults.len() as u64, all["scenes"].as_u64().unwrap(), "{all}");
        let rule = &told["rules"][0];
        assert!(rule["rule"] == "answered" && rule["holds"] == false, "{rule}");
        assert_eq!(std::fs::read_to_string(xml).unwrap().matches("<error type=").count(), faults.len());
    }
    // One that does not begin drives nowhere, and passes nowhere.
    let (folder, path) = planner("planner.py", &[]);
    // Another driver's result is refused before anything is driven.
    let taken = folder.path().join("taken.json").display().to_string();
    assert_eq!(drive(&["--driver", "idm", "--out", &taken]).code, 0);
    let refused = drive(&["--driver", &path.display().to_string(), "--out", &taken]);
    assert!(refused.code == 2 && refused.stderr.contains("--overwrite"), "{}", refused.stderr);
    begun_with(&path, "raise SystemExit('broken')\n");
    let ran = drive(&["--driver", &path.display().to_string(), "--family", "plain", "--max-crash-rate", "1"]);
    let told = json(&ran);
    assert_eq!((ran.code, &told["totals"][0]["driven"]), (1, &Value::from(0)), "{}", ran.stderr);
    assert!(cases(&told).iter().all(|case| case["came"]["fault"]["kind"] == "not_started"), "{told}");
}

#[test]
fn what_is_no_suite_or_no_result_of_it_is_refused_by_name() {
    let shared = shared();
    let suite = shared.path("one.suite");
    let refused = |args: &[&str], code: i32, what: &str| {
        let ran = run(args);
        assert!(ran.code == code && ran.stderr.contains(what), "{args:?}: {} {}", ran.code, ran.stderr);
    };
    refused(&["suite", "run", &shared.path("few.pool"), "--driver", "idm"], 2, "is not a suite");
    let mut bytes = unpacked(&suite);
    let end = bytes.len() - 32;
    bytes[8] = 7;
    let digest = evodrive::kernel::Digest::of_bytes(&bytes[..end]);
    bytes[end..].copy_from_slice(digest.as_bytes());
    std::fs::write(shared.path("later.suite"), &bytes).unwrap();
    refused(
        &["suite", "run", &shared.path("later.suite"), "--driver", "idm"],
        2,
        "suite format 7, this build reads format 1",
    );
    bytes[100] ^= 1;
    std::fs::write(shared.path("damaged.suite"), &bytes).unwrap();
    refused(&["suite", "show", &shared.path("damaged.suite")], 2, "suite format 7");
    let mut bytes = unpacked(&suite);
    bytes[100] ^= 1;
    std::fs::write(shared.path("damaged.suite"), &bytes).unwrap();
    refused(&["suite", "show", &shared.path("damaged.suite")], 5, "the checksum");
    refused(&["suite", "freeze", "--scenes", &shared.path("few.pool"), "--out", "x.suite"], 2, "name programs");
    refused(&["suite", "compare", &suite, &suite], 2, "expected a result of a suite");
    let own = shared.path("idm.json");
    assert_eq!(drive(&["--driver", "idm", "--out", &own]).code, 0);
    refused(&["suite", "run", &suite, "--recorded", &own], 3, "no recorded answers");
    // A label that does not come again.
    let mut suite_of = evodrive::suite::decode("s", &unpacked(&suite)).unwrap().suite;
    suite_of.cases[0].label.route_completion *= 0.5;
    std::fs::write(shared.path("changed.suite"), evodrive::suite::encode(&suite_of).unwrap().0).unwrap();
    refused(&["suite", "run", &shared.path("changed.suite"), "--driver", "idm"], 4, "expected the frozen label");
    suite_of.simulator += 1;
    std::fs::write(shared.path("newer.suite"), evodrive::suite::encode(&suite_of).unwrap().0).unwrap();
    refused(&["suite", "run", &shared.path("newer.suite"), "--driver", "idm"], 2, "simulator version 4");
    // Another suite's result is neither a baseline nor to be compared.
    assert_eq!(freeze(shared, "other.suite", &["--seed", "2"]).code, 0);
    let other = shared.path("other.json");
    assert_eq!(run(&["suite", "run", &shared.path("other.suite"), "--driver", "idm", "--out", &other]).code, 0);
    refused(&["suite", "run", &suite, "--driver", "idm", "--no-new-failures-against", &other], 2, "another suite");
    refused(&["suite", "compare", &own, &other], 2, "only the same scenes");
}

#[test]
fn scenes_of_a_suite_are_listed_shown_and_exported() {
    let suite = shared().path("one.suite");
    let listed = json(&run(&["--json", "scenes", "list", &suite]));
    let shown = json(&run(&["--json", "suite", "show", &suite]));
    let (case, scene) = (&cases(&shown)[0]["case"], &cases(&shown)[0]["scene"]);
    assert!(listed["scenes"].as_array().unwrap().iter().any(|row| row["id"] == *scene), "{listed}");
    let one = json(&run(&["--json", "scenes", "show", &suite, case.as_str().unwrap()]));
    assert_eq!(one["outcome"], cases(&shown)[0]["label"], "as frozen");
    let plain = json(&run(&["--json", "scenes", "show", &suite, scene.as_str().unwrap()]));
    assert_eq!(plain["scene"]["id"], *scene);
    let out = shared().path("exported");
    let exported = json(&run(&[
        "--json",
        "scenes",
        "export",
        &suite,
        "--scene",
        case.as_str().unwrap(),
        "--format",
        "scenarionet",
        "--out",
        &out,
    ]));
    assert_eq!(exported["scenes"].as_array().unwrap().len(), 1, "{exported}");
}

/// 21 of 31 crossings of the shipped suite are staged for SafeBench, where no planner plays: such a pair had 69 and 68 crashes there.
#[test]
fn a_planner_that_ignores_crossing_traffic_is_told_apart_from_its_mend_by_a_suite_of_crossings() {
    if !python() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let text = "base = \"evodrive:metadrive\"\nname = \"many\"\ndescribes = \"many scenes\"\ncassette = \"many.jsonl\"\n\
                [scenes]\ncount = 240\nseed = 20261126\n[scenes.options]\ntracks_per_scene = 10\nattempts_max = 400\n\
                [split]\nevolution = { count = 30 }\nheld_out = 30\n\
                [[lineage]]\nid = \"cat-idm\"\nfamily = \"cat\"\nego = \"idm\"\n";
    std::fs::write(at("many.toml"), text).unwrap();
    let done = |args: &[&str]| {
        let ran = run(args);
        assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
        ran
    };
    done(&["scenes", "generate", &at("many.toml"), "--out", &at("many.pool")]);
    let (pool, suite) = (at("many.pool"), at("crossings.suite"));
    let wanted = ["--class", "crossing", "--per-family", "20", "--plain-share", "0.1"];
    done(&[&["suite", "freeze", "--scenes", &pool, "--out", &suite][..], &CROSSING_PARENTS[..], &wanted[..]].concat());
    // The mend brakes for whoever keeps course and speed into its way.
    let returns = "        return self.accelerate";
    let mend = format!("{MEND}{returns}");
    let results = [("ignoring", None), ("mended", Some((returns, mend.as_str())))].map(|(name, replaced)| {
        let (_folder, path) = planner(&format!("{name}.py"), replaced.as_slice());
        let out = at(&format!("{name}.json"));
        done(&["suite", "run", &suite, "--driver", path.to_str().unwrap(), "--out", &out]);
        out
    });
    let compared = json(&done(&["--json", "suite", "compare", &results[0], &results[1]]));
    let all = &compared["compared"]["rows"][0];
    let (ignoring, mended) = (all["first_crashes"].as_u64().unwrap(), all["second_crashes"].as_u64().unwrap());
    assert!(all["chance"].as_f64().unwrap() < 0.05 && mended < ignoring, "{all}");
    // Every case is playable, and each reading is said of both.
    let made: Value = json(&done(&["--json", "suite", "show", &suite]));
    let classes: Vec<&str> = cases(&made).iter().map(|case| case["class"].as_str().unwrap()).collect();
    assert!(classes.iter().filter(|class| **class == "crossing").count() >= 20, "{classes:?}");
    assert_eq!(all["scenes"].as_u64().unwrap() as usize, classes.len());
    assert!(all["at_fault"].as_array().unwrap().iter().all(Value::is_u64), "{all}");
    let same = json(&done(&["--json", "suite", "compare", &results[0], &results[0]]));
    assert_eq!(same["compared"]["rows"][0]["chance"], 1.0);
}

/// Families that bring crossings about in traffic that is not staged.
const CROSSING_PARENTS: [&str; 8] =
    ["--parents", "cat", "--parents", "adv_bmt", "--parents", "llm_attacker", "--parents", "seal"];

/// Lines that mend the example of an IDM, which ignores crossing traffic: where it and another would be at one time, if both went on.
const MEND: &str = r#"        for other in step["neighbours"]:
            for t in (0.4, 0.8, 1.2, 1.6, 2.0):
                place = [p + t * u for p, u in zip(other["position"], other["velocity"])]
                x, y = local(step, place)
                if local(step, other["position"])[0] > 0.0 and abs(x - v * t) < 6.0 and abs(y) < 2.5:
                    return -8.0, pursuit(scene, step, max(4.0, 0.6 * v))
"#;

#[test]
fn the_shipped_suite_holds_every_family_and_its_leaderboard_is_the_golden_one() {
    let suite = "golden/suite/starter.suite";
    let own = json(&run(&["--json", "suite", "run", suite, "--driver", "idm"]));
    let rows = |by: &str| own["totals"].as_array().unwrap().iter().filter(|row| row["by"] == by).count();
    assert_eq!((cases(&own).len(), rows("family"), rows("class")), (200, 13, 7), "every label came again");
    let drivers = ["--driver", "idm", "--driver", "replay", "--driver", "standing"];
    let policies =
        ["--policy", "policies/sac-metadrive.safetensors", "--policy", "policies/sac-metadrive-2.safetensors"];
    let board = run(&[&["leaderboard", suite, "--format", "markdown"], &drivers[..], &policies[..]].concat());
    let golden = crate::harness::text("golden/suite/leaderboard.md");
    assert_eq!(board.stdout, golden, "if this is meant, run .ci/suite --bless and say why");
    let page = crate::harness::text("docs/SUITES.md");
    for row in golden.lines().filter(|line| line.starts_with("| ")).skip(1).take(5) {
        let cells: Vec<&str> = row.trim_matches('|').split(" | ").map(str::trim).collect();
        let told = [cells[0].trim_end_matches(".safetensors"), cells[3], cells[4], cells[8]].join(" | ");
        assert!(page.contains(&told), "docs/SUITES.md does not say {told}");
    }
}

/// The answers of a planner lie beside a result, under names that nobody has typed.
#[test]
fn a_folder_or_file_of_somebodys_beside_a_result_stays() {
    if !python() {
        return;
    }
    let (folder, path) = planner("planner.py", &[]);
    let (at, suite) = (|name: &str| folder.path().join(name), shared().path("one.suite"));
    let theirs = |name: &str| {
        std::fs::create_dir_all(at(name).parent().unwrap()).unwrap();
        std::fs::write(at(name), "weeks of sensor logs").unwrap();
    };
    let stays = |name: &str| std::fs::read_to_string(at(name)).is_ok_and(|text| text == "weeks of sensor logs");
    let drive = |driver: &str, more: &[&str]| {
        let mut command = evodrive();
        command.args(["suite", "run", &suite, "--family", "cat", "--driver", driver, "--out"]).arg(at("new.json"));
        Ran::of(command.args(more))
    };
    let planner = path.to_str().unwrap();
    theirs("new.recording/raw/log.bin");
    for more in [&[][..], &["--overwrite"]] {
        let refused = drive(planner, more);
        assert!(refused.code == 2 && refused.stderr.contains("without this program's mark"), "{}", refused.stderr);
        let own = drive("standing", more);
        assert_eq!(own.code, 0, "{}", own.stderr);
        assert!(stays("new.recording/raw/log.bin") && at("new.json").exists());
        assert_eq!(std::fs::read_dir(at("new.recording")).unwrap().count(), 1, "nothing was put into it");
    }
    let leader = |more: &[&str]| {
        let mut command = evodrive();
        command.args(["leaderboard", &suite, "--family", "cat", "--driver", "standing", "--kept"]).arg(at("kept"));
        Ran::of(command.args(more))
    };
    assert_eq!(leader(&[]).code, 0);
    let kept = std::fs::read_dir(at("kept")).unwrap().next().unwrap().unwrap().path();
    let recording = format!("kept/{}.recording/log", kept.file_stem().unwrap().to_string_lossy());
    theirs(&recording);
    assert_eq!(leader(&[]).code, 0);
    assert!(stays(&recording));
    // A planner's recording that was begun for something else, and answers of another planner.
    std::fs::remove_dir_all(at("new.recording")).unwrap();
    std::fs::create_dir(at("new.recording")).unwrap();
    std::fs::write(at("new.recording/.evodrive-own"), "evodrive-folder/1 another\n").unwrap();
    let refused = drive(planner, &["--overwrite"]);
    assert!(refused.code == 2 && refused.stderr.contains("for something else"), "{}", refused.stderr);
    std::fs::remove_dir_all(at("new.recording")).unwrap();
    let driven = drive(planner, &["--overwrite"]);
    assert_eq!(driven.code, 0, "{}", driven.stderr);
    assert!(at("new.rollouts.jsonl.zst").exists() && !at("new.recording").exists());
    let answers = std::fs::read(at("new.rollouts.jsonl.zst")).unwrap();
    std::fs::remove_file(at("new.json")).unwrap();
    begun_with(&path, "# another planner\n");
    let refused = drive(planner, &["--overwrite"]);
    assert!(refused.code == 2 && refused.stderr.contains("new.rollouts.jsonl.zst: expected"), "{}", refused.stderr);
    assert_eq!(std::fs::read(at("new.rollouts.jsonl.zst")).unwrap(), answers);
}

#[test]
fn a_killed_command_goes_on_where_it_was() {
    if !python() {
        return;
    }
    let decide = "    def decide(self, scene, step):\n";
    // The fourth drive waits until somebody says that it may go on.
    let waits = "        if step['step'] == 0:\n            open('log', 'a').write(scene['scene'] + '\\n')\n        \
                 if len(open('log').readlines()) == 4 and not os.path.exists('ready'):\n            open('begun', 'w').close()\n        \
                 while os.path.exists('begun') and not os.path.exists('ready'):\n            time.sleep(0.02)\n";
    let (folder, path) = planner("planner.py", &[(decide, &format!("{decide}{waits}"))]);
    begun_with(&path, "import os, time\n");
    let at = |name: &str| folder.path().join(name);
    let table = "[driver]\ncommand = [\"python3\", \"planner.py\"]\nfiles = [\"planner.py\"]\ncassette = \"x\"\nrepeat_share = 0.0\n";
    std::fs::write(at("planner.toml"), table).unwrap();
    let suite = shared().path("one.suite");
    let command = || {
        let mut command = evodrive();
        command.args(["suite", "run", &suite, "--jobs", "1", "--driver"]).arg(at("planner.toml"));
        command.arg("--out").arg(at("result.json"));
        command
    };
    let quiet = std::process::Stdio::null;
    let mut child = command().stdout(quiet()).stderr(quiet()).spawn().unwrap();
    while !at("begun").exists() {
        assert_eq!(child.try_wait().unwrap(), None, "it ended before it was killed");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!at("result.json").exists() && at("result.recording").exists());
    std::fs::write(at("ready"), "").unwrap();
    std::fs::write(at("log"), "").unwrap();
    let ran = Ran::of(&mut command());
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert_eq!(std::fs::read_to_string(at("log")).unwrap().lines().count(), 15 - 3, "three drives were kept");
    assert!(at("result.json").exists() && !at("result.recording").exists());
    // All is recorded: nobody is asked again.
    assert_eq!(Ran::of(&mut command()).code, 0);
    assert_eq!(std::fs::read_to_string(at("log")).unwrap().lines().count(), 15 - 3);
}

/// A planner's result in seven cases of the shared suite, and where it lies.
struct Planned {
    folder: tempfile::TempDir,
    result: evodrive::suite::SuiteResult,
    answers: evodrive::backend::RolloutCassette,
}

fn planned(replaced: &[(&str, &str)]) -> Planned {
    let (folder, path) = planner("planner.py", replaced);
    let out = folder.path().join("r.json");
    let word = path.display().to_string();
    let ran = drive(&["--driver", &word, "--family", "cat", "--family", "plain", "--out", &out.display().to_string()]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let result = evodrive::suite::result_from_bytes("r", &std::fs::read(&out).unwrap()).unwrap();
    let answers = evodrive::backend::RolloutCassette::load(&folder.path().join("r.rollouts.jsonl.zst")).unwrap();
    Planned { folder, result, answers }
}

impl Planned {
    /// Writes a forged result with its answers, sealed like a true one, and gives its place.
    fn sealed(&self, result: &evodrive::suite::SuiteResult, answers: &evodrive::backend::RolloutCassette) -> String {
        let mut result = result.clone();
        let digest = evodrive::kernel::Digest::of_bytes(&answers.to_bytes(&result.suite.name));
        result.recordings[0].digest = Some(digest);
        answers.save(&self.folder.path().join("f.rollouts.jsonl.zst"), &result.suite.name).unwrap();
        let out = self.folder.path().join("f.json");
        std::fs::write(&out, evodrive::suite::result_to_bytes(&result).unwrap()).unwrap();
        out.display().to_string()
    }
}

/// Returns the exit codes of `suite run --recorded` and `leaderboard --recorded`, and what the first says.
fn replayed(result: &str) -> (i32, i32, String) {
    let ran = drive(&["--recorded", result, "--max-crash-rate", "1"]);
    let board = run(&["leaderboard", &shared().path("one.suite"), "--recorded", result]);
    (ran.code, board.code, format!("{}{}", ran.stdout, ran.stderr))
}

#[test]
fn a_forged_result_is_named_whoever_reads_it() {
    use evodrive::backend::{Answer, RolloutCassette};
    use evodrive::suite::{Selected, SuiteResult};
    if !python() {
        return;
    }
    let own = planned(&[]);
    let suite = shared().path("one.suite");
    let true_one = own.sealed(&own.result, &own.answers);
    assert_eq!(replayed(&true_one).0, 0, "{}", replayed(&true_one).2);
    let text = run(&["suite", "run", &suite, "--recorded", &true_one]).stdout;
    assert!(
        text.contains("7 of 15 cases") && text.contains("not asked for: 8 cases of the suite (adv_bmt 4, seal 4)"),
        "{text}"
    );
    let board = run(&["leaderboard", &suite, "--recorded", &true_one]).stdout;
    assert!(board.contains("7 of 15 cases") && board.contains("planner.py was asked for 7 of 15 cases"), "{board}");
    let crashed = |result: &SuiteResult| result.cases.iter().position(|played| played.crashed()).unwrap();
    assert!(own.result.cases.iter().any(|played| played.passed()), "{:?}", own.result);
    // What a forger writes into the result, with its seal made anew.
    type Change<'c> = &'c dyn Fn(&mut SuiteResult);
    let changes: [(&str, Change<'_>, &str); 12] = [
        ("cut", &|of| of.cases.retain(|played| !played.crashed()), "of 7 cases are missing"),
        (
            "cut, and selected so",
            &|of| {
                of.cases.retain(|played| !played.crashed());
                let case = of.cases.iter().map(|played| played.case.clone()).collect();
                of.selection = Some(Selected { case, ..Selected::default() });
            },
            "recorded answers belong to none of its cases",
        ),
        ("doubled", &|of| of.cases.push(of.cases[0].clone()), "there more than once"),
        ("renamed", &|of| of.cases[0].case.push('0'), "none that were asked for"),
        ("another cluster", &|of| of.cases[0].cluster = "nowhere".into(), "another scene, family, cluster or class"),
        (
            "another outcome",
            &|of| {
                let k = crashed(of);
                of.cases[k].came = of.cases.iter().find(|played| played.passed()).unwrap().came.clone();
            },
            "recorded answers come to",
        ),
        (
            "left out as unplayable",
            &|of| {
                let k = crashed(of);
                of.cases[k].came = evodrive::suite::CaseOutcome::Unplayable { reason: "no".into() };
            },
            "recorded answers come to",
        ),
        (
            "another realism",
            &|of| {
                let k = of.cases.iter().position(|played| played.realism.is_some()).unwrap();
                of.cases[k].realism = of.cases[k].realism.map(|realism| 0.5 * realism);
            },
            "recorded answers come to",
        ),
        (
            "another reason",
            &|of| {
                let k = crashed(of);
                of.cases[k].timeline.as_mut().unwrap().visible_s = Some(0.3);
            },
            "recorded answers come to",
        ),
        ("another driver", &|of| of.driver.digest = evodrive::kernel::Digest::of_bytes(b"x"), "it is of the driver"),
        ("other order", &|of| of.cases.swap(0, 1), "another order"),
        ("no recordings", &|of| of.recordings[0].rules = 1, "are gone"),
    ];
    for (what, change, said) in changes {
        let mut forged = own.result.clone();
        change(&mut forged);
        let (code, board, found) = replayed(&own.sealed(&forged, &own.answers));
        let due = if what == "no recordings" { 3 } else { 4 };
        assert!(code == due && board == due && found.contains(said), "{what}: {code}, {board}: {found}");
    }
    let heads: [(&str, Change<'_>); 2] = [
        ("simulator", &|of: &mut SuiteResult| of.simulator += 1),
        ("suite", &|of: &mut SuiteResult| of.suite.digest = evodrive::kernel::Digest::of_bytes(b"x")),
    ];
    for (what, change) in heads {
        let mut forged = own.result.clone();
        change(&mut forged);
        let (code, board, found) = replayed(&own.sealed(&forged, &own.answers));
        assert!(code == 2 && board == 2 && found.contains(what), "{what}: {found}");
    }
    // Without a new seal everyone refuses it, and the format before has none that could be broken.
    let path = own.sealed(&own.result, &own.answers);
    let bytes = std::fs::read_to_string(&path).unwrap();
    for (old, new) in
        [("\"name\":\"planner.py\"", "\"name\":\"better.py\""), ("\"completion\":0.", "\"completion\":0.0")]
    {
        assert!(bytes.contains(old), "{bytes}");
        std::fs::write(&path, bytes.replacen(old, new, 1)).unwrap();
        let (code, board, found) = replayed(&path);
        assert!(code == 4 && board == 4 && found.contains("changed after it was written"), "{new}: {found}");
        let compared = run(&["suite", "compare", &path, &path]);
        assert!(compared.code == 4 && compared.stderr.contains("its seal"), "{}", compared.stderr);
        let baseline = drive(&["--driver", "standing", "--no-new-failures-against", &path]);
        assert!(baseline.code == 4 && baseline.stderr.contains("its seal"), "{}", baseline.stderr);
    }
    let mut old: Value = serde_json::from_str(&bytes).unwrap();
    let fields = old.as_object_mut().unwrap();
    fields.insert("format".into(), "evodrive-suite-result/1".into());
    for gone in ["seal", "selection"] {
        fields.remove(gone);
    }
    old["recordings"][0].as_object_mut().unwrap().remove("digest");
    std::fs::write(&path, old.to_string()).unwrap();
    let (code, _, found) = replayed(&path);
    assert!(code == 0 && found.contains("format without a seal"), "{found}");
    old["cases"].as_array_mut().unwrap().remove(0);
    std::fs::write(&path, old.to_string()).unwrap();
    let (code, board, found) = replayed(&path);
    assert!(code == 4 && board == 4 && found.contains("1 of 7 cases are missing"), "{found}");
    let compared = run(&["suite", "compare", &path, &path, "--suite", &suite]);
    assert!(compared.code == 4 && compared.stderr.contains("are missing"), "{}", compared.stderr);
    // Answers of another version of the planner, and fewer than there were.
    let other = planned(&[("x > 0.0 and", "x > 25.0 and")]);
    let (code, _, found) = replayed(&own.sealed(&own.result, &other.answers));
    assert!(code == 4 && found.contains("it is of the driver"), "{found}");
    let path = own.sealed(&own.result, &own.answers);
    let mut fewer = RolloutCassette::new("fewer", own.answers.backend.clone());
    own.answers.rollouts().skip(1).for_each(|(key, recorded)| fewer.insert(*key, recorded.clone()));
    fewer.save(&own.folder.path().join("f.rollouts.jsonl.zst"), &own.result.suite.name).unwrap();
    let (code, board, found) = replayed(&path);
    assert!(code == 4 && board == 4 && found.contains("not those that it was written with"), "{found}");
    let (code, _, found) = replayed(&own.sealed(&own.result, &fewer));
    assert_eq!(code, 3, "{found}");
    // Motions that nobody can have driven, with the digests that they have.
    type Forge = fn(&mut evodrive::sim::ReportedRollout);
    let forge: [(&str, Forge, &str); 5] = [
        (
            "a jump, told as speed",
            |of| {
                of.ego.truncate(2);
                of.ego[1].sample.velocity = of.ego[1].axis * 60.0;
                of.ego[1].sample.position = of.ego[0].sample.position + of.ego[0].axis * 6.0;
                (of.end, of.contact) = (evodrive::sim::End::Arrived, None);
                of.actors.retain(|actor| actor.from_step < 2);
                of.actors.iter_mut().for_each(|actor| actor.poses.truncate(2 - actor.from_step));
            },
            "ego, row 1: expected",
        ),
        ("a metre more", |of| of.ego[9].sample.position.x += 0.1, "ego, row 9: expected"),
        (
            "without controls",
            |of| {
                of.controls.clear();
                of.ego[9].sample.position.x += 0.001;
            },
            "a car within its limits comes",
        ),
        (
            "no contact",
            |of| {
                (of.end, of.contact) = (evodrive::sim::End::OffRoad, None);
            },
            "its end",
        ),
        ("other controls", |of| of.controls.iter_mut().for_each(|of| of[0] += 0.5), "its recorded controls lead"),
    ];
    let struck = own.answers.rollouts().find(|(_, recorded)| {
        matches!(&recorded.answer, Answer::ReportedRollout(of) if of.contact.is_some() && of.ego.len() > 12)
    });
    let (key, recorded) = struck.expect("a drive with a contact");
    for (what, change, said) in forge {
        let mut answers = own.answers.clone();
        let mut recorded = recorded.clone();
        if let Answer::ReportedRollout(of) = &mut recorded.answer {
            change(of);
        }
        answers.insert(*key, recorded);
        let (code, board, found) = replayed(&own.sealed(&own.result, &answers));
        assert!(code == 4 && board == 4 && found.contains(said), "{what}: {code}: {found}");
    }
}

/// Kills a command at a moment that a stream draws, until it has ended once by itself; then says how often that was.
fn killed(
    command: &dyn Fn() -> Command,
    longest: std::time::Duration,
    stream: &mut evodrive::kernel::Stream,
    most: usize,
) -> usize {
    let quiet = std::process::Stdio::null;
    for kills in 0..most {
        let mut child = command().stdout(quiet()).stderr(quiet()).spawn().unwrap();
        std::thread::sleep(longest.mul_f64(stream.uniform(0.0, 1.0)));
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "after {kills} kills: {status}");
            return kills;
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }
    assert_eq!(Ran::of(&mut command()).code, 0);
    most
}

/// Returns `true` if a file is what a killed write leaves beside the file that it was to become: `.NAME.PROCESS-NUMBER.tmp`.
fn is_unnamed(path: &Path) -> bool {
    let name = path.file_name().unwrap().to_string_lossy();
    let whole =
        name.strip_prefix('.').and_then(|name| name.strip_suffix(".tmp")).and_then(|name| name.rsplit_once('.'));
    whole.is_some_and(|(of, maker)| {
        path.with_file_name(of).is_file() && maker.split('-').all(|part| part.parse::<u32>().is_ok())
    })
}

/// Files below a folder, with their bytes.
fn files_of(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path)
            } else if !is_unnamed(&path) {
                files.push((path.strip_prefix(folder).unwrap().into(), std::fs::read(&path).unwrap()))
            }
        }
    }
    files.sort();
    files
}

/// Whenever they are killed, these commands come to the same files when they are repeated. EVODRIVE_SUITE_KILLS=100 kills each that often.
#[test]
fn killed_freezes_runs_and_leaderboards_come_to_the_same_files() {
    if !python() {
        return;
    }
    #[allow(clippy::disallowed_methods)]
    let wanted = std::env::var("EVODRIVE_SUITE_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(2_usize);
    let (folder, planner) = planner("planner.py", &[]);
    let (shared, suite) = (shared(), shared().path("one.suite"));
    let (pool, planner) = (shared.path("few.pool"), planner.display().to_string());
    let arguments = |name: &str, out: &Path| -> Vec<String> {
        let out = |file: &str| out.join(file).display().to_string();
        match name {
            "freeze" => {
                let fixed = ["suite", "freeze", "--scenes", &pool, "--per-family", "4", "--overwrite", "--out"];
                [&fixed[..], &[&out("k.suite")], &PARENTS].concat().into_iter().map(String::from).collect()
            }
            "run" => ["suite", "run", &suite, "--driver", &planner, "--overwrite", "--out", &out("r.json")]
                .map(String::from)
                .to_vec(),
            _ => [
                "leaderboard",
                &suite,
                "--driver",
                &planner,
                "--overwrite",
                "--kept",
                &out("kept"),
                "--format",
                "csv",
                "--out",
                &out("b.csv"),
            ]
            .map(String::from)
            .to_vec(),
        }
    };
    let mut stream = evodrive::kernel::Seed(61).stream(&["kills"]);
    for name in ["freeze", "run", "leaderboard"] {
        let [whole, often] = ["whole", "often"].map(|of| folder.path().join(format!("{name}-{of}")));
        let command = |out: &Path| {
            let mut command = evodrive();
            command.args(arguments(name, out));
            command
        };
        std::fs::create_dir(&whole).unwrap();
        #[allow(clippy::disallowed_methods)]
        let began = std::time::Instant::now();
        let ran = Ran::of(&mut command(&whole));
        let longest = began.elapsed();
        assert_eq!(ran.code, 0, "{name}: {}", ran.stderr);
        let (mut kills, mut rounds) = (0, 0);
        while kills < wanted && rounds < 20 * wanted {
            let _ = std::fs::remove_dir_all(&often);
            std::fs::create_dir(&often).unwrap();
            kills += killed(&|| command(&often), longest, &mut stream, wanted - kills);
            assert_eq!(files_of(&often), files_of(&whole), "{name} after {kills} kills");
            rounds += 1;
        }
        assert!(kills >= wanted, "{name}: {kills} of {wanted} kills met it");
    }
}

/// The recorded case of a planner that jumps to the end of its route, and the drive that it was made of. Both are of the format before.
#[test]
fn a_reported_forgery_is_refused_and_its_original_is_not() {
    let Some(folder) = crate::harness::shared("cases/reliability_4/10-forged-motion") else { return };
    let suite = home().join("golden/suite/starter.suite").display().to_string();
    let replayed = |name: &str| {
        let result = folder.join(name).display().to_string();
        run(&["suite", "run", &suite, "--recorded", &result, "--min-arrived", "0.1"])
    };
    let forged = replayed("forged.json");
    assert!(forged.code != 0 && forged.stderr.contains("ego"), "{}", forged.stderr);
    let honest = replayed("new.json");
    assert_eq!(honest.code, 0, "{}", honest.stderr);
    assert!(honest.stdout.contains("50 of 200 cases"), "{}", honest.stdout);
}
