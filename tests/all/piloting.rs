//! A pilot in a whole run: candidates are simulated in a few scenes before anybody is ranked, and the record says where and what
//! came of it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::harness::{Recorded, events, experiment, record, run as evodrive, set, write_small};
use serde_json::Value;

const SCENES: usize = 2;

fn small(folder: &Path, change: impl FnOnce(&mut toml::Table)) -> PathBuf {
    let mut table = experiment("world/pilot.toml");
    let changes = [
        ("scenes", "count", 24.into()),
        ("split", "held_out", 2.into()),
        ("split", "window", 8.into()),
        ("budget", "epochs", 3.into()),
        ("budget", "slots", 6.into()),
        ("budget", "probe_scenes", 2.into()),
        ("budget", "finalists", 1.into()),
        ("world", "trees", 5.into()),
    ];
    set(&mut table, &changes);
    table["split"]["evolution"]["count"] = 16.into();
    let routing = table["world"]["routing"].as_table_mut().unwrap();
    routing.insert("rollout_budget".into(), 2.into());
    routing["pilot"]["scenes"] = (SCENES as i64).into();
    // Every contact counts, so that parents have some attack.
    let attack = table["evaluation"]["attack"].as_table_mut().unwrap();
    let classes = ["counts", "counts_if_avoidable"].map(|key| attack[key].as_array().unwrap().clone()).concat();
    attack.insert("counts".into(), classes.into());
    attack.insert("counts_if_avoidable".into(), toml::Value::Array(Vec::new()));
    table.insert("seeds".into(), 1.into());
    change(&mut table);
    write_small(folder, table)
}

/// The labels of a score: scene -> attack and realism.
fn labels(score: &Value) -> BTreeMap<String, (f64, f64)> {
    let of = |scene: &Value| (scene["attack"].as_f64().unwrap(), scene["realism"].as_f64().unwrap());
    let scenes = score["scenes"].as_array().unwrap();
    scenes.iter().map(|scene| (scene["scene"].as_str().unwrap().to_string(), of(scene))).collect()
}

fn bodies(run: &Path, kind: &str) -> Vec<Value> {
    events(run).into_iter().filter(|event| event["kind"] == kind).map(|event| event["body"].clone()).collect()
}

