//! Basics of daily work: values on the command line, comparisons, lists, completions and manual pages, and what a
//! recording may write over.

use std::collections::BTreeSet;
use std::path::Path;

use crate::backends::experiment;
use crate::harness::{Ran, evodrive, folder_below, home, report_data, run};

fn call(command: &str, path: &Path, out: &Path, more: &[&str]) -> Ran {
    let fixed = [command, path.to_str().unwrap(), "--no-report", "--out", out.to_str().unwrap()];
    Ran::of(evodrive().args(fixed).args(more))
}

#[test]
fn a_value_of_the_command_line_is_checked_like_the_files_and_kept_in_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = experiment(folder.path(), "mine", "");
    let (one, two) = (folder.path().join("one"), folder.path().join("two"));
    let root = call(
        "record",
        &path,
        &one,
        &["--set", "budget.slots=2", "--set", "describes=two slots", "--set", "budget.finalists=9"],
    )
    .root();
    let kept = std::fs::read_to_string(folder_below(&one).join("experiment.toml")).unwrap();
    assert!(kept.contains("slots = 2") && kept.contains("describes = \"two slots\""), "{kept}");
    assert_eq!(
        call(
            "run",
            &path,
            &two,
            &["--set", "budget.finalists=9", "--set", "describes=two slots", "--set", "budget.slots=2"]
        )
        .root(),
        root
    );
    for (bad, expected) in
        [("budget.slotz=2", "did you mean `slots`"), ("budget.slots=many", "budget.slots is \"many\"")]
    {
        let refused = call("run", &path, &two, &["--set", bad]);
        assert!(refused.code == 2 && refused.stderr.contains(expected), "{bad}: {}", refused.stderr);
        assert!(refused.stderr.contains("--set"), "{}", refused.stderr);
    }
    // Another run, paired with the first: what changed is named.
    let plain = folder.path().join("plain");
    call("record", &path, &plain, &["--cassette", folder.path().join("plain.jsonl").to_str().unwrap()]).root();
    let names = [folder_below(&one), folder_below(&plain)].map(|dir| dir.to_string_lossy().into_owned());
    let compared = run(&["compare", &names[0], &names[1]]);
    assert_eq!(compared.code, 0, "{}", compared.stderr);
    for part in
        ["3 held-out scenes, paired", "budget.slots: 2 -> 1", "attack", "B - A", "`budget.finalists` is 9 in A and "]
    {
        assert!(compared.stdout.contains(part), "{part}: {}", compared.stdout);
    }
    let same = format!("{}:cat-idm/parent", names[0]);
    let itself = run(&["compare", &same, &same, "--json"]);
    let object: serde_json::Value = serde_json::from_str(&itself.stdout).unwrap();
    let quantities = object["rows"][0]["comparison"]["quantities"].as_array().unwrap();
    // The mean would be the same whoever is paired with whom: its interval is not.
    let nothing = serde_json::json!({"value": 0.0, "interval": [0.0, 0.0]});
    assert!(quantities.iter().all(|of| of["difference"] == nothing), "{object}");
    assert!(quantities.iter().any(|of| of["quantity"] == "strict realism"), "{object}");
    let spread = |of: &serde_json::Value| of["first"]["interval"][0] != of["first"]["interval"][1];
    assert!(quantities.iter().any(spread), "no scene differs from another, so this shows nothing: {object}");
    let unknown = run(&["compare", &format!("{}:cat-idn", names[0]), &same]);
    assert!(unknown.code == 2 && unknown.stderr.contains("did you mean cat-idm?"), "{}", unknown.stderr);
}

