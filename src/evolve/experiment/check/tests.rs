//! Every option of every table refuses what it cannot use, with its path, what was found and what is expected.

use super::*;
use crate::evaluation::DIAGNOSTICS;
use crate::experiment::key::Range;
use std::path::Path;

/// Whole experiments that together hold every kind of table.
fn whole() -> Vec<Table> {
    let shipped = [
        "metadrive/llm_attacker-idm",
        "metadrive/sage-idm",
        "safebench/chatscene-idm",
        "live_example",
        "recorded_traffic",
        "agreement/metadrive",
        "world/evolving",
        "world/pilot",
        "ablations/openevolve",
        "ablations/nsga2",
        "ablations/random",
        "preventable",
        "published",
        "readings/published-idm",
        "readings/null-random-idm",
        "llm/preventable/cat",
        "safebench/preventable-idm",
        "reproduction-safebench",
        "worlds/scripted",
        "league/scripted-all",
    ];
    let path = |name: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../experiments/{name}.toml"));
    let mut all: Vec<Table> =
        shipped.iter().map(|name| crate::experiment::composed(&path(name)).unwrap().table).collect();
    // No shipped file asks for the least attack over drivers.
    let several = all.last_mut().expect("the lineages with several drivers");
    for lineage in several["lineage"].as_array_mut().unwrap() {
        lineage.as_table_mut().unwrap().insert("over_egos".into(), "worst".into());
    }
    let mut pool = all[4].clone();
    pool.insert(
        "scenes".into(),
        toml::toml! { source = "pool"
        path = "my.pool" }
        .into(),
    );
    all.push(pool);
    // A run that does without everything.
    let mut bare = all[0].clone();
    bare["budget"].as_table_mut().unwrap().insert("rehearsals".into(), 4.into());
    let parts = ["critics", "repair", "memory", "conditions", "mechanisms", "isolation", "audit", "tradeoff"];
    let parts: Table = parts.map(|part| (part.to_string(), Value::Boolean(true))).into_iter().collect();
    bare.insert("without".into(), parts.into());
    all.push(bare);
    // Models behind a folder and a program, which no shipped experiment names.
    let mut behind = all[3].clone();
    let models = behind["models"].as_table_mut().unwrap();
    models.insert(
        "agent".into(),
        toml::toml! { kind = "exchange"
        model = "somebody"
        provenance = "by hand" }
        .into(),
    );
    models.insert(
        "mine".into(),
        toml::toml! { kind = "command"
        model = "mine-1"
        provenance = "a script"
        command = { program = ["my_model"], files = ["my_model.py"], tries = true, timeout_s = 60 } }
        .into(),
    );
    let client = models["claude"].get_mut("client").unwrap().as_table_mut().unwrap();
    client.extend(toml::toml! {
        api_key_env = "KEY"
        api_key_header = "api-key"
        query = { api-version = "1" }
        headers = { x-title = "EvoDrive" }
        cached_input_usd_per_million = 0.1
        cache_write_usd_per_million = 0.2
    });
    models.insert(
        "mix".into(),
        toml::toml! { kind = "drawn"
        model = "mix"
        unwrap = true
        shares = { agent = 2.0, mine = 1.0 } }
        .into(),
    );
    all.push(behind);
    // A planner and an attack of one's own; what a run folder keeps of the planner.
    let mut own = crate::experiment::composed(&path("../examples/own_ego/idm")).unwrap().table;
    let driver = own["driver"].as_table_mut().unwrap();
    driver.insert("digest".into(), "0".repeat(64).into());
    driver.insert("folder".into(), "somewhere".into());
    driver.insert("observe".into(), "metadrive-1".into());
    driver.insert("blind".into(), true.into());
    own["split"].as_table_mut().unwrap().insert("plain_contacts".into(), "keep".into());
    own["evaluation"]["attack"].as_table_mut().unwrap().insert("when".into(), "contact_adversary".into());
    let weights = own["evaluation"]["realism"]["weights"].as_table_mut().unwrap();
    for of in DIAGNOSTICS {
        weights.entry(of.name()).or_insert(0.1.into());
    }
    let measured = toml::toml! { impact_speed = "contact_speed_mps" };
    own["evaluation"].as_table_mut().unwrap().insert("metrics".into(), measured.into());
    own["simulator"].as_table_mut().unwrap().extend(toml::toml! { at_fault = true
    jury = true });
    own.insert("without".into(), toml::toml! { sight = true }.into());
    // The same with the ready expression in its place.
    let mut blaming = own.clone();
    let attack = blaming["evaluation"]["attack"].as_table_mut().unwrap();
    attack.remove("when");
    attack.insert("reading".into(), "at_fault".into());
    all.extend([own, blaming]);
    all
}

