//! Realism is the mean over the scenes acted in, strict realism the smaller one of that and the mean over the successes. One
//! program is followed through the commands that print them: equal names carry equal numbers, the two names different ones.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::harness::{Ran, run};
use crate::quickstart::copied;

const LINEAGE: &str = "adv_bmt-idm";

/// Both realisms of one program.
#[derive(Clone, Copy, Debug)]
struct Both {
    acted: f64,
    strict: f64,
}

impl Both {
    fn in_json(of: &Value) -> Both {
        Both { acted: of["realism_acted"].as_f64().unwrap(), strict: of["strict_realism"].as_f64().unwrap() }
    }

    fn assert_is(self, other: Both, place: &str) {
        let apart = (self.acted - other.acted).abs().max((self.strict - other.strict).abs());
        assert!(apart < 1e-12, "{place}: {self:?} is not {other:?}");
    }
}

fn printed(ran: &Ran) -> &str {
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    &ran.stdout
}

fn json(args: &[&str]) -> Value {
    serde_json::from_str(printed(&run(&[&["--json"], args].concat()))).unwrap()
}

fn path(of: &Path) -> &str {
    of.to_str().unwrap()
}

type Record = std::collections::BTreeMap<String, String>;

fn csv(file: &Path) -> Vec<Record> {
    csv::Reader::from_path(file).unwrap().deserialize().map(Result::unwrap).collect()
}

fn number(record: &Record, column: &str) -> f64 {
    record[column].parse().unwrap()
}

/// Both, worked out from labels by their definitions; every success of the quickstart has attack 1.
fn worked_out(labels: &[Record]) -> Both {
    let mean = |of: Vec<f64>| of.iter().sum::<f64>() / of.len() as f64;
    let acted = || labels.iter().filter(|label| label["acted"] == "true");
    let succeeded = acted().filter(|label| number(label, "attack") > 0.0).map(|label| number(label, "realism"));
    let succeeded: Vec<f64> = succeeded.collect();
    let acted = mean(acted().map(|label| number(label, "realism")).collect());
    Both { acted, strict: if succeeded.is_empty() { acted } else { mean(succeeded).min(acted) } }
}

/// A finished run with the tables that `data` exports of it.
struct Exported {
    dir: tempfile::TempDir,
    /// The run's folder: a copy, because a command that opens the store has it for itself.
    folder: PathBuf,
    tables: PathBuf,
    /// Name of the reported program.
    chosen: String,
    /// Parent and reported program on the held-out scenes, worked out from the exported labels.
    both: [Both; 2],
}

fn exported() -> &'static Exported {
    static EXPORTED: OnceLock<Exported> = OnceLock::new();
    EXPORTED.get_or_init(export)
}

fn export() -> Exported {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let tables = dir.path().join("tables");
    printed(&run(&["data", path(&folder), "--out", path(&tables)]));
    let labels = csv(&tables.join("labels.csv"));
    let result: Value = serde_json::from_slice(&std::fs::read(folder.join("result.json")).unwrap()).unwrap();
    let lineages = result["result"]["lineages"].as_array().unwrap();
    let chosen = lineages.iter().find(|of| of["lineage"] == LINEAGE).unwrap();
    let chosen = chosen["evolved"]["solution"].as_str().unwrap().to_string();
    let of = |solution: &str| {
        let held_out = |label: &&Record| label["solution"] == solution && label["suite"] == "held_out";
        worked_out(&labels.iter().filter(held_out).cloned().collect::<Vec<_>>())
    };
    let both = [of(&format!("{LINEAGE}/parent")), of(&chosen)];
    assert!(both.iter().all(|of| of.acted - of.strict > 0.01), "one number would pass for the other: {both:?}");
    Exported { dir, folder, tables, chosen, both }
}

/// The cells of a line whose first word is this one.
fn cells<'t>(text: &'t str, first: &str) -> Vec<&'t str> {
    let lines = text.lines().map(|line| line.split_whitespace().collect::<Vec<&str>>());
    lines.into_iter().find(|cells| cells.first() == Some(&first)).unwrap_or_else(|| panic!("no line {first} in {text}"))
}

fn digits(value: f64, digits: usize) -> String {
    format!("{value:.digits$}")
}

