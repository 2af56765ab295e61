//! Counsel and composition in a whole run: when they are asked for, what they are an input of, and what a recording without
//! them says.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::harness::{Recorded, events, experiment, folder_below, record, run as evodrive, set, write_small};
use serde_json::Value;

/// LLM-Attacker's experiment with a few scenes, as `change` leaves it.
fn small(folder: &Path, change: impl FnOnce(&mut toml::Table)) -> PathBuf {
    let mut table = experiment("metadrive/llm_attacker-idm.toml");
    let changes = [
        ("scenes", "count", 14.into()),
        ("split", "held_out", 3.into()),
        ("split", "window", 4.into()),
        ("budget", "epochs", 2.into()),
        ("budget", "slots", 2.into()),
        ("budget", "probe_scenes", 1.into()),
        ("budget", "finalists", 1.into()),
    ];
    set(&mut table, &changes);
    table["split"]["evolution"]["count"] = 6.into();
    table["models"]["scripted"]["sampling"]["malformed_json_rate"] = 0.3.into();
    change(&mut table);
    write_small(folder, table)
}

/// One recorded run, shared: its folder, the experiment, the run folder, the root.
fn recorded() -> &'static Recorded {
    static RUN: OnceLock<Recorded> = OnceLock::new();
    RUN.get_or_init(|| record(|folder| small(folder, |_| {})))
}

#[test]
fn a_scene_is_counselled_before_its_first_label_and_held_out_scenes_after_selection() {
    let Recorded { run, .. } = recorded();
    let events = events(run);
    let kind = |event: &Value| event["kind"].as_str().unwrap().to_string();
    let scenes = |field: &str| -> Vec<String> {
        events[0]["body"][field].as_array().unwrap().iter().map(|s| s.as_str().unwrap().to_string()).collect()
    };
    let counsels: Vec<(usize, String)> = (0..events.len())
        .filter(|at| kind(&events[*at]) == "counsel")
        .map(|at| (at, events[at]["body"]["scene"].as_str().unwrap().to_string()))
        .collect();
    let counselled: Vec<&String> = counsels.iter().map(|(_, scene)| scene).collect();
    let wanted = [scenes("evolution_scenes"), scenes("held_out_scenes")].concat();
    assert_eq!(counselled, wanted.iter().collect::<Vec<_>>());
    let first = |wanted: &str| events.iter().position(|event| kind(event) == wanted).unwrap();
    let last = |wanted: &str| events.iter().rposition(|event| kind(event) == wanted).unwrap();
    let held_out = scenes("held_out_scenes");
    for (at, scene) in &counsels {
        if held_out.contains(scene) {
            assert!(*at > last("settled") && *at > last("finalist") && *at < first("held_out"), "{scene}");
        } else {
            assert!(*at < first("frozen"), "{scene}");
        }
    }
    // What the agents see before the suite is opened names no held-out scene.
    let asked = std::fs::read_to_string(run.join("cassette.jsonl")).unwrap();
    let lines: Vec<Value> = asked.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let texts = lines.iter().filter_map(|line| line["body"].as_str());
    let naming: Vec<&str> = texts.filter(|text| held_out.iter().any(|scene| text.contains(scene.as_str()))).collect();
    assert!(naming.iter().all(|text| text.starts_with("# Scene ")), "{naming:?}");
}

#[test]
fn answers_that_cannot_be_used_are_recorded_and_the_rules_propose() {
    let Recorded { run, .. } = recorded();
    let mut by_rules = 0;
    for event in events(run).iter().filter(|event| event["kind"] == "counsel") {
        let body = &event["body"];
        let (exchanges, rounds) = (body["exchanges"].as_array().unwrap(), body["rounds"].as_array().unwrap());
        assert_eq!(exchanges.len(), rounds.len());
        for (exchange, round) in exchanges.iter().zip(rounds) {
            assert_eq!(exchange["refusal"].is_string(), round["proposed_by"] == "rules", "{body}");
            by_rules += usize::from(round["proposed_by"] == "rules");
        }
        let (last, before) = rounds.split_last().expect("every generated scene has vehicles");
        assert!(before.iter().all(|round| round["trial"]["ended"] != "contact"), "a contact ends the search");
        let met = last["trial"]["ended"] == "contact";
        assert!(met || rounds.len() == 3, "{body}");
    }
    assert!(by_rules > 0, "three in ten answers are garbled");
}

