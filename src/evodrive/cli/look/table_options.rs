//! Which columns and rows of a table are wanted.

use crate::cli::terminal::exit::Failure;
use crate::evidence::cell;
use crate::evidence::tables::Table;

/// Stands for every column.
const ALL: &str = "all";

/// The table with these rows, in their order; with all where none are named. `place` says who asks.
pub fn rows(place: &str, wanted: &[String], table: Table) -> Result<Table, Failure> {
    let known = table.row_names();
    if let Some(unknown) = wanted.iter().find(|name| !known.contains(name)) {
        return Err(Failure::bad_input(format!(
            "{place}: table {} has no row `{unknown}`{}; its rows are {}",
            table.name,
            cell::near(unknown, &known),
            known.join(", ")
        )));
    }
    let names: Vec<&str> = wanted.iter().map(String::as_str).collect();
    Ok(if names.is_empty() { table } else { table.with_rows(&names) })
}

/// The table with these columns of numbers; with all where none are named, or `all`.
pub fn columns(place: &str, wanted: &[String], table: Table) -> Result<Table, Failure> {
    let keys: Vec<&str> = wanted.iter().map(String::as_str).collect();
    if matches!(keys.as_slice(), [] | [ALL]) {
        return Ok(table);
    }
    let known: Vec<String> = table.keys().into_iter().map(String::from).collect();
    match keys.iter().find(|key| !known.iter().any(|known| known == *key)) {
        None => Ok(table.with(&keys)),
        Some(key) => Err(Failure::bad_input(format!(
            "{place}: table {} has no column `{key}`{}; its columns are {}, or {ALL}",
            table.name,
            cell::near(key, &known),
            known.join(", ")
        ))),
    }
}
