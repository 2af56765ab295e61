//! OpenEvolve's database against recorded traces of the original: after every step the same islands, cells, archive, bests
//! and generations, and the same chances of every parent.

use std::collections::BTreeMap;

use evodrive::archive::openevolve::{Database, Member, OpenEvolveOptions};
use serde_json::{Value, json};

use crate::harness::shared;

/// Fields of the original's options that a trace leaves at their defaults.
fn options(config: &Value) -> OpenEvolveOptions {
    let mut whole = json!({"exploration_ratio": 0.2, "exploitation_ratio": 0.7, "elite_selection_ratio": 0.1});
    config.as_object().unwrap().iter().for_each(|(key, value)| whole[key] = value.clone());
    serde_json::from_value(whole).unwrap()
}

/// The whole text, or one with as many characters and lines and the same letters, of which the last number tells apart.
fn text(step: &Value) -> String {
    if let Some(code) = step["code"].as_str() {
        return code.into();
    }
    let (length, lines) = (step["text"][0].as_u64().unwrap() as usize, step["text"][1].as_u64().unwrap() as usize);
    let letters = step["text"][2].as_str().unwrap();
    let first = letters.chars().next().unwrap().to_string();
    let filled = format!("{letters}{}", first.repeat(length - lines - letters.chars().count()));
    let ends = "\n".repeat(lines);
    if step["text"][3] == 0 { format!("{filled}{ends}") } else { format!("{ends}{filled}") }
}

/// The database's state in the words of the traces.
fn state(database: &Database) -> Value {
    let whole = serde_json::to_value(database).unwrap();
    let sorted = |names: &Value| {
        let mut names: Vec<String> = serde_json::from_value(names.clone()).unwrap();
        names.sort();
        json!(names)
    };
    let ids: Vec<Value> = whole["members"].as_array().unwrap().iter().map(|member| member["id"].clone()).collect();
    json!({
        "islands": whole["islands"].as_array().unwrap().iter().map(sorted).collect::<Vec<Value>>(),
        "cells": whole["cells"],
        "archive": sorted(&whole["archive"]),
        "best": whole["best"],
        "island_best": whole["island_best"],
        "programs": sorted(&json!(ids)),
        "generations": whole["generations"],
        "last_migration": whole["last_migration"],
    })
}

/// Replays one scenario; the number of states that were compared.
fn replay(scenario: &Value) -> usize {
    let (name, mut compared) = (scenario["name"].as_str().unwrap(), 0);
    let mut database = Database::new(options(&scenario["config"]));
    // No trace comes to a random number.
    let mut none = || -> f64 { panic!("{name}: a trace draws nothing") };
    for (place, step) in scenario["steps"].as_array().unwrap().iter().enumerate() {
        let island = step.get("target_island").unwrap_or(&step["island"]).as_u64().unwrap() as usize;
        let metrics: BTreeMap<String, f64> =
            step.get("metrics").map(|metrics| serde_json::from_value(metrics.clone()).unwrap()).unwrap_or_default();
        let (id, fitness) = (step["id"].as_str().unwrap().to_string(), step["fitness"].as_f64().unwrap());
        database.add(Member { id, code: text(step), metrics, fitness, copy_of: None }, island, &mut none);
        // The program with which the search begins was not made for an island.
        let migrated = place > 0 && database.advance(island, &mut none);
        assert_eq!(migrated, step["migrated"] == true, "{name}, step {place}");
        if let Some(after) = step.get("after") {
            assert_eq!(state(&database), *after, "{name}, step {place}");
            compared += 1;
        }
    }
    compared
}

