//! Programs written by hand: begun from a family's parent, changed in an editor or by a command, checked, compared, played, evolved
//! from; nobody loses a text that does not fit.

use std::path::Path;

use evodrive::experiment::ProgramFile;
use evodrive::families::sources;
use serde_json::Value;

use crate::harness::{Ran, evodrive, home, text};
use crate::quickstart::finished;

/// A command in a folder; `{run}` is the quickstart's run folder.
pub fn here(folder: &Path, args: &[&str]) -> Ran {
    let run = finished().1.display().to_string();
    let args: Vec<String> = args.iter().map(|arg| arg.replace("{run}", &run)).collect();
    Ran::of(evodrive().current_dir(folder).env_remove("VISUAL").env_remove("EDITOR").args(args))
}

pub fn well(folder: &Path, args: &[&str]) -> String {
    let ran = here(folder, args);
    assert_eq!(ran.code, 0, "{args:?}: {}{}", ran.stdout, ran.stderr);
    ran.stdout
}

fn json(folder: &Path, args: &[&str]) -> Value {
    serde_json::from_str(&well(folder, &[&["--json"], args].concat())).unwrap()
}

/// Scenes of the quickstart in which its ADV-BMT winner attacks, as options.
fn attacked(file: &Path) -> Vec<String> {
    let folder = file.parent().unwrap();
    let pool = finished().1.join("scenes.pool").display().to_string();
    let applied = json(folder, &["apply", file.to_str().unwrap(), "--scenes", &pool]);
    let scenes = applied["program"]["score"]["scenes"].as_array().unwrap();
    let hit = scenes.iter().filter(|scene| scene["attack"] == 1.0);
    hit.flat_map(|scene| ["--scene".to_string(), scene["scene"].as_str().unwrap().to_string()]).collect()
}

/// The three commands as the page has them.
#[test]
fn the_car_is_put_back_by_the_three_commands_of_the_page() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    let page = text("docs/LANGUAGE.md");
    let section = page.split("## Programs by hand").nth(1).expect("the section").split("\n## ").next().unwrap();
    let commands: Vec<Vec<&str>> = section
        .lines()
        .filter_map(|line| line.strip_prefix("evodrive "))
        .filter(|line| line.contains("winner.toml"))
        .map(|line| line.split('#').next().unwrap().split_whitespace().collect())
        .collect();
    assert_eq!(commands.len(), 3, "{commands:?}");
    well(folder, &["program", "export", "{run}", "adv_bmt-idm/e4s1", "--out", "before.toml"]);
    for command in &commands {
        let words: Vec<&str> = command
            .iter()
            .map(|word| match *word {
                "runs/RUN" => "{run}",
                "runs/RUN/scenes.pool" => "{run}/scenes.pool",
                word => word,
            })
            .collect();
        well(folder, &words);
    }
    let (before, after) = (folder.join("before.toml"), folder.join("winner.toml"));
    let [was, is] = [&before, &after].map(|path| ProgramFile::read(path).unwrap());
    let word =
        |file: &ProgramFile| serde_json::to_value(&file.program.operator_graph["actor"].settings["shape"]).unwrap();
    assert_eq!((word(&was), word(&is)), ("cyclist".into(), "vehicle".into()));
    let only = sources().get(&was.family).unwrap().contract.changes(&was.program, &is.program);
    assert_eq!(only.len(), 1, "{only:?}");
    // The same scenes: the cyclist attacks in all of them, the car does not.
    let scenes = attacked(&before);
    assert!(scenes.len() > 4, "{scenes:?}");
    let pool = finished().1.join("scenes.pool").display().to_string();
    let scenes: Vec<&str> = scenes.iter().map(String::as_str).collect();
    let applied = json(folder, &[&["apply", "winner.toml", "--scenes", &pool][..], &scenes[..]].concat());
    let attack = applied["program"]["score"]["objectives"]["attack"].as_f64().unwrap();
    assert!(attack < 1.0, "a car's box cannot meet as a cyclist's does: {attack}");
    let origins = applied["origins"].as_array().unwrap();
    // The published parent came from nobody, whoever changed the program.
    let said = well(folder, &[&["apply", "winner.toml", "--scenes", &pool][..], &scenes[..2]].concat());
    let row = |name: &str| said.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("{name}: {said}"));
    assert!(
        row("adv_bmt-idm/parent ").ends_with("  none") && row("adv_bmt-idm/e4s1-hand ").ends_with("  by hand"),
        "{said}"
    );
    assert_eq!(origins[1]["from"], was.program_hash.to_hex());
    let shown = well(folder, &["program", "show", "winner.toml"]);
    let hand = format!("adv_bmt-idm/e4s1-hand, written by hand from program {}", was.program_hash.short(16));
    assert!(shown.contains(&hand) && shown.contains("adv_bmt-idm/e4s1 of run quickstart"), "{shown}");
    // As JSON it is the same program with the same way here.
    well(folder, &["program", "export", "winner.toml", "--out", "winner.json"]);
    assert_eq!(ProgramFile::read(&folder.join("winner.json")).unwrap(), is);
    let diff = well(folder, &["program", "diff", "{run}:adv_bmt-idm/e4s1", "winner.json"]);
    assert!(diff.starts_with("node actor: setting shape from cyclist to vehicle ("), "{diff}");
}