#[test]
fn seeds_that_both_runs_have_are_pooled_and_one_seed_is_compared_with_its_like() {
    let folder = tempfile::tempdir().unwrap();
    let path = experiment(folder.path(), "mine", "[[lineage]]\nid = \"cat\"\nfamily = \"cat\"\nego = \"idm\"\n");
    let recorded = |name: &str, set: &[&str]| {
        let out = folder.path().join(name);
        let cassette = folder.path().join(format!("{name}.jsonl")).to_string_lossy().into_owned();
        call("record", &path, &out, &[&["--cassette", &cassette], set].concat()).root();
        folder_below(&out).to_string_lossy().into_owned()
    };
    let one = recorded("one", &[]);
    let [two, other] = [("two", "1"), ("other", "2")]
        .map(|(name, slots)| recorded(name, &["--set", "seeds=2", "--set", &format!("budget.slots={slots}")]));
    let object: serde_json::Value = serde_json::from_str(&run(&["compare", &two, &other, "--json"]).stdout).unwrap();
    let rows = object["rows"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|row| row["name"].as_str().unwrap()).collect();
    assert_eq!((names, &rows[0]["seeds"]), (vec!["cat", "cat-s0", "cat-s1"], &2.into()));
    let realism = |of: &serde_json::Value| {
        let row = of["quantities"].as_array().unwrap().iter().find(|row| row["quantity"] == "realism").unwrap().clone();
        ["first", "second", "difference"].map(|side| row[side]["value"].as_f64().unwrap())
    };
    let (pooled, seeds) = (realism(&rows[0]["pooled"]), [1, 2].map(|at| realism(&rows[at]["comparison"])));
    assert_ne!(seeds[0][0], seeds[1][0], "the seeds differ, or their mean shows nothing");
    let means = [0, 1, 2].map(|at| 0.5 * (seeds[0][at] + seeds[1][at]));
    assert!(pooled.iter().zip(means).all(|(pooled, mean)| (pooled - mean).abs() < 1e-12), "{object}");
    const SPREAD: &str = "The spread between searches is not in them";
    let text = run(&["compare", &two, &other]).stdout;
    assert!(text.contains("cat, pooled: means over 2 seeds of both") && !text.contains(SPREAD), "{text}");
    assert!(text.contains("of one seed's over scenes alone"), "{text}");
    // The overview before the blocks: a line a block, with the differences that the blocks end their lines with.
    let (overview, blocks) = text.split_once("\n\ncat, pooled:").unwrap();
    let crashes = blocks.lines().filter(|line| line.trim_start().starts_with("any crash"));
    let ends = crashes.map(|line| line.trim_end().rsplit("  ").next().unwrap());
    let lines: Vec<&str> = overview.lines().skip_while(|line| !line.contains("any crash")).skip(1).collect();
    let names: Vec<&str> = lines.iter().map(|line| line.trim_start().split("  ").next().unwrap()).collect();
    assert_eq!(names, ["cat, pooled", "cat-s0", "cat-s1"], "{text}");
    assert!(lines.iter().zip(ends).all(|(line, end)| line.trim_end().ends_with(end)), "{text}");
    assert!(!text.contains("budget.finalists"), "both measure as many: {text}");
    // The same on the page of one of them: the row is the pooled one, and each seed has the other run's program in its front.
    let page = run(&["report", &two, "--beside", &other, "--beside", &one]);
    assert_eq!(page.code, 0, "{}", page.stderr);
    let data = report_data(&std::fs::read_to_string(Path::new(&two).join("report.html")).unwrap());
    let others = data[0]["others"].as_array().unwrap();
    let [with_seeds, alone] = &others[..] else { panic!("{others:?}") };
    assert_eq!(with_seeds["by"], "rule-based stand-in");
    let [row] = &with_seeds["rows"].as_array().unwrap()[..] else { panic!("{with_seeds}") };
    assert_eq!(
        (&row["search"], &row["seeds"], &row["quantities"]),
        (&"cat".into(), &2.into(), &rows[0]["pooled"]["quantities"])
    );
    let lineages = |of: &serde_json::Value| -> Vec<String> {
        of["points"].as_array().unwrap().iter().map(|point| point["lineage"].as_str().unwrap().to_string()).collect()
    };
    assert_eq!(
        (lineages(with_seeds), lineages(alone)),
        (vec!["cat-s0".to_string(), "cat-s1".into()], vec!["cat-s0".to_string()])
    );
    assert_eq!(alone["rows"][0]["seeds"], 1);
    let itself = run(&["report", &two, "--beside", &two]);
    assert!(itself.code == 2 && itself.stderr.contains("expected another run"), "{}", itself.stderr);
    let mixed = run(&["compare", &one, &two]);
    for part in ["cat and cat-s0: A", "only B has the seeds 1, which are left out", SPREAD] {
        assert!(mixed.stdout.contains(part), "{part}: {} {}", mixed.stdout, mixed.stderr);
    }
    let apart = run(&["compare", &format!("{two}:cat"), &format!("{other}:cat-s1")]);
    assert!(apart.stdout.contains("only A has the seeds 0") && apart.stdout.contains("cat-s1: A "), "{}", apart.stdout);
    // A parent is proposed by the name that it has in the run.
    for (meant, near) in
        [(format!("{two}:cat/parent"), "cat-s0/parent"), (format!("{one}:cat-s0/parent"), "cat/parent")]
    {
        let refused = run(&["compare", &meant, &one]);
        assert!(refused.code == 2 && refused.stderr.contains(&format!("did you mean `{near}`")), "{}", refused.stderr);
    }
    // Three scenes that agree are no proof.
    assert!(text.contains("with 3 of 3 it may be down to 0.368"), "{text}");
}

