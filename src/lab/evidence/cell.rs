//! A cell of a table by its name, `TABLE:ROW:COLUMN`, spelled as the tables spell rows and columns.

use super::tables::{Cell, Column, Row, Table};

/// A cell that was named.
pub struct Named<'t> {
    pub row: &'t Row,
    pub cell: &'t Cell,
    /// Other columns that the name could mean.
    pub also: Vec<&'static str>,
}

/// `cat/idm/evolved` of a row's labels: lower case, words joined by hyphens.
pub fn row_name(row: &Row) -> String {
    let labels = row.labels.iter().map(|label| plain(label)).filter(|label| !label.is_empty());
    labels.collect::<Vec<_>>().join("/")
}

/// The name of a cell.
pub fn cell_name(table: &Table, row: &Row, column: &Column) -> String {
    format!("{}:{}:{}", table.name, row_name(row), column.key)
}

/// The cell of that row and column.
///
/// # Errors
/// No or several rows or columns of that name; the text lists those that there are.
pub fn find<'t>(table: &'t Table, row: &str, column: &str) -> Result<Named<'t>, String> {
    let row = find_row(table, row)?;
    let (key, also) = find_column(table, column)?;
    let cell = row.cells.iter().find(|cell| cell.column.key == key);
    let cell = cell.ok_or_else(|| format!("row {} of table {} has no column {key}", row_name(row), table.name))?;
    Ok(Named { row, cell, also })
}

fn plain(text: &str) -> String {
    let lower = text.to_lowercase();
    let words = lower.split(|c: char| !c.is_alphanumeric() && c != '.');
    words.filter(|word| !word.is_empty()).collect::<Vec<_>>().join("-")
}

fn find_row<'t>(table: &'t Table, name: &str) -> Result<&'t Row, String> {
    let wanted: Vec<String> = name.split('/').map(plain).collect();
    let labels = |row: &Row| row.labels.iter().map(|label| plain(label)).collect::<Vec<_>>();
    let exact = |row: &&Row| labels(row).starts_with(&wanted);
    let opens = |row: &&Row| {
        let (labels, first) = (labels(row), format!("{}-", wanted[0]));
        labels[0].starts_with(&first) && labels[1..].starts_with(&wanted[1..])
    };
    let holds = |row: &&Row| row.lineages.iter().any(|id| id == name);
    let mut matching: Vec<&Row> = table.rows().filter(exact).collect();
    for other in [&opens as &dyn Fn(&&Row) -> bool, &holds] {
        if matching.is_empty() {
            matching = table.rows().filter(|row| other(row)).collect();
        }
    }
    if matching.len() > 1 {
        matching.retain(|row| !row.missing());
    }
    let names = |rows: &[&Row]| rows.iter().map(|row| row_name(row)).collect::<Vec<_>>();
    match matching.as_slice() {
        [one] => Ok(one),
        [] => {
            let known = names(&table.rows().collect::<Vec<_>>());
            let first = table.rows().filter_map(|row| row.labels.first()).map(|label| plain(label));
            let hint = near(&wanted.join("/"), &known.iter().cloned().chain(first).collect::<Vec<_>>());
            Err(format!("table {} has no row `{name}`{hint}; its rows are {}", table.name, known.join(", ")))
        }
        several => {
            let rows = names(several).join(", ");
            Err(format!("`{name}` names {} rows of table {}; name one of {rows}", several.len(), table.name))
        }
    }
}

/// The key, and other keys that the name could mean. Of several columns of one head the evolved program's is taken.
fn find_column(table: &Table, name: &str) -> Result<(&'static str, Vec<&'static str>), String> {
    let wanted = plain(name);
    let by: [&dyn Fn(&Column) -> bool; 4] = [
        &|column| plain(column.key) == wanted,
        &|column| plain(&format!("{} {}", column.group, column.head)) == wanted,
        &|column| plain(column.head) == wanted,
        &|column| plain(column.key).ends_with(&format!("-{wanted}")),
    ];
    let keys = |fits: &dyn Fn(&Column) -> bool| {
        table.columns.iter().filter(|column| fits(column)).map(|column| column.key).collect::<Vec<_>>()
    };
    let mut matching = by.iter().map(|fits| keys(fits)).find(|matching| !matching.is_empty()).unwrap_or_default();
    let evolved = matching.iter().position(|key| key.starts_with("evolved_")).unwrap_or(0);
    if matching.is_empty() {
        let known: Vec<String> = keys(&|_| true).into_iter().map(String::from).collect();
        let hint = near(name, &known);
        return Err(format!("table {} has no column `{name}`{hint}; its columns are {}", table.name, known.join(", ")));
    }
    let key = matching.remove(evolved);
    Ok((key, matching))
}

/// `; did you mean ...?`, where something is near.
pub fn near(name: &str, known: &[String]) -> String {
    let matching = crate::text::nearest(name, known.iter().map(String::as_str));
    matching.map_or(String::new(), |near| format!("; did you mean `{near}`?"))
}