#[test]
fn a_program_is_begun_checked_and_compared_in_words() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    well(folder, &["program", "new", "--family", "CAT", "--out", "my.toml"]);
    let path = folder.join("my.toml");
    let begun = std::fs::read_to_string(&path).unwrap();
    assert_eq!(well(folder, &["program", "new", "--family", "cat"]), begun);
    well(folder, &["program", "new", "--family", "cat", "--out", "my.json"]);
    assert_eq!(ProgramFile::read(&folder.join("my.json")).unwrap(), ProgramFile::read(&path).unwrap());
    let pool = finished().1.join("scenes.pool").display().to_string();
    let good = well(folder, &["program", "check", "my.toml", "--scenes", &pool]);
    assert!(good.contains("the family's published parent"), "{good}");
    let acts = good.lines().find(|line| line.starts_with("compile")).unwrap();
    assert!(acts.contains("nothing in ") && !acts.contains(" 0 of them"), "{good}");
    // Two faults, each with gate, pointer, line and what is expected.
    let duration = begun.lines().find(|line| line.starts_with("duration_s = ")).unwrap();
    let line = 1 + begun.lines().position(|line| line == duration).unwrap();
    let bad = begun.replace(duration, "duration_s = 99.0").replace("\n[conditions]", "\n[mechanism_modules.near]\nslot = \"candidate_guard\"\noutput = \"boolean\"\nexpression = \"gab_m < 3\"\n\n[conditions]");
    std::fs::write(&path, bad).unwrap();
    let ran = here(folder, &["program", "check", "my.toml"]);
    assert_eq!(ran.code, 2, "{}", ran.stdout);
    let wanted = format!("my.toml, line {line}, /parameters/duration_s: found 99, expected a number in [");
    for part in
        [wanted.as_str(), "(gate interface)", "/mechanism_modules/near", "(gate mechanism)", "compile    not asked"]
    {
        assert!(ran.stdout.contains(part), "{part}: {}", ran.stdout);
    }
    // Whoever reads a program says the first of them.
    let applied = here(folder, &["apply", "my.toml", "--scenes", &pool]);
    assert!(applied.code == 2 && applied.stderr.contains("/parameters/duration_s"), "{}", applied.stderr);
    assert!(applied.stderr.contains(" more, which `evodrive program check my.toml` lists"), "{}", applied.stderr);
    std::fs::write(&path, begun.replace(duration, "duration_s = 3.25")).unwrap();
    let said = well(folder, &["program", "diff", "my.json", "my.toml"]);
    let value = duration.trim_start_matches("duration_s = ").trim_end_matches(".0");
    assert!(said.starts_with(&format!("parameter duration_s from {value} s to 3.25 s (")), "{said}");
    assert!(said.contains("\n    /parameters/duration_s\n"), "{said}");
    assert_eq!(well(folder, &["program", "diff", "my.json", "my.json"]), "both programs do the same\n");
    well(folder, &["program", "new", "--family", "at", "--out", "at.toml"]);
    let other = here(folder, &["program", "diff", "my.json", "at.toml"]);
    assert!(other.code == 2 && other.stderr.contains("family at"), "{}", other.stderr);
    let unknown = here(folder, &["program", "new", "--family", "cats"]);
    assert!(unknown.code == 2 && unknown.stderr.contains("did you mean `cat`?"), "{}", unknown.stderr);
}