/// Arguments that the test puts behind an example: a shorter run.
const FEWER: [&str; 3] = ["--set", "budget.epochs=1", "--no-report"];

/// Commands with `--set` that a page shows in a block of its own, or the help at its end, each once.
fn examples_of_set() -> BTreeSet<String> {
    let docs = std::fs::read_dir(home().join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let pages = docs.chain([home().join("README.md")]).filter(|path| path.extension().is_some_and(|end| end == "md"));
    let mut texts: Vec<String> = pages.map(|path| std::fs::read_to_string(path).unwrap()).collect();
    texts.push(format!("```\n{}\n```", run(&["record", "--help"]).stdout));
    let mut found = BTreeSet::new();
    for text in &texts {
        // Every second part lies in a block.
        for line in text.split("```").skip(1).step_by(2).flat_map(str::lines) {
            let command = line.trim().split(" #").next().unwrap_or_default().trim();
            if command.starts_with("evodrive ") && command.contains(" --set ") {
                found.insert(command.to_string());
            }
        }
    }
    found
}

/// Runs in a folder with only those files of a clone that the quickstart needs. Fewer epochs stand behind what is typed: the answers of
/// the first one are those of the cassette, whatever comes after it.
#[test]
fn every_example_of_set_works_as_it_is_typed() {
    let folder = tempfile::tempdir().unwrap();
    for file in ["experiments/quickstart.toml", "cassettes/quickstart.jsonl"] {
        let copy = folder.path().join(file);
        std::fs::create_dir_all(copy.parent().unwrap()).unwrap();
        std::fs::copy(home().join(file), copy).unwrap();
    }
    let examples = examples_of_set();
    assert!(!examples.is_empty());
    for example in examples {
        let words = example.split_whitespace().skip(1);
        let ran = Ran::of(evodrive().current_dir(folder.path()).args(words).args(FEWER));
        assert_eq!(ran.code, 0, "{example}: {}", ran.stderr);
    }
}

#[test]
fn a_recording_loses_no_answer_of_another_experiment_unless_it_is_told_to() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (experiment(folder.path(), "mine", ""), folder.path().join("out"));
    call("record", &path, &out, &[]).root();
    let cassette = folder.path().join("mine.jsonl");
    let before = std::fs::read(&cassette).unwrap();
    let lineage = "[[lineage]]\nid = \"other\"\nfamily = \"cat\"\nego = \"idm\"\n";
    let other = experiment(folder.path(), "other", lineage);
    let shared = ["--cassette", cassette.to_str().unwrap()];
    let refused = call("record", &other, &folder.path().join("o"), &shared);
    assert!(refused.code == 2 && refused.stderr.contains("which other does not have"), "{}", refused.stderr);
    assert!(!folder.path().join("o").exists(), "refused before a run folder is made");
    // The same lineages with other questions are found out when these are asked.
    let elsewhere = ["--set", "budget.slots=2", "--set", "models.scripted.sampling.seed=3"];
    let refused = call("record", &path, &out, &elsewhere);
    assert!(refused.code == 2 && refused.stderr.contains("did not ask for"), "{}", refused.stderr);
    assert_eq!(std::fs::read(&cassette).unwrap(), before);
    let answered = call("record", &path, &out, &[&elsewhere[..], &["--overwrite"]].concat());
    assert_eq!(answered.code, 0, "{}", answered.stderr);
    assert_ne!(std::fs::read(&cassette).unwrap(), before);
    // A missing answer proposes the command with everything that decides what is asked.
    let missed = call("run", &path, &folder.path().join("m"), &[]);
    assert_eq!(missed.code, 3, "{}", missed.stderr);
    let (program, out) = (env!("CARGO_BIN_EXE_evodrive"), folder.path().join("m"));
    let command = format!("{program} record {} --no-report --out {}", path.display(), out.display());
    assert!(missed.stderr.contains(&command), "{}", missed.stderr);
}

