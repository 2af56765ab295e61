//! `plan`: what is recorded, what is missing, what the rest would cost; nobody is asked.

use serde_json::Value;
use std::path::Path;

use crate::harness::{run, text};
use crate::quickstart::copied;

const QUICKSTART: &str = "experiments/quickstart.toml";

fn planned(args: &[&str], code: i32) -> Value {
    let ran = run(&[&["plan", "--json"], args].concat());
    assert_eq!(ran.code, code, "{}", ran.stderr);
    serde_json::from_str(&ran.stdout).unwrap()
}

#[test]
fn a_recorded_experiment_is_complete_and_nothing_is_written_but_rollouts() {
    let dir = tempfile::tempdir().unwrap();
    let folder = copied(dir.path());
    let before = crate::harness::files(&folder, "");
    let found = planned(&[QUICKSTART, "--out", dir.path().to_str().unwrap()], 0);
    assert_eq!((&found["complete"], &found["not_asked_for"]), (&true.into(), &0.into()), "{found}");
    assert_eq!(found["questions"]["at_most"], 0);
    assert_eq!(crate::harness::files(&folder, ""), before);
}

/// The quickstart's cassette without the answers that a test chooses by their lines.
fn cassette_without(dir: &Path, lacks: impl Fn(&Value) -> bool) -> (String, usize) {
    let whole = text("cassettes/quickstart.jsonl");
    let lacking = |line: &&str| {
        let line: Value = serde_json::from_str(line).unwrap();
        line.get("exchange").is_some() && lacks(&line)
    };
    let (gone, kept): (Vec<&str>, Vec<&str>) = whole.lines().partition(lacking);
    let path = dir.join("part.jsonl");
    std::fs::write(&path, kept.iter().map(|line| format!("{line}\n")).collect::<String>()).unwrap();
    (path.to_str().unwrap().to_string(), gone.len())
}

#[test]
fn missing_answers_are_named_as_far_as_the_walk_goes_and_the_rest_is_bounded() {
    let dir = tempfile::tempdir().unwrap();
    copied(dir.path());
    let late = |line: &Value| line["slot"]["epoch"] == 5 && line["slot"]["slot"].as_u64() >= Some(3);
    let (cassette, gone) = cassette_without(dir.path(), late);
    let found = planned(&[QUICKSTART, "--out", dir.path().to_str().unwrap(), "--cassette", &cassette], 3);
    // The walk ends in the last epoch of the first lineage: its three slots without answers have one first question each.
    let slots: Vec<(&str, u64, &str)> = found["missing"]
        .as_array()
        .unwrap()
        .iter()
        .map(|of| {
            (
                of["slot"]["lineage"].as_str().unwrap(),
                of["slot"]["slot"].as_u64().unwrap(),
                of["slot"]["role"].as_str().unwrap(),
            )
        })
        .collect();
    assert_eq!(slots, [("cat-idm", 3, "actor"), ("cat-idm", 4, "actor"), ("cat-idm", 5, "actor")]);
    let [likely, at_most] = ["likely", "at_most"].map(|of| found["questions"][of].as_u64().unwrap() as usize);
    // What came before them in the last epoch of the other lineages is recorded and was not come to.
    let unused = found["not_asked_for"].as_u64().unwrap() as usize;
    assert!(at_most >= gone + unused && likely <= at_most, "{likely}, {at_most}, {gone}, {unused}");
    // Fifteen occasions of 108 are left; each is one question to an actor.
    let actor = found["roles"].as_array().unwrap().iter().find(|of| of["role"] == "actor").unwrap();
    assert_eq!((&actor["known"], &actor["at_most"], &actor["tokens_from"]), (&3.into(), &15.into(), &"bytes".into()));
}

#[test]
fn what_nobody_recorded_is_priced_as_the_experiment_declares() {
    let dir = tempfile::tempdir().unwrap();
    let priced = text("experiments/live_example.toml")
        .replacen("input_usd_per_million = 0.0", "input_usd_per_million = 2.0", 1)
        .replacen("output_usd_per_million = 0.0", "output_usd_per_million = 8.0", 1);
    let path = dir.path().join("priced.toml");
    std::fs::write(&path, priced).unwrap();
    let found = planned(&[path.to_str().unwrap(), "--out", dir.path().to_str().unwrap()], 3);
    let roles = found["roles"].as_array().unwrap();
    let of = |role: &str| roles.iter().find(|of| of["role"] == role).unwrap();
    // One lineage, two epochs of two slots, one repair round; a critic is asked again after an unreadable answer.
    let most = |role: &str| of(role)["at_most"].as_u64().unwrap();
    assert_eq!((most("actor"), most("repair"), most("attack_critic")), (4, 4, 16));
    assert_eq!((&of("actor")["known"], &found["questions"]["likely"]), (&2.into(), &Value::Null));
    // The actor's two known questions: their bytes, a token for four of them, and the longest answer.
    let bytes: Vec<f64> =
        found["missing"].as_array().unwrap().iter().map(|of| (of["bytes"].as_f64().unwrap() / 4.0).ceil()).collect();
    let usd = bytes.iter().map(|tokens| (tokens * 2.0 + 1500.0 * 8.0) / 1e6).sum::<f64>();
    let printed = found["usd_estimate"]["known"].as_f64().unwrap();
    assert!(bytes.len() == 2 && (printed - usd).abs() < 1e-9, "{printed}, {usd}");
}
