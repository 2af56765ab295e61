//! The most telling rollouts of a run, each shown by the command that is printed beside it; strips of them.

use std::path::PathBuf;
use std::process::Command;
use std::sync::{Mutex, OnceLock, PoisonError};

use serde_json::Value;

use crate::harness::{Ran, evodrive, run, skip};
use crate::quickstart::copied;

/// A copy of the finished run: ranking holds its store, and other tests hold the one of the original.
fn folder() -> &'static str {
    static COPY: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, folder) = COPY.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        let folder = copied(dir.path());
        (dir, folder)
    });
    folder.to_str().unwrap()
}

/// One command at a time may hold a store.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

fn best(more: &[&str]) -> Vec<Value> {
    let held = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let ran = run(&[&["--json", "scenes", "best", folder()], more].concat());
    drop(held);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let object: Value = serde_json::from_str(&ran.stdout).unwrap();
    object["best"].as_array().unwrap().clone()
}

/// The rollout that is shown first; ranking plays the run's rollouts, so it is done once.
fn severest() -> &'static Value {
    static FIRST: OnceLock<Value> = OnceLock::new();
    FIRST.get_or_init(|| best(&["--top", "1"])[0]["rollout"].clone())
}

/// Words of a printed command, behind the program's name, with the page to write in place of the one that it names.
fn words(command: &str, page: &str) -> Vec<String> {
    command.split_whitespace().skip(1).map(|word| word.replace("rollout.html", page)).collect()
}