#[test]
fn a_run_names_realism_and_strict_realism_and_gives_each_its_number() {
    let Exported { chosen, both: [parent, evolved], .. } = exported();
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let text = run(&["check", path(&folder)]);
    let text = printed(&text);
    // A line of the parent and, below it, one of the chosen program: attack, preventable, any crash, realism, strict realism.
    let (heads, row) = (cells(text, "lineage"), cells(text, LINEAGE));
    assert_eq!(heads[1..8], ["program", "attack", "preventable", "any", "crash", "realism", "strict"]);
    assert_eq!([row[5], row[6]], [digits(parent.acted, 4), digits(parent.strict, 4)], "realism and strict realism");
    let below = text.lines().skip_while(|line| !line.starts_with(LINEAGE)).nth(1).unwrap();
    let row: Vec<&str> = below.split_whitespace().collect();
    assert_eq!([row[5], row[6]], [digits(evolved.acted, 4), digits(evolved.strict, 4)], "realism and strict realism");
    let object = json(&["check", path(&folder)]);
    let lineages = object["held_out_realism"].as_array().unwrap();
    let of = lineages.iter().find(|of| of["lineage"] == LINEAGE).unwrap();
    assert_eq!(of["evolved"]["solution"].as_str(), Some(chosen.as_str()));
    Both::in_json(&of["parent"]).assert_is(*parent, "run --json, parent");
    Both::in_json(&of["evolved"]).assert_is(*evolved, "run --json, evolved");
}

#[test]
fn compare_gives_a_program_the_realisms_of_its_run() {
    let Exported { folder, chosen, both: [parent, evolved], .. } = exported();
    let run_folder = path(folder);
    let [one, two] = [format!("{run_folder}:{LINEAGE}/parent"), format!("{run_folder}:{chosen}")];
    let object = json(&["compare", &one, &two]);
    let quantities = object["rows"][0]["comparison"]["quantities"].as_array().unwrap();
    let of = |name: &str, side: &str| {
        quantities.iter().find(|row| row["quantity"] == name).unwrap()[side]["value"].as_f64().unwrap()
    };
    let side = |side: &str| Both { acted: of("realism", side), strict: of("strict realism", side) };
    side("first").assert_is(*parent, "compare, first");
    side("second").assert_is(*evolved, "compare, second");
    let text = run(&["compare", &one, &two]);
    let text = printed(&text);
    assert_eq!(cells(text, "realism")[1], digits(parent.acted, 3));
    // Each with its interval: a number and two ends.
    let strict = cells(text, "strict");
    assert_eq!([&strict[2], &strict[5]], [&digits(parent.strict, 3), &digits(evolved.strict, 3)], "{strict:?}");
}

#[test]
fn apply_gives_a_program_the_realisms_of_its_run_in_text_and_json() {
    let Exported { dir, folder, tables, chosen, both: [parent, evolved] } = exported();
    let (file, pool) = (dir.path().join("program.json"), folder.join("scenes.pool"));
    printed(&run(&["program", "export", path(folder), chosen, "--out", path(&file)]));
    let labels = csv(&tables.join("labels.csv"));
    let held_out = labels.iter().filter(|label| label["solution"] == *chosen && label["suite"] == "held_out");
    let mut args = vec!["apply", path(&file), "--scenes", path(&pool)];
    held_out.for_each(|label| args.extend(["--scene", &label["scene"]]));
    let object = json(&args);
    Both::in_json(&object["parent"]).assert_is(*parent, "apply --json, parent");
    Both::in_json(&object["program"]).assert_is(*evolved, "apply --json, program");
    let text = run(&args);
    // In a pipe all columns stand in one line: attack and any crash, each with an interval, then the two realisms.
    let block = printed(&text);
    assert!(block.contains("  Realism ↑  Strict realism ↑  "), "{block}");
    for (name, both) in [(format!("{LINEAGE}/parent"), parent), (chosen.clone(), evolved)] {
        let row = cells(block, &name);
        assert_eq!([row[7], row[10]], [digits(both.acted, 3), digits(both.strict, 3)], "{name}: {row:?}");
    }
}

#[test]
fn the_table_of_attempts_has_the_realisms_that_its_labels_give() {
    let Exported { tables, .. } = exported();
    let (attempts, labels) = (csv(&tables.join("attempts.csv")), csv(&tables.join("labels.csv")));
    let mut told_apart = 0;
    for attempt in attempts.iter().filter(|attempt| attempt["exit"] == "evaluated" && number(attempt, "coverage") > 0.0)
    {
        let own = |label: &&Record| label["solution"] == attempt["solution"] && label["suite"] == "evolution";
        let own: Vec<Record> = labels.iter().filter(own).cloned().collect();
        if own.len() as f64 != number(attempt, "scenes") {
            continue; // It is labelled on other windows, too.
        }
        let found = Both { acted: number(attempt, "realism_acted"), strict: number(attempt, "strict_realism") };
        found.assert_is(worked_out(&own), &attempt["attempt"]);
        assert_eq!(attempt["realism"], attempt["strict_realism"], "the older column keeps its meaning");
        told_apart += usize::from(found.acted - found.strict > 0.01);
    }
    assert!(told_apart > 3, "{told_apart} attempts tell the two apart");
}