#[test]
fn a_counselled_run_has_one_root_for_any_number_of_threads_and_verifies() {
    let Recorded { experiment, run, root, .. } = recorded();
    let out = tempfile::tempdir().unwrap();
    for jobs in ["1", "2"] {
        let out = out.path().join(jobs);
        let again = evodrive(&[
            "run",
            experiment.to_str().unwrap(),
            "--out",
            out.to_str().unwrap(),
            "--cassette",
            run.join("cassette.jsonl").to_str().unwrap(),
            "--jobs",
            jobs,
            "--no-report",
        ]);
        assert_eq!(&again.root(), root, "{jobs} threads, nothing cached");
    }
    for command in ["check", "verify", "resume"] {
        assert_eq!(evodrive(&[command, run.to_str().unwrap()]).root(), *root, "{command}");
    }
}

#[test]
fn the_counsel_of_a_scene_can_be_shown_and_is_in_the_report() {
    let Recorded { run, .. } = recorded();
    let event = events(run).into_iter().find(|event| event["kind"] == "counsel").unwrap();
    let name = format!("llm_attacker-idm/{}", event["body"]["scene"].as_str().unwrap());
    let shown = evodrive(&["show", &name, "--run", run.to_str().unwrap()]);
    assert_eq!(shown.code, 0, "{}", shown.stderr);
    for needed in ["sets tried:", "advised:", "attacker_agent round 0", "\"attacker_choice\""] {
        assert!(shown.stdout.contains(needed), "{needed}: {}", shown.stdout);
    }
    let report = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(report.contains("\"counsels\":[{"));
    // A report and a player made from the folder alone know the counsel too.
    assert_eq!(evodrive(&["report", run.to_str().unwrap()]).code, 0);
    assert_eq!(std::fs::read_to_string(run.join("report.html")).unwrap(), report);
}

#[test]
fn a_missing_answer_about_a_scene_ends_the_run_and_names_slot_and_role() {
    let Recorded { experiment, run, .. } = recorded();
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(run.join("cassette.jsonl")).unwrap();
    let removed = |line: &&str| {
        let line: Value = serde_json::from_str(line).unwrap();
        line["slot"]["role"] == "attacker_agent" && line["slot"]["slot"] == 4 && line["slot"]["round"] == 0
    };
    assert_eq!(text.lines().filter(removed).count(), 1);
    let kept: Vec<&str> = text.lines().filter(|line| !removed(line)).collect();
    let cassette = folder.path().join("holed.jsonl");
    std::fs::write(&cassette, kept.join("\n") + "\n").unwrap();
    let out = folder.path().join("runs");
    let ran = evodrive(&[
        "run",
        experiment.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
        "--cassette",
        cassette.to_str().unwrap(),
    ]);
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    assert!(ran.stderr.contains("llm_attacker-idm/e0s4 attacker_agent round 0"), "{}", ran.stderr);
}

#[test]
fn counsel_is_declared_exactly_where_a_family_takes_it() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |change: fn(&mut toml::Table)| {
        let file = small(folder.path(), change);
        let ran = evodrive(&["run", file.to_str().unwrap(), "--out", folder.path().to_str().unwrap()]);
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        ran.stderr
    };
    let without_role = refused(|table| drop(table["roles"].as_table_mut().unwrap().remove("attacker_agent")));
    assert!(without_role.contains("roles.attacker_agent is missing"), "{without_role}");
    let without_table = refused(|table| drop(table.remove("counsel")));
    assert!(without_table.contains("llm_attacker-idm takes counsel"), "{without_table}");
    let endless = refused(|table| table["counsel"]["rounds"] = 0.into());
    assert!(endless.contains("counsel.rounds is 0, expected a whole number from 1 to 8"), "{endless}");
    let idle = refused(|table| table["lineage"][0]["family"] = "cat".into());
    assert!(idle.contains("take [counsel] out"), "{idle}");
    let idle_role = refused(|table| {
        table["lineage"][0]["family"] = "cat".into();
        table.remove("counsel");
    });
    assert!(idle_role.contains("take attacker_agent out"), "{idle_role}");
}