#[test]
fn a_value_is_set_through_the_gates_and_comments_of_ones_own_stay() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    for name in ["my.toml", "my.json"] {
        well(folder, &["program", "new", "--family", "cat", "--out", name]);
    }
    let path = folder.join("my.toml");
    let noted = std::fs::read_to_string(&path).unwrap().replace("[parameters]\n", "[parameters]\n# a note of mine\n");
    std::fs::write(&path, &noted).unwrap();
    for name in ["my.toml", "my.json"] {
        let said = well(folder, &["program", "set", name, "/parameters/duration_s", "3.25"]);
        assert!(
            said.contains("parameter duration_s from ") && said.contains("written by hand from program "),
            "{said}"
        );
    }
    let set = std::fs::read_to_string(&path).unwrap();
    assert!(set.contains("# a note of mine\n") && set.contains("\nduration_s = 3.25\n"), "{set}");
    assert_eq!(ProgramFile::read(&path).unwrap(), ProgramFile::read(&folder.join("my.json")).unwrap());
    for (place, value, words) in [
        ("/parameters/duratoin_s", "3", "did you mean `duration_s`?"),
        ("/parameters/duration_s", "99", "expected a number in ["),
        ("/parameters/duration_s", "3.25", "edits that change nothing"),
        ("/conditions/ego", "replay", "a path under /parameters"),
        ("/operator_graph/motion/settings", "{ x = 1 }", "unknown setting"),
    ] {
        for name in ["my.toml", "my.json"] {
            let before = std::fs::read(folder.join(name)).unwrap();
            let ran = here(folder, &["program", "set", name, place, value]);
            assert!(ran.code == 2 && ran.stderr.contains(words), "{place}: {}", ran.stderr);
            assert_eq!(std::fs::read(folder.join(name)).unwrap(), before, "{place}");
        }
    }
    // A place that the file does not have yet.
    let rule = "{ name = \"dense\", when = \"vehicle_count > 3\", parameters = { duration_s = 2.5 } }";
    let said = well(folder, &["program", "set", "my.toml", "/scenario_conditioned_policy/-", rule]);
    assert!(said.contains("rule dense is new: where `vehicle_count > 3`, duration_s = 2.5 s"), "{said}");
    assert!(said.contains("comments of your own are gone"), "{said}");
    assert_eq!(ProgramFile::read(&path).unwrap().program.scenario_conditioned_policy.len(), 1);
}

