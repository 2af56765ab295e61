//! A downstream study: sets that are fixed before anybody learns, trainings that come out again, and a record that cannot be bent.

use std::path::{Path, PathBuf};

use crate::harness::{Ran, evodrive, home, run, text};
use evodrive::objects::downstream::{Downstream, SetName};

const SHORT: &str = "experiments/downstream/short.toml";

/// The short study in a folder of its own, changed.
fn study(folder: &Path, change: impl FnOnce(&mut toml::Table)) -> PathBuf {
    let mut table: toml::Table = text(SHORT).parse().unwrap();
    let program = home().join("experiments/downstream").join(table["program"].as_str().unwrap());
    table.insert("program".into(), program.to_str().unwrap().into());
    table.insert("record".into(), "record.jsonl".into());
    change(&mut table);
    let path = folder.join("study.toml");
    std::fs::write(&path, toml::to_string(&table).unwrap()).unwrap();
    path
}

fn downstream(path: &Path, args: &[&str]) -> Ran {
    let folder = path.parent().unwrap();
    Ran::of(evodrive().args(["downstream", path.to_str().unwrap()]).args(args).current_dir(folder))
}

fn record(folder: &Path) -> Downstream {
    Downstream::read(&std::fs::read_to_string(folder.join("record.jsonl")).unwrap()).unwrap()
}

#[test]
fn the_short_studies_come_out_as_recorded() {
    for (name, trainings) in [("short", 8), ("short-safebench", 16)] {
        let ran = run(&["downstream", &format!("experiments/downstream/{name}.toml"), "--retrain"]);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        assert!(ran.stderr.contains(&format!("{trainings} trainings came out as recorded")), "{}", ran.stderr);
        assert_eq!(ran.stdout, text(&format!("golden/downstream/{name}.md")));
    }
}

#[test]
fn each_recorded_study_gives_its_table_and_figure() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["metadrive", "safebench", "short", "short-safebench"] {
        let file = format!("experiments/downstream/{name}.toml");
        let ran = run(&["downstream", &file, "--as-recorded", "--out", folder.path().to_str().unwrap()]);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        for ending in ["md", "csv", "svg", "html"] {
            let made = std::fs::read_to_string(folder.path().join(format!("{name}.{ending}"))).unwrap();
            assert!(
                made == text(&format!("golden/downstream/{name}.{ending}")),
                "{name}.{ending} differs from its golden"
            );
        }
    }
}

