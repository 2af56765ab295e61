//! A run as tables: they say what the record says, in both formats, and join.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;

use crate::harness::run;
use crate::quickstart::copied;

type Table = Vec<BTreeMap<String, String>>;

fn csv(folder: &Path, table: &str) -> Table {
    let mut reader = csv::Reader::from_path(folder.join(format!("{table}.csv"))).unwrap();
    reader.deserialize().map(|row| row.unwrap()).collect()
}

fn parquet(folder: &Path, table: &str) -> Table {
    let file = std::fs::File::open(folder.join(format!("{table}.parquet"))).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let printed = |field: &Field| match field {
        Field::Null => String::new(),
        Field::Str(text) => text.clone(),
        Field::Double(number) => number.to_string(),
        Field::Long(whole) => whole.to_string(),
        Field::Bool(flag) => flag.to_string(),
        other => panic!("{other:?}"),
    };
    let rows = reader.get_row_iter(None).unwrap();
    rows.map(|row| row.unwrap().get_column_iter().map(|(name, field)| (name.clone(), printed(field))).collect())
        .collect()
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column}: {row:?}"))
}

#[test]
fn tables_say_what_the_record_says_and_join() {
    let dir = tempfile::tempdir().unwrap();
    let (run_folder, out) = (copied(dir.path()), dir.path().join("tables"));
    let command = ["data", run_folder.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let ran = run(&command);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let [attempts, labels, rollouts, dictionary] =
        ["attempts", "labels", "rollouts", "dictionary"].map(|table| csv(&out, table));
    for table in ["attempts", "labels", "rollouts", "reviews", "exchanges", "cost", "dictionary"] {
        assert!(csv(&out, table) == parquet(&out, table), "{table} differs between its formats");
    }
    // An attempt's attack is the mean of its labels, scene by scene.
    let mut compared = 0;
    for attempt in attempts.iter().filter(|row| row["exit"] == "evaluated") {
        let own: Vec<_> = labels
            .iter()
            .filter(|label| label["solution"] == attempt["solution"] && label["suite"] == "evolution")
            .collect();
        // A finalist was labelled on more scenes than its window.
        if own.len() == number(attempt, "scenes") as usize {
            let mean = own.iter().map(|label| number(label, "attack")).sum::<f64>() / own.len() as f64;
            assert!((mean - number(attempt, "attack")).abs() < 1e-12, "{}", attempt["attempt"]);
            compared += 1;
        }
    }
    assert!(compared >= 5, "{compared} attempts could be compared");
    // Every label finds its rollout, which says the same of the contact.
    let by_record: BTreeMap<&String, _> = rollouts.iter().map(|row| (&row["record"], row)).collect();
    assert_eq!(by_record.len(), rollouts.len());
    let (mut met, mut missed) = (0, 0);
    for label in &labels {
        let rollout = by_record[&label["record"]];
        assert_eq!(rollout["scene"], label["scene"]);
        assert_eq!(rollout["contact_class"], label["contact_class"]);
        assert_eq!(rollout["end"] == "contact", !label["contact_class"].is_empty());
        *if rollout["end"] == "contact" { &mut met } else { &mut missed } += 1;
    }
    assert!(met >= 5 && missed >= 5, "{met} contacts, {missed} without");
    // The dictionary has every column of every table.
    let described: BTreeSet<(&String, &String)> =
        dictionary.iter().map(|row| (&row["table"], &row["column"])).collect();
    for (table, rows) in [("attempts", &attempts), ("labels", &labels), ("rollouts", &rollouts)] {
        for column in rows[0].keys() {
            assert!(described.contains(&(&table.to_string(), column)), "{table}.{column} is not explained");
        }
    }
    assert!(dictionary.iter().all(|row| row["meaning"].len() > 5));

    let again = run(&command);
    assert_eq!(again.code, 2, "{}", again.stderr);
    assert!(again.stderr.contains("add --overwrite"), "{}", again.stderr);
}

#[test]
fn a_folder_without_its_store_gives_the_other_tables_and_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let (run_folder, out) = (copied(dir.path()), dir.path().join("tables"));
    std::fs::remove_dir_all(run_folder.join("store")).unwrap();
    let ran = run(&["data", run_folder.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(ran.stdout.contains("no longer in the run's store, and in no table: "), "{}", ran.stdout);
    assert!(csv(&out, "rollouts").is_empty() && parquet(&out, "rollouts").is_empty());
    assert!(csv(&out, "labels").len() > 100);
}
