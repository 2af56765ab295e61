//! Metrics of an experiment's own: measured in every scene, shown to agents and readers, and no part of what is decided.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::harness::{Recorded, events, experiment, record, report_data, run as evodrive, set, write_small};

const METRICS: [(&str, &str); 2] =
    [("impact_speed", "contact_speed_mps"), ("near_miss", "if(contact, 0, max(0, (3 - ttc_s_min) / 3))")];

fn small(folder: &Path, change: impl FnOnce(&mut toml::Table)) -> PathBuf {
    let mut table = experiment("metadrive/cat-idm.toml");
    let changes = [
        ("scenes", "count", 12.into()),
        ("split", "held_out", 3.into()),
        ("split", "window", 5.into()),
        ("budget", "epochs", 2.into()),
        ("budget", "slots", 3.into()),
        ("budget", "probe_scenes", 2.into()),
        ("budget", "finalists", 1.into()),
    ];
    set(&mut table, &changes);
    table["split"]["evolution"]["count"] = 8.into();
    table.insert("seeds".into(), 1.into());
    change(&mut table);
    write_small(folder, table)
}

fn measured(folder: &Path, metrics: &[(&str, &str)]) -> PathBuf {
    small(folder, |table| {
        let metrics = metrics.iter().map(|(name, of)| (name.to_string(), toml::Value::from(*of)));
        table["evaluation"].as_table_mut().unwrap().insert("metrics".into(), metrics.collect::<toml::Table>().into());
    })
}

/// Every label of a run's attempts: request -> label.
fn labels(run: &Path) -> BTreeMap<String, Value> {
    let attempts = events(run).into_iter().filter(|event| event["kind"] == "attempt");
    let scenes = attempts.filter_map(|event| event["body"]["exit"]["score"]["scenes"].as_array().cloned()).flatten();
    scenes.map(|scene| (scene["request"].as_str().unwrap().to_string(), scene)).collect()
}