/// Scenes and programs alone decide the sets: they stand in a file before the first training, are the same after a training
/// that saw other scenes, and stay so when the trainings change.
#[test]
fn sets_are_fixed_before_any_training_and_by_nothing_that_is_learned() {
    let folder = tempfile::tempdir().unwrap();
    let path = study(folder.path(), |table| {
        let training = table["training"].as_table_mut().unwrap();
        training.insert("updates".into(), 30.into());
        table["seeds"] = toml::Value::Array(vec![3.into()]);
    });
    let ran = downstream(&path, &["--record", "--kept", "kept", "--jobs", "1"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let (short, own) = (text("cassettes/downstream/short.jsonl"), record(folder.path()));
    let shipped = Downstream::read(&short).unwrap();
    assert_eq!(own.opening.sets, shipped.opening.sets, "other trainings, the same sets");
    assert_ne!(own.trainings[0].weights, shipped.trainings[0].weights);
    let fixed = std::fs::read_dir(folder.path().join("kept")).unwrap().map(|entry| entry.unwrap().path());
    let modified = |path: &PathBuf| std::fs::metadata(path).unwrap().modified().unwrap();
    let (trained, opening): (Vec<PathBuf>, Vec<PathBuf>) =
        fixed.partition(|path| path.to_str().unwrap().ends_with("-s3.json"));
    assert_eq!((trained.len(), opening.len()), (4, 1), "{trained:?} {opening:?}");
    let written: evodrive::objects::downstream::Opening =
        serde_json::from_slice(&std::fs::read(&opening[0]).unwrap()).unwrap();
    assert_eq!(written, own.opening);
    assert!(trained.iter().all(|path| modified(path) >= modified(&opening[0])), "the sets stood there first");
    let names: Vec<SetName> = own.opening.sets.training.iter().map(|set| set.name).collect();
    assert_eq!(names, [SetName::Plain, SetName::Benign, SetName::Original, SetName::Evolved]);
    let scenes = |name| &own.opening.sets.training.iter().find(|set| set.name == name).unwrap().scenes;
    assert_eq!(scenes(SetName::Plain), scenes(SetName::Evolved), "the same scenes, played otherwise");
    assert!(scenes(SetName::Benign).iter().all(|scene| !scenes(SetName::Plain).contains(scene)), "other scenes");
    let digests: std::collections::BTreeSet<_> =
        own.opening.sets.training.iter().chain(&own.opening.sets.evaluation).map(|set| set.digest).collect();
    assert_eq!(digests.len(), 7, "every set has content of its own");
}

#[test]
fn finished_trainings_are_kept_and_a_changed_study_finds_none_of_them() {
    let folder = tempfile::tempdir().unwrap();
    let small = |table: &mut toml::Table, rate: f64| {
        let training = table["training"].as_table_mut().unwrap();
        training.insert("updates".into(), 10.into());
        training["sac"].as_table_mut().unwrap().insert("learning_rate".into(), rate.into());
        table["seeds"] = toml::Value::Array(vec![1.into()]);
    };
    let path = study(folder.path(), |table| small(table, 1e-3));
    let first = downstream(&path, &["--record", "--kept", "kept"]);
    assert!(first.code == 0 && !first.stderr.contains("are there"), "{}", first.stderr);
    let whole = record(folder.path());
    let one = std::fs::read_dir(folder.path().join("kept")).unwrap().map(|entry| entry.unwrap().path());
    let one = one.into_iter().find(|path| path.to_str().unwrap().contains("-evolved-s1")).unwrap();
    std::fs::remove_file(one).unwrap();
    let again = downstream(&path, &["--record", "--kept", "kept"]);
    assert!(again.stderr.contains("3 of 4 trainings are done"), "{}", again.stderr);
    assert_eq!(record(folder.path()), whole, "as if it had not been stopped");
    let path = study(folder.path(), |table| {
        small(table, 1e-3);
        table["seeds"] = toml::Value::Array(vec![1.into(), 2.into()]);
    });
    let more = downstream(&path, &["--record", "--kept", "kept"]);
    assert!(more.stderr.contains("4 of 8 trainings are done"), "another seed: {}", more.stderr);
    let path = study(folder.path(), |table| small(table, 1e-4));
    let other = downstream(&path, &["--record", "--kept", "kept"]);
    assert!(other.code == 0 && !other.stderr.contains("are there"), "{}", other.stderr);
    assert_ne!(record(folder.path()).trainings, whole.trainings);
}

#[test]
fn a_bent_record_and_a_changed_study_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = study(folder.path(), |_| {});
    let none = downstream(&path, &[]);
    assert_eq!(none.code, 3, "{}", none.stderr);
    assert!(
        none.stderr.contains("no record of this study") && none.stderr.contains("study.toml --record"),
        "{}",
        none.stderr
    );
    let there = text("cassettes/downstream/short.jsonl");
    let keep = |text: &str| std::fs::write(folder.path().join("record.jsonl"), text).unwrap();
    keep(&there);
    assert_eq!(downstream(&path, &[]).code, 0, "the path of a file is no part of the study");
    // One scene's end bent: the table moves, and training again finds it.
    let bend = |after: &str| {
        let from = there.find(after).unwrap();
        let place = from + there[from..].find("\"ends\":\"").unwrap() + 8;
        let mut bent = there.clone();
        let letter = if &bent[place..=place] == "h" { "a" } else { "h" };
        bent.replace_range(place..=place, letter);
        keep(&bent);
    };
    bend("\"references\"");
    let found = downstream(&path, &[]);
    assert_eq!(found.code, 4, "{}", found.stderr);
    assert!(found.stderr.contains("drivers that were not trained"), "{}", found.stderr);
    bend("\"examinations\"");
    let found = downstream(&path, &["--retrain", "--arm", "none", "--seed", "1"]);
    assert_eq!(found.code, 4, "{}", found.stderr);
    assert!(found.stderr.contains("none, seed 1: the examination after 55 updates differs"), "{}", found.stderr);
    keep(&there[..there.len() / 2]);
    assert_eq!(downstream(&path, &[]).code, 5);
    keep(&there);
    let other = study(folder.path(), |table| {
        table["evaluation"].as_table_mut().unwrap().insert("seed".into(), 9.into());
    });
    let found = downstream(&other, &[]);
    assert_eq!(found.code, 4, "{}", found.stderr);
    assert!(found.stderr.contains("the digest of set plain is"), "{}", found.stderr);
}

#[test]
fn a_study_that_cannot_be_carried_out_is_refused_with_file_and_key() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |change: &dyn Fn(&mut toml::Table), reason: &str| {
        let path = study(folder.path(), change);
        let ran = downstream(&path, &["--record"]);
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        assert!(ran.stderr.contains("study.toml") && ran.stderr.contains(reason), "{reason}: {}", ran.stderr);
    };
    refused(
        &|table| drop(table.insert("seeds".into(), toml::Value::Array(vec![]))),
        "seeds is [], expected at least one",
    );
    refused(&|table| drop(table.insert("colour".into(), "red".into())), "unknown field `colour`");
    refused(&|table| drop(table["sets"].as_table_mut().unwrap().insert("training".into(), 400.into())), "expected 800");
    refused(
        &|table| drop(table["arm"][1].as_table_mut().unwrap().insert("name".into(), "none".into())),
        "arm[1].name is \"none\", which an earlier arm has",
    );
    refused(
        &|table| drop(table["training"]["sac"].as_table_mut().unwrap().insert("batch".into(), 0.into())),
        "training.sac.batch is 0",
    );
    refused(
        &|table| drop(table["evaluation"].as_table_mut().unwrap().insert("seed".into(), 7101.into())),
        "[evaluation] holds scene",
    );
    // The pool on which the program was evolved.
    refused(
        &|table| {
            let evaluation = table["evaluation"].as_table_mut().unwrap();
            evaluation.insert("seed".into(), 500.into());
        },
        "on which the program was evolved",
    );
    refused(&|table| drop(table.insert("program".into(), "gone.json".into())), "gone.json");
}