/// A table with another value at a path.
fn with(table: &Table, path: &[Step], value: &Value) -> Table {
    let mut root = Value::Table(table.clone());
    let mut place = &mut root;
    for step in path {
        place = match step {
            Step::Key(key) => place.get_mut(key).unwrap(),
            Step::Index(i) => place.get_mut(*i).unwrap(),
        };
    }
    *place = value.clone();
    match root {
        Value::Table(table) => table,
        _ => unreachable!("the root is a table"),
    }
}

/// Values that a range does not hold: beyond both ends, and of other types.
fn wrong(range: &Range) -> Vec<Value> {
    let mut values = vec![Value::Boolean(true), Value::Table(Table::new())];
    match range {
        Range::Whole(least, most) => {
            values.extend([(least - 1).into(), 0.5.into(), "1".into()]);
            values.extend(most.checked_add(1).map(Value::Integer));
        }
        Range::Number(least, most) => {
            values.extend([
                (least - 1e-6).into(),
                (most * 1.1 + 1e-6).into(),
                f64::NAN.into(),
                f64::INFINITY.into(),
                "1".into(),
            ]);
        }
        Range::Above(least, most) => values.extend([(*least).into(), (most * 1.1).into(), f64::NAN.into(), "1".into()]),
        Range::Text(most) => values.extend(["".into(), "x".repeat(most + 1).into(), 1.into()]),
        Range::Unshown => values.push(1.into()),
        Range::Name => values.extend(["".into(), "A".into(), "a/b".into(), "x".repeat(65).into()]),
        Range::Word(_) => values.extend(["".into(), "no such word".into()]),
        Range::Words(_) => values.extend([Value::Array(vec![]), vec!["no such word"].into()]),
        Range::Subset(_) => values.push(vec!["no such word"].into()),
        Range::Texts { empty } => {
            values.extend([vec![1].into(), vec![""].into()]);
            values.extend((!empty).then(|| Value::Array(vec![])));
        }
        Range::Wholes(least, most) => {
            values.extend([Value::Array(vec![]), vec![least - 1].into(), vec![most + 1].into()])
        }
        Range::Pair(least, below) => values.extend([vec![*least].into(), vec![*least, *below].into()]),
        Range::Ends(least, most) => {
            values.extend([vec![*least].into(), vec![*most, *least].into(), vec![*least, most + 1.0].into()])
        }
        Range::Truth => {
            values.remove(0);
            values.extend([1.into(), "true".into()]);
        }
        Range::Any => values.clear(),
    }
    values
}