/// Rows of a table that `evodrive data` wrote.
fn table(run: &Path, name: &str) -> Vec<BTreeMap<String, String>> {
    let out = tempfile::tempdir().unwrap();
    let out = out.path().join("tables");
    let ran = evodrive(&["data", run.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    csv::Reader::from_path(out.join(format!("{name}.csv"))).unwrap().deserialize().map(|row| row.unwrap()).collect()
}

#[test]
fn a_metric_is_measured_in_every_scene_and_moves_nothing_else() {
    let own = record(|folder| measured(folder, &METRICS));
    let Recorded { run, .. } = &own;
    let found = labels(run);
    assert!(found.len() > 10, "{}", found.len());

    // What the metrics say is what the rollouts say.
    let rollouts = table(run, "rollouts");
    let record_of = |digest: &str| rollouts.iter().find(|row| row["record"] == digest).unwrap();
    let number = |row: &BTreeMap<String, String>, column: &str| row[column].parse::<f64>().ok();
    let (mut met, mut near) = (0, 0);
    for label in found.values() {
        let row = record_of(label["record"].as_str().unwrap());
        let speed = number(row, "contact_relative_speed_mps").unwrap_or(0.0);
        assert!((label["metrics"]["impact_speed"].as_f64().unwrap() - speed).abs() < 1e-9, "{label} {row:?}");
        let ttc = number(row, "ttc_s_min").unwrap_or(20.0);
        let expected = if label["contact"].is_null() { ((3.0 - ttc) / 3.0).max(0.0) } else { 0.0 };
        assert!((label["metrics"]["near_miss"].as_f64().unwrap() - expected).abs() < 1e-9, "{label} {row:?}");
        met += usize::from(speed > 0.0);
        near += usize::from(expected > 0.0);
    }
    assert!(met > 0 && near > 0, "{met} contacts, {near} near misses: the test would show nothing");

    // The same experiment without them simulates the same and labels the same; its questions do not name them.
    let plain = record(|folder| small(folder, |_| {}));
    let without = labels(&plain.run);
    assert!(without.values().all(|label| label.get("metrics").is_none()));
    let shared: Vec<&String> = without.keys().filter(|request| found.contains_key(*request)).collect();
    assert!(!shared.is_empty(), "rollouts do not hang on metrics");
    for request in shared {
        let mut label = found[request].clone();
        label.as_object_mut().unwrap().remove("metrics");
        assert_eq!(label, without[request]);
    }
    let questions = |run: &Path| {
        let shown = evodrive(&["show", "cat-idm/e0s0", "--full", "--run", run.to_str().unwrap()]);
        assert_eq!(shown.code, 0, "{}", shown.stderr);
        shown.stdout
    };
    let (asked, asked_without) = (questions(run), questions(&plain.run));
    assert!(asked.contains("`impact_speed` = `contact_speed_mps`") && asked.contains(" | measured"), "{asked}");
    assert!(asked.contains("impact_speed 0"), "a row of the window shows values");
    assert!(!asked_without.contains("impact_speed") && !asked_without.contains(" | measured"));

    // Readers meet them in the table of labels, in the report, and where two runs are compared.
    let rows = table(run, "labels");
    assert!(rows.iter().any(|row| number(row, "m_impact_speed").is_some_and(|speed| speed > 0.0)));
    assert!(rows.iter().all(|row| number(row, "m_near_miss").is_some()));
    let report = report_data(&std::fs::read_to_string(run.join("report.html")).unwrap());
    assert_eq!(report[0]["metrics"], serde_json::json!(["impact_speed", "near_miss"]));
    let folder = run.to_str().unwrap();
    let compared = evodrive(&["compare", &format!("{folder}:cat-idm"), &format!("{folder}:cat-idm")]);
    assert!(compared.stdout.contains("near_miss"), "{}", compared.stdout);
}

/// Attack of one's own: every table that prints it says what it is, has no row of the paper's beside it, and sets it against no other measure.
#[test]
fn an_attack_of_ones_own_is_named_wherever_it_is_printed() {
    let when = "contact_adversary or ttc_s_min < 1.5";
    let own = record(|folder| {
        small(folder, |table| {
            let mut attack = toml::Table::new();
            attack.insert("when".into(), when.into());
            for list in ["counts", "counts_if_avoidable"] {
                attack.insert(list.into(), toml::Value::Array(Vec::new()));
            }
            table["evaluation"].as_table_mut().unwrap().insert("attack".into(), attack.into());
        })
    });
    let plain = record(|folder| small(folder, |_| {}));
    let (run, other) = (own.run.to_str().unwrap(), plain.run.to_str().unwrap());
    let printed = evodrive(&["table", "metadrive-main", "--run", run]);
    assert!(printed.stdout.contains("where the program acts: contact_adversary or ttc_s_min"), "{}", printed.stdout);
    let line = |text: &str| text.lines().find(|line| line.starts_with("| cat")).unwrap_or_default().to_lowercase();
    assert!(!line(&printed.stdout).contains("paper"), "{}", printed.stdout);
    let mixed = evodrive(&["table", "attack-only", "--run", run, "--run", other]);
    assert!(mixed.code == 2 && mixed.stderr.contains("different measures cannot be compared"), "{}", mixed.stderr);
    assert_eq!(evodrive(&["table", "attack-only", "--run", run, "--run", run]).code, 0);
    let report = report_data(&std::fs::read_to_string(own.run.join("report.html")).unwrap());
    assert_eq!(report[0]["attack"], when);
}

#[test]
fn a_metric_that_cannot_be_measured_is_refused_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |metrics: &[(&str, &str)]| {
        let file = measured(folder.path(), metrics);
        let ran = evodrive(&["run", file.to_str().unwrap(), "--out", folder.path().to_str().unwrap()]);
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        ran.stderr
    };
    let unknown = refused(&[("speed", "contact_sped_mps")]);
    assert!(unknown.contains("contact_speed_mps") && unknown.contains("evodrive features"), "{unknown}");
    assert!(refused(&[("Speed", "contact_speed_mps")]).contains("evaluation.metrics.Speed is not a valid name"));
    let many: Vec<(String, &str)> = (0..9).map(|k| (format!("m{k}"), "contact_speed_mps")).collect();
    let many: Vec<(&str, &str)> = many.iter().map(|(name, of)| (name.as_str(), *of)).collect();
    assert!(refused(&many).contains("[evaluation.metrics] has 9 metrics"));
    let safebench = write_small(folder.path(), {
        let mut table = experiment("safebench/human-idm.toml");
        let metrics = toml::Table::from_iter([("speed".to_string(), toml::Value::from("contact_speed_mps"))]);
        table["evaluation"].as_table_mut().unwrap().insert("metrics".into(), metrics.into());
        table
    });
    let ran = evodrive(&["run", safebench.to_str().unwrap(), "--out", folder.path().to_str().unwrap()]);
    assert!(ran.code == 2 && ran.stderr.contains("metrics"), "{}", ran.stderr);
}
