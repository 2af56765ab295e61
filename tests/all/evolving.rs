//! The world evaluator's self-evolution in a whole run: its turns are events of the hash chain, replay from the cassette, and
//! take effect in the next epoch.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::harness::{Recorded, events, experiment, record, run as evodrive, set, write_small};
use serde_json::Value;

/// The world experiment with few scenes, as `change` leaves it: every proposal is simulated, so that there is something to judge.
fn small(folder: &Path, change: impl FnOnce(&mut toml::Table)) -> PathBuf {
    let mut table = experiment("world/evolving.toml");
    let changes = [
        ("scenes", "count", 14.into()),
        ("split", "held_out", 2.into()),
        ("split", "window", 4.into()),
        ("budget", "epochs", 5.into()),
        ("budget", "slots", 4.into()),
        ("budget", "probe_scenes", 2.into()),
        ("budget", "finalists", 1.into()),
        ("world", "trees", 5.into()),
        ("world_agent", "fit_labels_min", 2.into()),
        ("world_agent", "held_labels_min", 2.into()),
        ("world_agent", "gain_errors", 0.0.into()),
    ];
    set(&mut table, &changes);
    table["world"]["routing"]["min_labels"] = 4.into();
    table["split"]["evolution"]["count"] = 10.into();
    table["models"]["scripted"]["sampling"]["out_of_range_rate"] = 0.3.into();
    table.insert("seeds".into(), 1.into());
    change(&mut table);
    write_small(folder, table)
}

/// One recorded run, shared: its folder, the experiment, the run folder, the root.
fn recorded() -> &'static Recorded {
    static RUN: OnceLock<Recorded> = OnceLock::new();
    RUN.get_or_init(|| record(|folder| small(folder, |_| {})))
}

/// Events of a kind.
fn of_kind(run: &Path, kind: &str) -> Vec<Value> {
    events(run).into_iter().filter(|event| event["kind"] == kind).collect()
}

#[test]
fn turns_form_a_lineage_of_snapshots_that_route_the_epochs_behind_them() {
    let Recorded { run, .. } = recorded();
    let turns = of_kind(run, "world");
    assert!(turns.len() >= 2, "{} turns", turns.len());
    let (frozen, settled) = (of_kind(run, "frozen"), of_kind(run, "settled"));
    let mut active: Option<&Value> = None;
    for turn in &turns {
        let body = &turn["body"];
        let epoch = body["epoch"].as_u64().unwrap();
        assert!(active.is_none_or(|active| *active == body["incumbent"]), "a turn follows on the one before it");
        let accepted = body["judgement"]["objections"].as_array().is_some_and(Vec::is_empty);
        let left = if accepted { &body["challenger"] } else { &body["incumbent"] };
        assert_eq!(&body["active_digest"], left);
        assert!(accepted || body["challenger"].is_null() || body["challenger"] != body["active_digest"]);
        active = Some(&body["active_digest"]);
        let seq = turn["seq"].as_u64().unwrap();
        for of in settled.iter().filter(|of| of["body"]["epoch"] == epoch) {
            assert!(of["seq"].as_u64().unwrap() < seq, "a turn stands behind its epoch");
        }
        for of in frozen.iter().filter(|of| of["body"]["epoch"] == epoch + 1) {
            assert_eq!(of["body"]["world"], body["snapshot"], "and before the next");
        }
        let held = body["audit"]["held_epochs"].as_array().unwrap();
        assert!(held.iter().all(|of| of.as_u64().unwrap() <= epoch));
    }
    assert!(turns.iter().all(|turn| turn["body"]["epoch"] != 4), "no turn behind the last epoch");
    let judged: Vec<&Value> = turns.iter().map(|turn| &turn["body"]["challenger"]).filter(|of| !of.is_null()).collect();
    assert!(!judged.is_empty(), "somebody was judged");
}

