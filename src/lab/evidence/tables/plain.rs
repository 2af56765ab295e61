//! A table as a terminal shows it: columns under each other, a line of ours, under it the paper's, then the notes.

use super::cells::{self, Spelling};
use super::layout::{Column, Table};
use super::markdown::head;
use crate::evidence::aligned::Aligned;

const SPELLING: Spelling = Spelling {
    text: |text| text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect(),
    none: "–",
    paper: "· paper",
    interval: |number, interval| format!("{number} {interval}"),
    figure: |figure| figure,
};

/// The table within a width, with its notes as a list of whole sentences.
pub fn plain(table: &Table, width: usize) -> String {
    let mut out = String::new();
    for part in table.printed() {
        let source = part.source.map_or(String::new(), |label| format!(" (paper: {label})"));
        let (before, after) = cells::outer_heads(table);
        let heads = before.into_iter().chain(table.columns.iter().map(|column: &Column| head(column))).chain(after);
        let rows = cells::lines(table, part, &SPELLING);
        // The last column says in words where proposals came from.
        let columns = Aligned { indent: 0, labels: table.labels.len(), words: 1, heads: heads.collect(), rows };
        out.push_str(&format!("{}{source}\n\n{}\n", part.title, columns.text(width)));
    }
    for note in &table.notes {
        out.push_str(&format!("- {}\n", (SPELLING.text)(note)));
    }
    out
}