#[test]
fn pilots_rank_the_candidates_and_say_what_they_saw() {
    let Recorded { experiment, run, root, .. } = &record(|folder| small(folder, |_| {}));
    let frozen: BTreeMap<(String, u64), Value> = bodies(run, "frozen")
        .into_iter()
        .map(|body| ((body["lineage"].to_string(), body["epoch"].as_u64().unwrap()), body))
        .collect();
    let mut epochs: BTreeMap<(String, u64), Vec<(f64, bool)>> = BTreeMap::new();
    let (mut compared, mut of_rejected) = (0, 0);
    for attempt in bodies(run, "attempt") {
        let exit = &attempt["exit"];
        let Some(route) = Some(&exit["route"]).filter(|route| !route.is_null()) else { continue };
        let key = (attempt["lineage"].to_string(), attempt["epoch"].as_u64().unwrap());
        let before = &frozen[&key];
        let window: Vec<&str> = before["window"].as_array().unwrap().iter().map(|id| id.as_str().unwrap()).collect();
        let pilot = &route["pilot"];
        let seen: Vec<&str> = pilot["scenes"].as_array().unwrap().iter().map(|id| id.as_str().unwrap()).collect();
        assert!(seen.len() <= SCENES && seen.iter().all(|id| window.contains(id)), "{pilot}");
        let selected = route["decision"] == "select";
        epochs.entry(key).or_default().push((route["rank_score"].as_f64().unwrap(), selected));
        of_rejected += usize::from(!selected && pilot["labelled"].as_u64().unwrap() > 0);
        let second = before["portfolio"].as_object().filter(|_| attempt["slot"].as_u64().unwrap() % 3 == 2);
        let parent = second.map_or(&before["parent_score"], |second| &second["parent_score"]);
        if let (true, Some(score)) = (selected, Some(&exit["score"]).filter(|score| !score.is_null())) {
            let (own, parent) = (labels(score), labels(parent));
            let pairs = seen.iter().filter_map(|id| Some([own.get(*id)?, parent.get(*id)?]));
            let pairs: Vec<[&(f64, f64); 2]> = pairs.collect();
            assert_eq!(pilot["labelled"].as_u64().unwrap() as usize, pairs.len());
            let mean = pairs.iter().map(|[own, parent]| own.0 - parent.0).sum::<f64>() / pairs.len().max(1) as f64;
            assert!((pilot["difference"]["attack"].as_f64().unwrap() - mean).abs() < 1e-12, "{pilot} {mean}");
            let mean = pairs.iter().map(|[own, parent]| own.1 - parent.1).sum::<f64>() / pairs.len().max(1) as f64;
            assert!((pilot["difference"]["realism"].as_f64().unwrap() - mean).abs() < 1e-12, "{pilot} {mean}");
            compared += usize::from(!pairs.is_empty());
        }
    }
    assert!(compared >= 3 && of_rejected >= 3, "{compared} pilots to compare, {of_rejected} of the rejected");
    // From the first epoch on the best by rank are simulated whole, though nothing was labelled before.
    for (epoch, ranked) in &epochs {
        assert_eq!(ranked.iter().filter(|(_, selected)| *selected).count(), ranked.len().min(2), "{epoch:?}");
        let least = ranked.iter().filter(|(_, selected)| *selected).map(|(score, _)| *score).fold(f64::MAX, f64::min);
        assert!(ranked.iter().all(|(score, selected)| *selected || *score <= least), "{epoch:?} {ranked:?}");
    }

    let cassette = run.join("cassette.jsonl");
    let out = tempfile::tempdir().unwrap();
    let (file, out) = (experiment.to_str().unwrap(), out.path().to_str().unwrap());
    let again = ["run", file, "--out", out, "--cassette", cassette.to_str().unwrap(), "--jobs", "2", "--no-report"];
    assert_eq!(&evodrive(&again).root(), root, "another number of threads");

    let beside = evodrive(&["world", run.to_str().unwrap(), "--full", run.to_str().unwrap(), "--json"]);
    let beside: Value = serde_json::from_str(&beside.stdout).unwrap();
    assert_eq!((beside["rollout_share"].as_f64(), beside["candidate_share"].as_f64()), (Some(1.0), Some(1.0)));
    // What doing nothing would reach: the parents alone, on the pool that the windows have opened.
    let last = |kind: &str| bodies(run, kind);
    let area: BTreeMap<String, f64> = last("settled")
        .iter()
        .map(|body| (body["lineage"].to_string(), body["hypervolume"].as_f64().unwrap()))
        .collect();
    let alone: Vec<f64> = last("finalist")
        .iter()
        .filter(|body| body["solution"].as_str().unwrap().ends_with("/parent"))
        .map(|body| &body["score"]["objectives"])
        .map(|of| of["attack"].as_f64().unwrap() * of["realism"].as_f64().unwrap())
        .collect();
    assert_eq!(alone.len(), area.len());
    let expected = alone.iter().sum::<f64>() / area.values().sum::<f64>();
    let share = beside["parents_share"].as_f64().expect("the windows opened the whole pool");
    assert!((share - expected).abs() < 1e-9 && share > 0.0, "{share} {expected}");
}

#[test]
fn a_budgeted_run_counts_its_pilots_among_its_rollouts() {
    let piloted = record(|folder| small(folder, |_| {}));
    let plain = record(|folder| {
        small(folder, |table| {
            table["world"]["routing"].as_table_mut().unwrap().remove("pilot");
            table["world"]["routing"]["choice"] = "random".into();
        })
    });
    let attempts = |run: &Path| bodies(run, "attempt");
    assert!(attempts(&plain.run).iter().all(|attempt| attempt["exit"]["route"]["pilot"].is_null()));
    let rollouts = |run: &Path| -> usize {
        let of = |attempt: &Value| match attempt["exit"]["score"]["scenes"].as_array() {
            Some(scenes) => scenes.len(),
            None => attempt["exit"]["route"]["pilot"]["scenes"].as_array().map_or(0, Vec::len),
        };
        attempts(run).iter().map(of).sum()
    };
    let (own, other) = (piloted.run.to_str().unwrap(), plain.run.to_str().unwrap());
    let beside = evodrive(&["world", own, "--full", other, "--json"]);
    let beside: Value = serde_json::from_str(&beside.stdout).unwrap();
    let share = beside["rollout_share"].as_f64().expect("a front with an area");
    let expected = rollouts(&piloted.run) as f64 / rollouts(&plain.run) as f64;
    assert!((share - expected).abs() < 1e-9, "{share} {expected}");
}