/// ChatScene's experiment with two routes, as `change` leaves it.
fn described(folder: &Path, change: impl FnOnce(&mut toml::Table)) -> PathBuf {
    let mut table = experiment("safebench/chatscene-idm.toml");
    let changes = [
        ("split", "held_out", 2.into()),
        ("split", "window", 4.into()),
        ("budget", "epochs", 1.into()),
        ("budget", "slots", 1.into()),
        ("budget", "probe_scenes", 1.into()),
        ("budget", "finalists", 1.into()),
    ];
    set(&mut table, &changes);
    table["scenes"]["options"]["routes"] = vec![4, 5].into();
    table["scenes"]["options"]["draws"] = 1.into();
    table["evaluation"]["safebench"]["selected_per_group"] = 1.into();
    table["scenes"]["options"]["families"] = vec!["crossing_negotiation", "red_light_running", "right_turn"].into();
    table["split"]["evolution"]["count"] = 4.into();
    change(&mut table);
    write_small(folder, table)
}

#[test]
fn a_described_parent_is_composed_before_it_is_adopted_and_replays_to_the_same_root() {
    let folder = tempfile::tempdir().unwrap();
    let file = described(folder.path(), |_| {});
    let out = folder.path().join("runs");
    let (file, out) = (file.to_str().unwrap(), out.to_str().unwrap());
    let root = evodrive(&["record", file, "--out", out]).root();
    assert_eq!(evodrive(&["run", file, "--out", out, "--jobs", "2"]).root(), root);
    let run = folder_below(Path::new(out));
    let events = events(&run);
    let kinds: Vec<&str> = events.iter().map(|event| event["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds[..8], [&["opened"][..], &["composed"; 6], &["parent"]].concat());
    let crossing = events.iter().find(|event| event["body"]["kind"] == "crossing").unwrap();
    let (low, high) = (
        &crossing["body"]["template"]["ranges"]["speed_mps"][0],
        &crossing["body"]["template"]["ranges"]["speed_mps"][1],
    );
    let parameters = &events[7]["body"]["program"]["parameters"];
    assert_eq!((&parameters["crossing_speed_mps_low"], &parameters["crossing_speed_mps_high"]), (low, high));
    let shown = evodrive(&["show", "chatscene-idm/crossing", "--run", run.to_str().unwrap()]);
    assert!(shown.stdout.contains("composed: intercept"), "{}", shown.stdout);
}

#[test]
fn an_experiment_that_describes_what_no_family_takes_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |change: &dyn Fn(&mut toml::Table)| {
        let file = described(folder.path(), change);
        let ran = evodrive(&["run", file.to_str().unwrap()]);
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        ran.stderr
    };
    let kind = refused(&|table| {
        table["composition"]["descriptions"].as_table_mut().unwrap().insert("bridge".into(), "It falls.".into());
    });
    assert!(
        kind.contains(
            "composition.descriptions.bridge is unknown, expected one of roadside, turning, lane_change, passing"
        ),
        "{kind}"
    );
    let family = refused(&|table| table["lineage"][0]["family"] = "human".into());
    assert!(family.contains("no lineage's family takes templates; take [composition] out"), "{family}");
    let role = refused(&|table| drop(table["roles"].as_table_mut().unwrap().remove("template_agent")));
    assert!(role.contains("roles.template_agent is missing"), "{role}");
}