fn check_chances(cases: &Value) {
    for case in cases.as_array().unwrap() {
        let island = case["island"].as_u64().unwrap() as usize;
        let names = |key: &str| -> Vec<String> { serde_json::from_value(case[key].clone()).unwrap() };
        let (members, archived) = (names("members"), names("archive_in_island"));
        let mut database = Database::new(OpenEvolveOptions {
            archive_size: archived.len(),
            ..options(&json!({
                "num_islands": 2, "archive_size": 0, "population_size": 1000, "feature_dimensions": ["own"],
                "feature_bins": 1000, "migration_interval": 50, "migration_rate": 0.1, "diversity_reference_size": 20,
            }))
        });
        // The archive takes who comes first, and keeps the best: so it is filled with those whom the trace names.
        for (place, id) in members.iter().enumerate() {
            let fitness = case["fitness"][id].as_f64().unwrap();
            let metrics = BTreeMap::from([("own".to_string(), if place == 0 { 0.0 } else { 1.0 / place as f64 })]);
            let member = Member { id: id.clone(), code: id.clone(), metrics, fitness, copy_of: None };
            database.add(member, island, &mut || 0.0);
        }
        let wanted: BTreeMap<String, f64> = serde_json::from_value(case["probability"].clone()).unwrap();
        let found = database.parent_probabilities(island);
        assert_eq!(found.len(), wanted.len());
        for (id, chance) in found {
            assert!((chance - wanted[id]).abs() < 1e-12, "{id}: {chance}, the original {}", wanted[id]);
        }
        // What is drawn has those chances: a fine grid of random numbers counts them out.
        let mut counted: BTreeMap<String, f64> = BTreeMap::new();
        for kind in 0..200 {
            for place in 0..200 {
                let parent = database.parent(island, (f64::from(kind) + 0.5) / 200.0, (f64::from(place) + 0.5) / 200.0);
                *counted.entry(parent.unwrap().id.clone()).or_default() += 1.0 / 40_000.0;
            }
        }
        for (id, chance) in &wanted {
            assert!((counted[id] - chance).abs() < 0.006, "{id}: drawn {}, the original {chance}", counted[id]);
        }
    }
}

#[test]
fn the_database_follows_the_recorded_traces_of_the_original_step_for_step() {
    let facts: Value = serde_json::from_str(include_str!("../fixtures/openevolve/traces.json")).unwrap();
    let compared: usize = facts["scenarios"].as_array().unwrap().iter().map(replay).sum();
    assert_eq!(compared, 8 + 9 + 6, "every fifth step of 40, 45 and 30");
    check_chances(&facts["parent_probabilities"]);
}

#[test]
fn the_database_follows_the_whole_traces() {
    let Some(file) = shared("cases/openevolve.json") else { return };
    let cases: Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    let compared: usize = cases["scenarios"].as_array().unwrap().iter().map(replay).sum();
    assert_eq!(compared, 18 + 18 + 40 + 45 + 30);
    check_chances(&cases["parent_probabilities"]);
}

#[test]
fn inspirations_are_the_best_then_neighbours_then_anybody_and_never_the_parent() {
    let options = options(&json!({
        "num_islands": 1, "archive_size": 10, "population_size": 100, "feature_dimensions": ["own"],
        "feature_bins": 10, "migration_interval": 50, "migration_rate": 0.1, "diversity_reference_size": 20,
    }));
    let mut database = Database::new(options);
    for place in 0..10_u32 {
        let own = f64::from(place) / 10.0;
        // The range is known from the first two on, so that every program has a cell of its own.
        let own = if place == 1 { 0.999 } else { own };
        let metrics = BTreeMap::from([("own".to_string(), own)]);
        let id = format!("p{place}");
        database.add(Member { code: id.clone(), id, metrics, fitness: own, copy_of: None }, 0, &mut || 0.0);
    }
    for seed in 0..200_u32 {
        let mut calls = 0_u32;
        let mut draw = || {
            calls += 1;
            f64::from((seed * 7919 + calls * 104_729) % 1000) / 1000.0
        };
        let drawn = database.sample(0, 3, &mut draw).unwrap();
        let distinct: std::collections::BTreeSet<&String> = drawn.inspirations.iter().collect();
        assert_eq!((drawn.inspirations.len(), distinct.len()), (3, 3), "{drawn:?}");
        assert!(!drawn.inspirations.contains(&drawn.parent), "{drawn:?}");
        if drawn.parent != "p1" {
            assert_eq!(drawn.inspirations[0], "p1", "the island's best comes first: {drawn:?}");
        }
    }
}

#[test]
fn an_equal_takes_no_cell_and_lives_on_its_island_all_the_same() {
    let options = options(&json!({
        "num_islands": 1, "archive_size": 1, "population_size": 100, "feature_dimensions": ["own"],
        "feature_bins": 10, "migration_interval": 50, "migration_rate": 0.1, "diversity_reference_size": 20,
    }));
    let mut database = Database::new(options);
    for id in ["first", "equal"] {
        let metrics = BTreeMap::from([("own".to_string(), 0.5)]);
        let member = Member { id: id.into(), code: id.into(), metrics, fitness: 0.5, copy_of: None };
        database.add(member, 0, &mut || 0.0);
    }
    let found = state(&database);
    assert_eq!(found["cells"], json!([{"5": "first"}]));
    assert_eq!(found["islands"], json!([["equal", "first"]]));
    assert_eq!((&found["archive"], &found["best"]), (&json!(["first"]), &json!("first")));
}