/// The questions of a cassette name the scenes of their windows, so other scenes are seen before there is any work.
#[test]
fn a_cassette_of_another_pool_is_called_that_before_a_folder_is_made_and_one_of_a_larger_pool_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (experiment(folder.path(), "mine", ""), folder.path().join("out"));
    let root = call("record", &path, &out, &[]).root();
    let before = std::fs::read(folder.path().join("mine.jsonl")).unwrap();
    let (other, elsewhere) = (["--set", "scenes.seed=8"], folder.path().join("elsewhere"));
    for (command, code) in [("run", 3), ("record", 2)] {
        let refused = call(command, &path, &elsewhere, &other);
        assert_eq!((refused.code, elsewhere.exists()), (code, false), "{}", refused.stderr);
        for part in ["mine.jsonl was recorded on another scene pool", "/7/", "the 12 scenes here", "--cassette FILE"] {
            assert!(refused.stderr.contains(part), "{part}: {}", refused.stderr);
        }
    }
    assert_eq!(std::fs::read(folder.path().join("mine.jsonl")).unwrap(), before);
    let plan = ["plan", path.to_str().unwrap(), "--out", elsewhere.to_str().unwrap()];
    let planned = Ran::of(evodrive().args(plan).args(other));
    let answered = planned.stderr.contains("was recorded on another scene pool");
    assert!(planned.code == 3 && answered, "{}", planned.stderr);
    // Scenes of its own beside others: what is missing then is an answer, not the pool.
    let more = call("run", &path, &elsewhere, &["--set", "scenes.count=14"]);
    assert!(more.code == 3 && !more.stderr.contains("another scene pool"), "{}", more.stderr);
    assert_eq!(call("run", &path, &out, &[]).root(), root);
}

#[test]
fn lists_completions_and_manual_pages_name_what_there_is() {
    let lines = |command: &str| run(&[command]).stdout.lines().count();
    assert!(lines("families") == 12 && lines("formats") == 12 && lines("features") > 80);
    let features = run(&["features", "--json"]).stdout;
    let object: serde_json::Value = serde_json::from_str(&features).unwrap();
    let named = |name: &str| object["features"].as_array().unwrap().iter().any(|of| of["name"] == name);
    assert!(named("seen_ttc_s") && named("contact_speed_mps") && named("vehicle_count"));
    for shell in ["bash", "zsh", "fish"] {
        let script = run(&["completions", shell]).stdout;
        assert!(script.contains("scenes") && script.contains("no-report"), "{shell}");
    }
    let folder = tempfile::tempdir().unwrap();
    let pages = run(&["man", "--out", folder.path().to_str().unwrap()]);
    assert_eq!(pages.code, 0, "{}", pages.stderr);
    let page = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert!(page("evodrive.1").contains("evodrive\\-record"), "{}", page("evodrive.1"));
    assert!(page("evodrive-record.1").contains("overwrite") && page("evodrive-scenes-import.1").contains("towns"));
}
