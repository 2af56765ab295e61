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
            population_size: 1000,
            feature_bins: 1000,
            ..one_axis(2)
        });
        // The archive takes who comes first, and keeps the best: so it is filled with those whom the trace names.
        for (place, id) in members.iter().enumerate() {
            let fitness = case["fitness"][id].as_f64().unwrap();
            let own = if place == 0 { 0.0 } else { 1.0 / place as f64 };
            database.add(standing_at(id, own, fitness), island, &mut || 0.0);
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

/// Options of one grid axis, the metric `own`, of ten bins.
fn one_axis(islands: usize) -> OpenEvolveOptions {
    options(&json!({
        "num_islands": islands, "archive_size": 10, "population_size": 100, "feature_dimensions": ["own"],
        "feature_bins": 10, "migration_interval": 50, "migration_rate": 0.1, "diversity_reference_size": 20,
    }))
}

fn standing_at(id: &str, own: f64, fitness: f64) -> Member {
    Member {
        id: id.into(),
        code: id.into(),
        metrics: BTreeMap::from([("own".to_string(), own)]),
        fitness,
        copy_of: None,
    }
}

/// One island of ten. `first` holds cell 5, the only one that there was, and stands in bin 0 since the axis is whole; `best` stands
/// in bin 4; `early` and `late` both in bin 6, which `early` holds; the others in the bin of their name.
fn ten() -> Database {
    let mut database = Database::new(one_axis(1));
    let members =
        [("first", 0.0, 0.3), ("b9", 1.0, 0.2), ("best", 0.45, 0.9), ("early", 0.65, 0.5), ("late", 0.65, 0.5)];
    let rest = [("b1", 0.15, 0.1), ("b2", 0.25, 0.1), ("b3", 0.35, 0.1), ("b7", 0.75, 0.1), ("b8", 0.85, 0.1)];
    for (id, own, fitness) in members.into_iter().chain(rest) {
        database.add(standing_at(id, own, fitness), 0, &mut || panic!("nothing is drawn"));
    }
    assert_eq!(
        (&state(&database)["cells"][0]["5"], &state(&database)["cells"][0]["6"]),
        (&json!("first"), &json!("early"))
    );
    database
}

/// Two inspirations for a parent, who is drawn from the whole island, with these numbers and no other.
fn inspired(database: &mut Database, parent: &str, numbers: &[f64]) -> Vec<String> {
    let members = serde_json::to_value(&*database).unwrap()["islands"][0].as_array().unwrap().clone();
    let place = members.iter().position(|id| id == parent).unwrap();
    let drawn_first = [0.0, (place as f64 + 0.5) / members.len() as f64];
    let mut numbers = drawn_first.into_iter().chain(numbers.iter().copied());
    let drawn = database.sample(0, 2, &mut || numbers.next().expect("no more numbers")).unwrap();
    assert_eq!((drawn.parent.as_str(), numbers.next()), (parent, None), "{:?}", drawn.inspirations);
    drawn.inspirations
}

#[test]
fn inspirations_are_the_best_and_who_stands_at_most_two_bins_from_the_parent() {
    let steps = [0.0, 0.25, 0.5, 0.75, 0.999];
    let near = |parent: &str, step: usize| inspired(&mut ten(), parent, &[steps[step]]);
    assert_eq!(near("b2", 0), ["best", "first"], "where it stands today, not the cell that it holds");
    assert_eq!((near("b2", 1), near("b2", 3)), (vec!["best".into(), "b1".into()], vec!["best".into(), "b3".into()]));
    assert_eq!(near("b8", 0), ["best", "late"], "of two in one place the latest, also without a cell");
    assert_eq!((near("b8", 1)[1].as_str(), near("b8", 3)[1].as_str()), ("b7", "b9"));
    assert_eq!(near("b8", 4)[1], "b9", "the axis ends");
    assert_eq!(near("b1", 4)[1], "b3", "two bins to the other side");
    assert_eq!((near("b1", 0)[1].as_str(), near("b3", 0)[1].as_str()), ("first", "b1"), "at both ends");
    // The parent itself, the best once more and an empty bin are tries in vain.
    assert_eq!(inspired(&mut ten(), "b3", &[0.5, 0.75, 0.25]), ["best", "b2"]);
    assert_eq!(inspired(&mut ten(), "late", &[0.25, 0.0, 0.75]), ["best", "b7"]);
    // Who is the best itself has two places to fill.
    assert_eq!(inspired(&mut ten(), "best", &[0.0, 0.0, 0.5, 0.25]), ["b2", "b3"]);
}

#[test]
fn where_nobody_is_near_inspirations_are_anybody_else_of_the_island() {
    // Three tries a place, then one number for who it is, in order of insertion.
    assert_eq!(inspired(&mut ten(), "b3", &[0.5, 0.5, 0.5, 0.0]), ["best", "first"]);
    assert_eq!(inspired(&mut ten(), "b3", &[0.5, 0.5, 0.5, 0.999]), ["best", "b8"]);
    assert_eq!(inspired(&mut ten(), "b3", &[0.5, 0.5, 0.5, 0.26]), ["best", "early"]);
    assert_eq!(inspired(&mut ten(), "best", &[0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.0, 0.0]), ["first", "b9"]);
}

#[test]
fn a_small_island_shows_its_best_alone() {
    let mut database = Database::new(one_axis(1));
    database.add(standing_at("first", 0.0, 0.2), 0, &mut || 0.0);
    database.add(standing_at("best", 1.0, 0.9), 0, &mut || 0.0);
    assert_eq!(inspired(&mut database, "first", &[]), ["best"]);
    assert!(
        inspired(&mut database, "best", &[]).is_empty(),
        "the original fills up only where more live than are shown"
    );
}

#[test]
fn an_empty_island_takes_its_parent_from_the_first_and_has_no_inspirations() {
    let mut database = Database::new(one_axis(3));
    for (id, own, island) in [("first", 0.0, 0), ("second", 0.5, 3), ("far", 1.0, 5)] {
        database.add(standing_at(id, own, own), island, &mut || 0.0);
    }
    assert_eq!(state(&database)["islands"], json!([["first", "second"], [], ["far"]]), "numbers of islands count on");
    let mut draws = [0.1, 0.9].into_iter();
    let drawn = database.sample(4, 2, &mut || draws.next().unwrap()).unwrap();
    assert_eq!((drawn.parent.as_str(), drawn.inspirations.len()), ("second", 0));
    assert_eq!(database.top("second", 2), ["second", "first"], "the best of the island that it lives on come first");
    assert_eq!(
        (database.top("second", 1), database.top("far", 3)),
        (vec!["second".to_string()], vec!["far".to_string()])
    );
}

#[test]
fn an_equal_takes_no_cell_and_lives_on_its_island_all_the_same() {
    let mut database = Database::new(OpenEvolveOptions { archive_size: 1, ..one_axis(1) });
    for id in ["first", "equal"] {
        database.add(standing_at(id, 0.5, 0.5), 0, &mut || 0.0);
    }
    let found = state(&database);
    assert_eq!(found["cells"], json!([{"5": "first"}]));
    assert_eq!(found["islands"], json!([["equal", "first"]]));
    assert_eq!((&found["archive"], &found["best"]), (&json!(["first"]), &json!("first")));
}

#[test]
fn an_island_whose_best_had_to_make_room_has_the_best_of_those_who_are_left() {
    let mut database = Database::new(OpenEvolveOptions { population_size: 2, ..one_axis(2) });
    for (id, own, fitness, island) in [("top", 0.0, 0.9, 0), ("second", 1.0, 0.3, 1), ("newcomer", 0.5, 0.1, 1)] {
        database.add(standing_at(id, own, fitness), island, &mut || 0.0);
    }
    // The best of all and who came last stay.
    let found = state(&database);
    assert_eq!((&found["programs"], &found["island_best"]), (&json!(["newcomer", "top"]), &json!(["top", "newcomer"])));
}