#[test]
fn the_most_severe_rollouts_are_of_any_program_and_their_commands_play_them_at_the_same_second() {
    let rows = best(&["--top", "6"]);
    assert_eq!(rows.len(), 6);
    let number = |row: &Value, field: &str| row["rollout"]["contact"][field].as_f64().unwrap();
    let speeds: Vec<f64> = rows.iter().map(|row| number(row, "speed_mps")).collect();
    assert!(rows.iter().all(|row| row["rollout"]["attack"] == 1.0), "contacts that count come first");
    assert!(speeds.is_sorted_by(|a, b| a >= b) && speeds[0] > speeds[5], "{speeds:?}");
    let dir = tempfile::tempdir().unwrap();
    let page = dir.path().join("page.html");
    let command = words(rows[0]["play"].as_str().unwrap(), page.to_str().unwrap());
    let shown = run(&command.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!(shown.code, 0, "{}", shown.stderr);
    let expected = format!("after {:.1} s, {:.1} m/s", number(&rows[0], "at_s"), speeds[0]);
    assert!(shown.stdout.contains(&expected), "{expected}: {}", shown.stdout.lines().next().unwrap());
    assert!(std::fs::read_to_string(page).unwrap().contains("EvoPlayer.mount"));
}

#[test]
fn every_rollout_is_said_to_be_of_a_chosen_an_accepted_or_another_program_and_of_which_suite() {
    let standing = |row: &Value| {
        let of = |field: &str| row["rollout"][field].as_str().unwrap().to_string();
        (of("program"), row["standing"].as_str().unwrap().to_string(), of("suite"))
    };
    let rows: Vec<_> = best(&["--top", "4000"]).iter().map(standing).collect();
    let of = |name: &str| rows.iter().find(|(program, ..)| program == name).map(|(_, standing, _)| standing.as_str());
    assert_eq!(of("adv_bmt-idm/e4s1"), Some("chosen: the run reports it"));
    assert_eq!(of("adv_bmt-idm/parent"), Some("the parent"));
    assert_eq!(of("cat-idm/parent"), Some("the parent, which the run reports"));
    assert_eq!(of("adv_bmt-idm/e5s4"), Some("accepted, but not the one that the run reports"));
    assert!(rows.iter().any(|(_, standing, _)| standing == "not accepted"));
    let held = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let text = run(&["scenes", "best", folder(), "--top", "1", "--lineage", "adv_bmt-idm"]).stdout;
    drop(held);
    let own = rows.iter().find(|(program, ..)| program.starts_with("adv_bmt-idm/")).unwrap();
    let suite = if own.2 == "held_out" { "a held-out scene" } else { "an evolution scene" };
    assert!(text.contains(&format!("{}: {}; {suite}", own.0, own.1)), "{text}");
    let film = text.lines().find_map(|line| line.strip_prefix("as a film: ")).expect("a command");
    let dir = tempfile::tempdir().unwrap();
    let to = dir.path().join("one.gif");
    let command: Vec<String> =
        film.split_whitespace().skip(1).map(|word| word.replace("rollout.gif", to.to_str().unwrap())).collect();
    let made = run(&command.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(made.code == 0 && std::fs::read(to).unwrap().starts_with(b"GIF89a"), "{}", made.stderr);
}

#[test]
fn a_strip_is_a_page_of_pdf_with_its_font() {
    let dir = tempfile::tempdir().unwrap();
    let shown = severest();
    let (name, scene) = (shown["program"].as_str().unwrap(), shown["scene"].as_str().unwrap());
    let draw = |file: &str, more: &[&str]| {
        let to = dir.path().join(file);
        let words =
            ["scenes", "draw", "--run", folder(), "--attempt", name, "--scene", scene, "--frames", "3", "--out"];
        let ran = run(&[&words[..], &[to.to_str().unwrap()], more].concat());
        (ran, std::fs::read(&to).unwrap_or_default())
    };
    let (ran, page) = draw("one.pdf", &[]);
    assert!(ran.code == 0 && page.starts_with(b"%PDF-"), "{}", ran.stderr);
    let (ran, beside) = draw("beside.pdf", &["--beside", "replay"]);
    let both: String = beside.iter().map(|b| char::from(*b)).collect();
    assert!(
        ran.code == 0 && both.matches("\nW\nn").count() == 6 && both.matches("(t = ").count() == 3,
        "{}",
        ran.stderr
    );
    assert_eq!(draw("again.pdf", &["--jobs", "3"]).1, page, "the same bytes each time");
    let text: String = page.iter().map(|b| char::from(*b)).collect();
    assert!(text.contains("/FontFile2") && text.matches("(t = ").count() == 3 && text.matches("\nW\nn").count() == 3);
    let (dark, none) = draw("dark.pdf", &["--dark"]);
    assert!(dark.code == 2 && none.is_empty() && dark.stderr.contains("light colours"), "{}", dark.stderr);
}

#[test]
fn the_fronts_of_a_run_are_a_figure_with_its_points_and_a_chain_is_drawn_where_there_is_one() {
    let dir = tempfile::tempdir().unwrap();
    let place = |name: &str| dir.path().join(name).to_string_lossy().into_owned();
    let (front, points) = (place("front.svg"), place("front.csv"));
    let figure = |more: &[&str]| run(&[&["figure"], more, &["--run", folder()]].concat());
    let drawn = figure(&["pareto-front", "--out", &front, "--data", &points]);
    assert_eq!(drawn.code, 0, "{}", drawn.stderr);
    let csv = std::fs::read_to_string(&points).unwrap();
    let marked = |column: usize| {
        let of = |line: &str| {
            (line.split(',').nth(column) == Some("true")).then(|| line.split(',').nth(1).unwrap().to_string())
        };
        csv.lines().skip(1).filter_map(of).collect::<Vec<_>>()
    };
    assert_eq!(marked(6), ["cat-idm/parent", "at-idm/parent", "adv_bmt-idm/parent"]);
    assert_eq!(marked(9), ["cat-idm/parent", "at-idm/e0s4", "adv_bmt-idm/e4s1"], "those that the run reports");
    // The run's summary prints the fronts.
    let golden = crate::harness::text("golden/quickstart.txt");
    let of = |line: &str| line.split_once(" / ")?.1.split_whitespace().nth(1).map(String::from);
    let fronts: Vec<String> = golden.lines().filter(|line| line.starts_with("  0.")).filter_map(of).collect();
    let (mut own, mut printed) =
        (marked(8), fronts.iter().filter(|name| name.contains('/')).cloned().collect::<Vec<_>>());
    own.sort();
    printed.sort();
    assert_eq!(own, printed);
    // Three lineages with a parent each, and every descendant that was evaluated and acts somewhere.
    assert!(csv.lines().count() > 60 && csv.lines().count() <= 1 + 3 + 99, "{}", csv.lines().count());
    let svg = std::fs::read_to_string(front).unwrap();
    assert_eq!(svg.matches("font-weight=\"bold\"").count(), 3, "a panel a lineage");
    let one = figure(&["pareto-front", "--lineage", "at-idm", "--out", &place("one.svg")]);
    assert!(
        one.code == 0 && std::fs::read_to_string(place("one.svg")).unwrap().matches(">AT against IDM<").count() == 1
    );
    let other = figure(&["patch-surface", "--out", &place("other.svg"), "--data", &points, "--overwrite"]);
    assert!(other.code == 2 && other.stderr.contains("only pareto-front has points"), "{}", other.stderr);
    assert!(!dir.path().join("other.svg").exists(), "refused before anything is written");
    // The first lineage reports its parent, so there is no chain to tell.
    let chain = figure(&["case-evolution", "--out", &place("chain.svg")]);
    assert!(chain.stdout.starts_with("Evolution of AT against IDM: "), "{}", chain.stdout);
    // Two below each other, under the names that people use; what each program of a chain gained is what credit says.
    let copy = copied(dir.path());
    let name = copy.to_str().unwrap();
    let two = place("two.svg");
    let words =
        ["figure", "case-evolution", "--lineage", "adv_bmt-idm", "--lineage", "cat-idm", "--out", &two, "--run", name];
    let drawn = run(&words);
    assert_eq!(drawn.code, 0, "{}", drawn.stderr);
    let svg = std::fs::read_to_string(&two).unwrap();
    for said in ["ADV-BMT against IDM", "CAT against IDM", "Change on held-out scenes", ">p3<"] {
        assert!(svg.contains(said), "{said}");
    }
    assert_eq!(svg.matches("Change on held-out scenes").count(), 1, "the other one reports its parent");
    for internal in ["adv_bmt-idm", "/operator_graph", "/mechanism_modules", "Its proposer expected"] {
        assert!(!svg.contains(internal), "{internal}");
    }
    let missing = figure(&["case-evolution", "--lineage", "at-idx", "--out", &place("none.svg")]);
    assert!(missing.code == 2 && missing.stderr.contains("at-idx"), "{}", missing.stderr);
}

#[test]
fn many_scenes_stand_on_one_sheet_with_the_contacts_first() {
    let dir = tempfile::tempdir().unwrap();
    let draw = |file: &str, words: &[&str]| {
        let to = dir.path().join(file);
        let ran = run(&[&["--json", "scenes", "draw", "--out", to.to_str().unwrap()], words].concat());
        (ran, std::fs::read(&to).unwrap_or_default())
    };
    let own = |count| ["--run", folder(), "--attempt", "adv_bmt-idm/e4s1", "--grid", count];
    let (ran, sheet) = draw("twelve.svg", &own("12"));
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let said: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert!(said["scenes"].as_array().unwrap().len() == 12 && said["left_out"].as_u64() > Some(0), "{said}");
    let text = String::from_utf8(sheet.clone()).unwrap();
    assert_eq!(
        text.matches(">contact with the adversary, ").count(),
        said["title"].as_str().unwrap().split_whitespace().nth(1).unwrap().parse::<usize>().unwrap()
    );
    let first = text.find(">contact with the adversary, ").expect("a contact");
    assert!(text.find(">no contact up to").is_none_or(|other| first < other), "contacts come first");
    assert_eq!(draw("again.svg", &[&own("12")[..], &["--jobs", "3"]].concat()).1, sheet, "the same bytes each time");
    let scene = said["scenes"][0].as_str().unwrap();
    let (one, page) = draw("one.pdf", &[&own("4")[..], &["--scene", scene]].concat());
    assert!(one.code == 0 && page.starts_with(b"%PDF-") && one.stdout.contains("\"left_out\":0"), "{}", one.stderr);
    for (file, more, expected) in [
        ("film.gif", &[][..], "drawn as .svg or .pdf"),
        ("dark.svg", &["--dark"], "light colours"),
        ("two.svg", &["--frames", "2"], "cannot be used with"),
    ] {
        let (ran, left) = draw(file, &[&own("4")[..], more].concat());
        assert!(ran.code == 2 && ran.stderr.contains(expected) && left.is_empty(), "{file}: {}", ran.stderr);
    }
    let (none, _) = draw("none.svg", &own("0"));
    assert!(none.code == 2 && none.stderr.contains("expected 1 to 60 panels"), "{}", none.stderr);
}

#[test]
fn a_tables_columns_are_chosen_and_latex_takes_those_that_fit_a_page() {
    let table = |more: &[&str]| run(&[&["table", "metadrive-policy", folder()], more].concat());
    let (page, all) = (table(&["--format", "latex"]), table(&["--format", "latex", "--columns", "all"]));
    let head = page.stdout.lines().find(|line| line.starts_with("Method")).unwrap();
    assert_eq!(head.matches('&').count(), 7, "eight columns: {head}");
    let (short, long) = all.stdout.split_once("\\else").unwrap();
    assert!(short.contains(head) && long.matches("\\begin{longtable}").count() > 1, "{}", all.stdout);
    assert!(page.stdout.contains("Attack: contacts that the ego caused or could have avoided."), "{}", page.stdout);
    let rows = table(&["--rows", "CAT/IDM,AT", "--format", "csv"]);
    assert_eq!(
        rows.stdout.lines().map(|line| line.split(',').next().unwrap()).collect::<Vec<_>>(),
        ["method", "CAT", "AT"]
    );
    let unknown = table(&["--rows", "CATT"]);
    assert!(unknown.code == 2 && unknown.stderr.contains("did you mean `CAT`"), "{}", unknown.stderr);
    assert!(page.stderr.contains("--columns all prints every one") && all.stderr.is_empty(), "{}", page.stderr);
    let two = table(&["--columns", "evolved_attack,seeds", "--format", "csv"]);
    let head = two.stdout.lines().next().unwrap().to_string();
    let expected = "method,policy,status,lineages,evolved_attack,evolved_attack_low,evolved_attack_high,evolved_attack_paper,seeds,proposals,notes";
    assert_eq!(head, expected);
    let wrong = table(&["--columns", "evolved_atack"]);
    assert!(wrong.code == 2 && wrong.stderr.contains("did you mean `evolved_attack`"), "{}", wrong.stderr);
    let itself = run(&["compare", &format!("{}:at-idm", folder()), &format!("{}:at-idm", folder())]);
    assert!(
        itself.stdout.contains("note: A and B: the stand-in's seed, 18, was chosen of twenty"),
        "{}",
        itself.stdout
    );
}

#[test]
fn by_realism_the_most_realistic_of_one_lineage_come_first() {
    let rows = best(&["--top", "4000", "--by", "realism", "--lineage", "at-idm"]);
    let realism: Vec<f64> = rows.iter().map(|row| row["rollout"]["realism"].as_f64().unwrap()).collect();
    assert!(realism.is_sorted_by(|a, b| a >= b) && realism[0] > realism[rows.len() - 1]);
    assert!(rows.iter().all(|row| row["rollout"]["lineage"] == "at-idm"));
    let program = |name: &str| {
        let also = |row: &Value| row["rollout"]["also"].as_array().unwrap().iter().any(|of| of == name);
        rows.iter().any(|row| row["rollout"]["program"] == name || also(row))
    };
    assert!(
        rows.iter().any(|row| !row["rollout"]["also"].as_array().unwrap().is_empty()),
        "children do much as parents do"
    );
    assert!(program("at-idm/parent") && program("at-idm/e3s3"), "parents are ranked, too");
    let unknown = run(&["scenes", "best", folder(), "--lineage", "at-idx"]);
    assert!(unknown.code == 2 && unknown.stderr.contains("did you mean `at-idm`"), "{}", unknown.stderr);
}

#[test]
fn parent_and_replay_are_drawn_as_attempts_are_and_a_strip_has_the_same_bytes_each_time() {
    let dir = tempfile::tempdir().unwrap();
    let scene = severest()["scene"].as_str().unwrap().to_string();
    let strip = |name: &str, file: &str| {
        let path = dir.path().join(file);
        let words =
            ["scenes", "draw", "--run", folder(), "--attempt", name, "--scene", &scene, "--frames", "3", "--out"];
        let ran = run(&[&words[..], &[path.to_str().unwrap()]].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        (ran.stdout, std::fs::read(path).unwrap())
    };
    let (said, parent) = strip("at-idm/parent", "parent.svg");
    let (replay_said, replay) = strip("at-idm/replay", "replay.svg");
    assert!(said.starts_with("at-idm/parent in ") && replay_said.contains("; no program"), "{said} {replay_said}");
    assert!(
        String::from_utf8_lossy(&parent).contains(">adversary<"),
        "a program's adversary has its colour in the key"
    );
    assert!(!String::from_utf8_lossy(&replay).contains(">adversary<"), "nobody is an adversary without a program");
    assert_eq!(strip("at-idm/parent", "again.svg").1, parent);
    let refused = |more: &[&str], expected: &str| {
        let path = dir.path().join("none.svg");
        let words = ["scenes", "draw", "--run", folder(), "--attempt", "at-idm/replay", "--scene", &scene, "--out"];
        let ran = run(&[&words[..], &[path.to_str().unwrap()], more].concat());
        assert!(ran.code == 2 && ran.stderr.contains(expected) && !path.exists(), "{more:?}: {}", ran.stderr);
    };
    refused(&["--frames", "0"], "expected 1 to 24 panels");
    refused(&["--at", "500"], "expected seconds from the first simulated step");
    refused(&["--around", "-3"], "expected 0 to 1000 metres");
}

#[test]
fn a_rollout_is_a_film_as_well_and_what_cannot_be_filmed_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let shown = severest();
    let (name, scene) = (shown["program"].as_str().unwrap(), shown["scene"].as_str().unwrap());
    let draw = |file: &str, more: &[&str], path: Option<&str>| {
        let to = dir.path().join(file);
        let words =
            ["scenes", "draw", "--run", folder(), "--attempt", name, "--scene", scene, "--panel", "240", "--out"];
        let mut command = evodrive();
        command.args(words).arg(&to).args(more);
        if let Some(path) = path {
            command.env("PATH", path);
        }
        (Ran::of(&mut command), std::fs::read(&to).ok())
    };
    let (ran, film) = draw("one.gif", &[], None);
    assert!(ran.code == 0 && ran.stdout.contains(" pictures of 240 by "), "{}", ran.stderr);
    let film = film.unwrap();
    assert!(film.starts_with(b"GIF89a"));
    assert_eq!(draw("again.gif", &["--jobs", "3"], None).1, Some(film), "the same bytes each time");
    let pictures = |ran: &Ran| ran.stdout.lines().nth(1)?.split(' ').next()?.parse::<usize>().ok();
    let (last, _) = draw("last.gif", &["--last", "0.5"], None);
    let (all, kept) = (pictures(&ran).unwrap(), pictures(&last).unwrap());
    // Half a second before the contact, the contact, and a second behind it at most.
    assert!(last.code == 0 && (6..=16).contains(&kept) && kept < all, "{kept} of {all}: {}", last.stderr);
    for (file, more, path, expected) in [
        ("one.avi", &[][..], None, "expected a name that ends in .svg or .pdf or .gif or .mp4"),
        ("one", &[], None, "ends in .svg"),
        ("two.gif", &["--frames", "3"], None, "a film shows every step"),
        ("two.gif", &["--at", "2.0"], None, "a film shows every step"),
        ("two.gif", &["--last", "0"], None, "expected 0.1 to 600 seconds"),
        ("two.svg", &["--last", "1"], None, "a film alone is cut"),
        ("none.mp4", &[], Some("/nowhere"), "MP4 needs ffmpeg"),
    ] {
        let (ran, left) = draw(file, more, path);
        assert!(ran.code == 2 && ran.stderr.contains(expected) && left.is_none(), "{file}: {}", ran.stderr);
    }
    // A folder beside the film takes what is encoded: a file of somebody's stays, and nothing is left.
    let (tools, theirs) = (dir.path().join("tools"), dir.path().join("mine.mp4.part"));
    std::fs::create_dir(&tools).unwrap();
    std::fs::write(&theirs, "weeks of work").unwrap();
    let encoder = "#!/bin/sh\nfor last do :; done\n/bin/cat > \"$last\"\n";
    std::fs::write(tools.join("ffmpeg"), encoder).unwrap();
    Command::new("chmod").arg("755").arg(tools.join("ffmpeg")).status().unwrap();
    let (ran, film) = draw("mine.mp4", &[], tools.to_str());
    assert!(ran.code == 0 && film.is_some_and(|film| !film.is_empty()), "{}", ran.stderr);
    assert_eq!(std::fs::read_to_string(&theirs).unwrap(), "weeks of work");
    let hidden = |entry: std::fs::DirEntry| entry.file_name().to_string_lossy().starts_with('.');
    assert!(!std::fs::read_dir(dir.path()).unwrap().any(|entry| hidden(entry.unwrap())));
    match Command::new("ffmpeg").arg("-version").output() {
        Ok(_) => {
            let (ran, film) = draw("one.mp4", &[], None);
            assert_eq!(ran.code, 0, "{}", ran.stderr);
            assert_eq!(&film.unwrap()[4..8], b"ftyp");
        }
        Err(_) => skip("ffmpeg is not installed, so no MP4 is written"),
    }
}
