//! A table as Markdown: a line of ours, under it the paper's, then the notes.

use super::layout::{Column, EVIDENCE_HEADS, Row, Table};

/// The table with its notes as a list.
pub fn markdown(table: &Table) -> String {
    let mut out = format!("**{}** (paper: `{}`)\n\n", table.title, table.source);
    let heads = table.columns.iter().map(head);
    line(
        &mut out,
        ["Method", "Policy"].map(String::from).into_iter().chain(heads).chain(EVIDENCE_HEADS.map(String::from)),
    );
    let numbers = table.columns.len() + 2;
    line(&mut out, ["---"; 2].into_iter().chain(vec!["--:"; numbers]).chain(["---"]).map(String::from));
    for row in &table.rows {
        line(&mut out, ours(table, row));
        if row.in_paper() {
            line(&mut out, paper(table, row));
        }
    }
    out.push('\n');
    for note in &table.notes {
        out.push_str(&format!("- {}\n", escaped(note)));
    }
    out
}

fn line(out: &mut String, cells: impl IntoIterator<Item = String>) {
    out.push_str(&format!("| {} |\n", cells.into_iter().collect::<Vec<_>>().join(" | ")));
}

fn head(column: &Column) -> String {
    let arrow = match column.upward {
        Some(true) => " ↑",
        Some(false) => " ↓",
        None => "",
    };
    format!("{} {}{arrow}", column.group, column.head).trim_start().to_string()
}

fn ours(table: &Table, row: &Row) -> Vec<String> {
    let mut cells = vec![escaped(&row.method), escaped(&row.policy)];
    for (column, value) in table.columns.iter().zip(&row.values) {
        cells.push(match value.ours {
            None if row.missing() => "missing".into(),
            None => "–".into(),
            Some(estimate) => {
                let interval = estimate.interval.map(|i| format!(" {}", column.form.interval(i))).unwrap_or_default();
                format!("{}{interval}", column.form.number(estimate.value))
            }
        });
    }
    if row.missing() {
        cells.extend(["–"; 3].map(String::from));
    } else {
        cells.extend([row.held_out_scenes.to_string(), row.rollouts.to_string(), escaped(&row.proposals)]);
    }
    cells
}

fn paper(table: &Table, row: &Row) -> Vec<String> {
    let numbers = table.columns.iter().zip(&row.values);
    let numbers = numbers.map(|(column, value)| value.paper.map_or("–".into(), |figure| column.form.number(figure)));
    let first = ["· paper", ""].map(String::from).into_iter();
    first.chain(numbers).chain(["", "", ""].map(String::from)).collect()
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
