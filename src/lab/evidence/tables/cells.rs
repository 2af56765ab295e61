//! The cells of a table's lines, the same in every format that a person reads: a line of ours, under it the paper's.

use super::layout::{Cell, Head, PROPOSALS, Part, Row, Table};

/// Spellings by a format of what is the same in all formats.
pub struct Spelling {
    /// Text as it prints.
    pub text: fn(&str) -> String,
    /// Text in place of a number that is not there.
    pub none: &'static str,
    /// Opens the paper's line.
    pub paper: &'static str,
    /// A number with its interval.
    pub interval: fn(String, String) -> String,
    /// A number of the paper's.
    pub figure: fn(String) -> String,
}

/// Heads of the columns before the numbers and after them.
pub fn outer_heads(table: &Table) -> (Vec<String>, Vec<String>) {
    let names = |heads: &[Head]| -> Vec<String> { heads.iter().map(|head| head.head.to_string()).collect() };
    (names(&table.labels), [names(&table.counts), names(&[PROPOSALS])].concat())
}

/// All lines of a part.
pub fn lines(table: &Table, part: &Part, spelling: &Spelling) -> Vec<Vec<String>> {
    let both = |row: &Row| {
        let paper = row.in_paper().then(|| paper(table, row, spelling));
        [Some(ours(row, spelling)), paper].into_iter().flatten()
    };
    part.printed().flat_map(both).collect()
}

fn ours(row: &Row, spelling: &Spelling) -> Vec<String> {
    let mut cells: Vec<String> = row.labels.iter().map(|label| (spelling.text)(label)).collect();
    for Cell { column, ours, .. } in &row.cells {
        cells.push(match ours {
            None => spelling.none.into(),
            Some(estimate) => {
                let number = (spelling.text)(&column.form.number(estimate.value));
                match estimate.interval {
                    Some(interval) => (spelling.interval)(number, column.form.interval(interval)),
                    None => number,
                }
            }
        });
    }
    cells.extend(row.counts.iter().map(usize::to_string));
    cells.push((spelling.text)(&row.proposals));
    cells
}

fn paper(table: &Table, row: &Row, spelling: &Spelling) -> Vec<String> {
    let figure = |number: String| (spelling.figure)((spelling.text)(&number));
    let number = |cell: &Cell| cell.paper.map(|number| figure(cell.column.form.number(number)));
    let numbers = row.cells.iter().map(|cell| number(cell).unwrap_or(spelling.none.into()));
    let mut cells = vec![String::new(); table.labels.len()];
    cells[0] = spelling.paper.into();
    cells.extend(numbers);
    cells.extend(vec![String::new(); table.counts.len() + 1]);
    cells
}