#[test]
fn an_evolving_run_has_one_root_and_keeps_every_promise() {
    let Recorded { experiment, run, root, .. } = recorded();
    let out = tempfile::tempdir().unwrap();
    let cassette = run.join("cassette.jsonl");
    let (file, cassette) = (experiment.to_str().unwrap(), cassette.to_str().unwrap());
    let out = out.path().to_str().unwrap();
    let again = evodrive(&["run", file, "--out", out, "--cassette", cassette, "--jobs", "2", "--no-report"]);
    assert_eq!(&again.root(), root);
    let checked = evodrive(&["check", run.to_str().unwrap()]);
    assert_eq!(checked.root(), *root);
    assert!(!checked.stdout.contains("breach"), "{}", checked.stdout);
    let cost: Value = serde_json::from_str(&std::fs::read_to_string(run.join("cost.json")).unwrap()).unwrap();
    let world = cost["lineages"].as_array().unwrap().iter().find(|of| of["lineage"] == "world").unwrap();
    assert!(world["answers"].as_u64().unwrap() >= 2, "{world}");
}

#[test]
fn turns_are_shown_by_show_world_and_the_report() {
    let Recorded { run, .. } = recorded();
    let turns = of_kind(run, "world");
    let name = format!("world/e{}", turns[0]["body"]["epoch"]);
    let shown = evodrive(&["show", &name, "--run", run.to_str().unwrap()]);
    assert_eq!(shown.code, 0, "{}", shown.stderr);
    for needed in ["turn of the world evaluator", "world_agent round 0", "\"world_candidate\"", "active from epoch"] {
        assert!(shown.stdout.contains(needed), "{needed}: {}", shown.stdout);
    }
    let world = evodrive(&["world", run.to_str().unwrap()]);
    assert!(world.stdout.contains(&format!("self-evolution: {} turns", turns.len())), "{}", world.stdout);
    let json = evodrive(&["world", run.to_str().unwrap(), "--json"]);
    let json: Value = serde_json::from_str(&json.stdout).unwrap();
    let found = serde_json::to_string(&json).unwrap();
    assert!(found.contains("\"evolution\"") && found.contains("\"active\""), "{found}");
    let report = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(report.contains("\"evolution\":{"));
}

#[test]
fn a_missing_answer_of_the_world_agent_ends_the_run_and_names_it() {
    let Recorded { experiment, run, .. } = recorded();
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(run.join("cassette.jsonl")).unwrap();
    let of_agent = |line: &&str| {
        let line: Value = serde_json::from_str(line).unwrap();
        line["slot"]["role"] == "world_agent"
    };
    assert!(text.lines().any(|line| of_agent(&line)));
    let kept: Vec<&str> = text.lines().filter(|line| !of_agent(line)).collect();
    let cassette = folder.path().join("holed.jsonl");
    std::fs::write(&cassette, kept.join("\n") + "\n").unwrap();
    let (out, cassette) = (folder.path().join("runs"), cassette.to_str().unwrap());
    let ran = evodrive(&["run", experiment.to_str().unwrap(), "--out", out.to_str().unwrap(), "--cassette", cassette]);
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    let first = &of_kind(run, "world")[0]["body"]["epoch"];
    assert!(ran.stderr.contains(&format!("world/e{first}s0 world_agent round 0")), "{}", ran.stderr);
}

#[test]
fn the_world_agent_is_declared_with_its_table_and_its_model() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |change: fn(&mut toml::Table)| {
        let file = small(folder.path(), change);
        let ran = evodrive(&["run", file.to_str().unwrap(), "--out", folder.path().to_str().unwrap()]);
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        ran.stderr
    };
    let without_role = refused(|table| drop(table["roles"].as_table_mut().unwrap().remove("world_agent")));
    assert!(without_role.contains("roles.world_agent is missing"), "{without_role}");
    let without_table = refused(|table| drop(table.remove("world_agent")));
    assert!(without_table.contains("nothing without [world_agent]"), "{without_table}");
    let outside = refused(|table| table["world_agent"]["audit_share"] = vec![0.4, 0.5].into());
    assert!(outside.contains("low <= world.routing.audit_share = 0.33 <= high"), "{outside}");
    let turned = refused(|table| table["world_agent"]["audit_share"] = vec![0.5, 0.2].into());
    assert!(turned.contains("world_agent.audit_share is [0.5, 0.2], expected a low and a high end"), "{turned}");
    let called = refused(|table| table["lineage"][0]["id"] = "world".into());
    assert!(called.contains("turns of the world evaluator have that name"), "{called}");
}
