//! A table as HTML: a caption, grouped heads and a line of ours a row, under it the paper's.

use super::cells::{self, Spelling};
use super::layout::{Column, Part, Table};
use crate::draw::escaped;

const SPELLING: Spelling = Spelling {
    text: escaped,
    none: "–",
    paper: "<i>paper</i>",
    interval: |number, interval| format!("{number} <small>{}</small>", escaped(&interval)),
    figure: |figure| format!("<i>{figure}</i>"),
};

/// A `<table>` a part and the notes as a list. Nothing in it is a script, and text is text.
pub fn html(table: &Table) -> String {
    let mut out = String::new();
    for one in table.printed() {
        part(&mut out, table, one);
    }
    let notes: String = table.notes.iter().map(|note| format!("<li>{}</li>\n", escaped(note))).collect();
    if !notes.is_empty() {
        out.push_str(&format!("<ul class=\"notes\">\n{notes}</ul>\n"));
    }
    out
}

fn part(out: &mut String, table: &Table, part: &Part) {
    let source = part.source.map_or(String::new(), |label| format!(" <small>paper: {}</small>", escaped(label)));
    out.push_str(&format!(
        "<div class=\"wide\"><table>\n<caption>{}{source}</caption>\n<thead>\n",
        escaped(&part.title)
    ));
    let (before, after) = cells::outer_heads(table);
    if table.columns.iter().any(|column| !column.group.is_empty()) {
        let groups = table.columns.chunk_by(|a, b| a.group == b.group);
        let groups: String = groups
            .map(|of| format!("<th class=\"group\" colspan=\"{}\">{}</th>", of.len(), escaped(of[0].group)))
            .collect();
        let room = |columns: usize| format!("<td colspan=\"{columns}\"></td>");
        out.push_str(&format!("<tr>{}{groups}{}</tr>\n", room(before.len()), room(after.len())));
    }
    let heads = before.into_iter().chain(table.columns.iter().map(head)).chain(after);
    line(out, table, "th", heads.map(|head| escaped(&head)));
    out.push_str("</thead>\n<tbody>\n");
    cells::lines(table, part, &SPELLING).into_iter().for_each(|cells| line(out, table, "td", cells));
    out.push_str("</tbody>\n</table></div>\n");
}

/// A line; numbers stand to the right.
fn line(out: &mut String, table: &Table, element: &str, cells: impl IntoIterator<Item = String>) {
    let numbers = table.labels.len()..table.labels.len() + table.columns.len() + table.counts.len();
    out.push_str("<tr>");
    for (i, cell) in cells.into_iter().enumerate() {
        let class = if numbers.contains(&i) { " class=\"num\"" } else { "" };
        out.push_str(&format!("<{element}{class}>{cell}</{element}>"));
    }
    out.push_str("</tr>\n");
}

fn head(column: &Column) -> String {
    let arrow = match column.upward {
        Some(true) => " ↑",
        Some(false) => " ↓",
        None => "",
    };
    format!("{}{arrow}", column.head)
}