#[test]
fn every_option_of_every_table_refuses_wrong_values_by_path_found_and_expected() {
    let (tables, mut tried) = (whole(), 0);
    for table in &tables {
        assert_eq!(check(table), Ok(()));
    }
    let mut absent = Vec::new();
    for key in keys() {
        let paths = |table: &Table| {
            let root = Value::Table(table.clone());
            expanded(&root, &parts(key.key)).into_iter().find(|path| at(&root, path).is_some())
        };
        let Some((table, path)) = tables.iter().find_map(|table| Some((table, paths(table)?))) else {
            absent.push(key.key);
            continue;
        };
        for value in wrong(&key.range) {
            let error = check(&with(table, &path, &value)).expect_err(&format!("{} = {value}", key.key));
            assert!(error.path.starts_with(&text(&path)), "{}: {error}", key.key);
            match key.range {
                Range::Word(_) | Range::Words(_) => assert!(error.expected.contains("one "), "{error}"),
                Range::Subset(_) => assert!(error.expected.contains(" of "), "{error}"),
                _ => assert_eq!(error.expected, key.range.to_string()),
            }
            if let Range::Whole(..) | Range::Number(..) | Range::Above(..) = key.range {
                assert_eq!(error.found, value.to_string());
            }
            tried += 1;
        }
        // Keys that must be there are missed.
        if matches!(key.need, Need::Always | Need::Of(..)) {
            let mut without = Value::Table(table.clone());
            let (Some(Step::Key(last)), parent) = (path.last(), &path[..path.len() - 1]) else { continue };
            let mut place = &mut without;
            for step in parent {
                place = match step {
                    Step::Key(key) => place.get_mut(key).unwrap(),
                    Step::Index(i) => place.get_mut(*i).unwrap(),
                };
            }
            place.as_table_mut().unwrap().remove(last);
            let missing = check(without.as_table().unwrap()).expect_err(key.key);
            assert_eq!((missing.path.as_str(), missing.found.as_str()), (text(&path).as_str(), "missing"));
        }
    }
    assert!(tried > 500, "{tried} wrong values");
    // What none of these experiments uses.
    let unused = ["top_k", "min_p", "max_completion_tokens", "frequency_penalty", "presence_penalty"];
    let unused = unused.map(|name| format!("models.*.sampling.{name}"));
    let others = ["seed_note", "lineage[].published"].map(String::from);
    let of_arms = ["archive.challengers", "search.tuning.draws", "search.tuning.scenes"].map(String::from);
    assert_eq!(absent, others.into_iter().chain(unused).chain(of_arms).collect::<Vec<_>>());
}

/// The error of recorded_traffic's experiment with a change.
fn refused(change: impl Fn(&mut Table)) -> String {
    let mut table = whole().remove(4);
    change(&mut table);
    check(&table).unwrap_err().to_string()
}

#[test]
fn an_unknown_key_is_named_with_the_nearest_known_one() {
    let budget = refused(|table| drop(table["budget"].as_table_mut().unwrap().insert("slot".into(), 3.into())));
    assert!(budget.starts_with("budget.slot is unknown, expected one of epochs, slots"), "{budget}");
    assert!(budget.ends_with("did you mean `slots`?"), "{budget}");
    let table = refused(|table| drop(table.insert("selecter".into(), Table::new().into())));
    assert!(table.contains("selecter is unknown") && table.ends_with("did you mean `selector`?"), "{table}");
}

#[test]
fn words_are_refused_with_the_nearest_one() {
    let family = refused(|table| table["lineage"][0]["family"] = "catt".into());
    assert!(family.starts_with("lineage[0].family is \"catt\", expected one of "), "{family}");
    assert!(family.ends_with("did you mean `cat`?"), "{family}");
    let ego = refused(|table| table["lineage"][1]["ego"] = "idmm".into());
    assert!(ego.contains("lineage[1].ego") && ego.ends_with("did you mean `idm`?"), "{ego}");
}

#[test]
fn what_another_option_leaves_unread_is_refused() {
    let count = refused(|table| drop(table["scenes"].as_table_mut().unwrap().insert("count".into(), 3.into())));
    assert_eq!(
        count,
        "scenes.count is 3, expected nothing: it is only used with scenes.source = synth, and scenes.source is \"files\""
    );
    let table = refused(|table| drop(table.insert("budget".into(), 3.into())));
    assert_eq!(table, "budget is 3, expected a table");
    let list = refused(|table| drop(table.insert("lineage".into(), "cat".into())));
    assert_eq!(list, "lineage is \"cat\", expected a list of tables");
}

#[test]
fn the_size_of_evolution_has_one_form() {
    let both =
        refused(|table| drop(table["split"]["evolution"].as_table_mut().unwrap().insert("count".into(), 3.into())));
    assert!(both.starts_with("split.evolution is {") && both.ends_with("one of the two"), "{both}");
    let none = refused(|table| drop(table["split"].as_table_mut().unwrap().remove("evolution")));
    assert!(none.starts_with("split.evolution is missing, expected `{ count"), "{none}");
}

#[test]
fn a_key_in_the_wrong_place_is_not_repeated() {
    let mut table = whole().remove(3);
    table["models"]["claude"]["client"]["api_key_env"] = vec!["sk-secret"].into();
    let error = check(&table).unwrap_err().to_string();
    assert!(error.contains("models.claude.client.api_key_env") && !error.contains("secret"), "{error}");
}