#[cfg(unix)]
#[test]
fn an_editors_text_is_checked_and_a_bad_one_is_kept_until_it_is_good() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    well(folder, &["program", "new", "--family", "cat", "--out", "my.json"]);
    well(folder, &["program", "new", "--family", "cat", "--out", "my.toml"]);
    let editor = |script: &str| {
        let path = folder.join("editor");
        std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&path, PermissionsExt::from_mode(0o755)).unwrap();
    };
    let edit = |file: &str, variable: &str| {
        let mut command = evodrive();
        command.current_dir(folder).env_remove("VISUAL").env_remove("EDITOR");
        Ran::of(command.env(variable, folder.join("editor")).args(["program", "edit", file]))
    };
    let change = |value: &str| format!("sed -i 's/^duration_s = .*/duration_s = {value}  # mine/' \"$1\"");
    for (file, variable) in [("my.json", "EDITOR"), ("my.toml", "VISUAL")] {
        let (path, draft) = (folder.join(file), folder.join(format!("{file}.edit.toml")));
        let before = std::fs::read(&path).unwrap();
        editor("exit 0");
        let ran = edit(file, variable);
        assert!(
            ran.code == 0 && ran.stdout.contains("nothing changed") && !draft.exists(),
            "{}{}",
            ran.stdout,
            ran.stderr
        );
        // A value that does not fit: the file stays, the text stays, and the next call goes on with it.
        editor(&change("99.0"));
        let ran = edit(file, variable);
        assert_eq!((ran.code, std::fs::read(&path).unwrap()), (2, before.clone()), "{}", ran.stdout);
        for part in [
            "line ",
            "/parameters/duration_s: found 99, expected a number in [",
            "your text is kept in",
            "edit.toml",
            "goes on with it",
        ] {
            assert!(ran.stderr.contains(part), "{part}: {}", ran.stderr);
        }
        assert!(std::fs::read_to_string(&draft).unwrap().contains("duration_s = 99.0  # mine"));
        editor("exit 3");
        let ran = edit(file, variable);
        assert!(ran.code == 2 && ran.stderr.contains("ended with") && draft.exists(), "{}", ran.stderr);
        editor("grep -q 'duration_s = 99.0  # mine' \"$1\" && sed -i 's/^duration_s = 99.0/duration_s = 3.25/' \"$1\"");
        let ran = edit(file, variable);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        assert!(
            ran.stdout.contains("to 3.25 s") && ran.stdout.contains("written by hand from program"),
            "{}",
            ran.stdout
        );
        assert!(!draft.exists());
        let read = ProgramFile::read(&path).unwrap();
        assert_eq!(serde_json::to_value(&read.program.parameters["duration_s"]).unwrap(), 3.25);
    }
    assert!(
        std::fs::read_to_string(folder.join("my.toml")).unwrap().contains("duration_s = 3.25  # mine"),
        "their own words stay"
    );
    let none = here(folder, &["program", "edit", "my.json"]);
    for part in ["set VISUAL or EDITOR", "evodrive program set my.json PLACE VALUE", "--out my.toml"] {
        assert!(none.code == 2 && none.stderr.contains(part), "{part}: {}", none.stderr);
    }
}

#[test]
fn evolution_starts_from_a_program_that_was_written_by_hand_and_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    well(folder, &["program", "new", "--family", "at", "--out", "my.toml"]);
    let path = folder.join("my.toml");
    let begun = std::fs::read_to_string(&path).unwrap();
    let duration = begun.lines().find(|line| line.starts_with("duration_s = ")).unwrap();
    std::fs::write(&path, begun.replace(duration, "duration_s = 2.75")).unwrap();
    let args = ["init", "mine", "--start", "my.toml", "--epochs", "1", "--slots", "1"];
    let said = well(folder, &args);
    assert!(said.contains("it starts from at-hand/program, written by hand from program "), "{said}");
    assert!(said.contains("family = \"at\"") && said.contains("parent_program = \"my.toml\""), "{said}");
    let recorded = here(
        folder,
        &[
            "record",
            "mine.toml",
            "--no-report",
            "--set",
            "scenes.count=12",
            "--set",
            "split.held_out=4",
            "--set",
            "split.window=4",
        ],
    );
    let root = recorded.root();
    let from = ProgramFile::published(&ProgramFile::read(&path).unwrap().family).unwrap().program_hash;
    let hand = format!("at-hand/program, written by hand from program {}", from.short(16));
    assert!(recorded.stdout.contains(&format!("at-idm starts from {hand}")), "{}", recorded.stdout);
    let run = format!("runs/{}", std::fs::read_to_string(folder.join("runs/LATEST")).unwrap().trim());
    for shown in [["show", "at-idm/parent"], ["program", "show"], ["table", "metadrive-main"]] {
        let args: Vec<&str> =
            if shown[0] == "program" { [&shown[..], &[&run, "at-idm/parent"]].concat() } else { shown.to_vec() };
        let text = well(folder, &args);
        assert!(text.contains(&hand), "{shown:?}: {text}");
    }
    assert_eq!(here(folder, &["check"]).root(), root);
    // It leaves that run with both: the hand, then the run.
    well(folder, &["program", "export", &run, "at-idm/parent", "--out", "out.toml"]);
    let out = ProgramFile::read(&folder.join("out.toml")).unwrap();
    let said: Vec<String> = out.origins.iter().map(ToString::to_string).collect();
    assert!(said.len() == 2 && said[0] == hand && said[1].contains("of run mine"), "{said:?}");
    assert!(home().join("docs/LANGUAGE.md").is_file());
}
