//! A table as Markdown: a line of ours, under it the paper's, then the notes.

use super::cells::{self, Spelling};
use super::layout::{Column, Table};

const SPELLING: Spelling = Spelling {
    text: escaped,
    none: "–",
    paper: "· paper",
    interval: |number, interval| format!("{number} {interval}"),
    figure: |f| f,
};

/// The table with its notes as a list.
pub fn markdown(table: &Table) -> String {
    let mut out = String::new();
    for part in table.printed() {
        let source = part.source.map_or(String::new(), |label| format!(" (paper: `{label}`)"));
        out.push_str(&format!("**{}**{source}\n\n", part.title));
        let (before, after) = cells::outer_heads(table);
        line(&mut out, before.into_iter().chain(table.columns.iter().map(head)).chain(after));
        let numbers = table.columns.len() + table.counts.len();
        let rules = vec!["---"; table.labels.len()].into_iter().chain(vec!["--:"; numbers]).chain(["---"]);
        line(&mut out, rules.map(String::from));
        cells::lines(table, part, &SPELLING).into_iter().for_each(|cells| line(&mut out, cells));
        out.push('\n');
    }
    for note in &table.notes {
        out.push_str(&format!("- {}\n", escaped(note)));
    }
    out
}

fn line(out: &mut String, cells: impl IntoIterator<Item = String>) {
    out.push_str(&format!("| {} |\n", cells.into_iter().collect::<Vec<_>>().join(" | ")));
}

pub(super) fn head(column: &Column) -> String {
    let arrow = match column.upward {
        Some(true) => " ↑",
        Some(false) => " ↓",
        None => "",
    };
    format!("{} {}{arrow}", column.group, column.head).trim_start().to_string()
}

/// Text that stays one cell and one line and is no markup.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '|' | '\\' | '*' | '`' => out.extend(['\\', c]),
            '<' => out.push_str("&lt;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_end_its_cell_its_line_or_become_markup() {
        assert_eq!(escaped("a|b\nc <script> `d` *e*"), "a\\|b c &lt;script> \\`d\\` \\*e\\*");
    }
}
