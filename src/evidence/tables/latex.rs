//! A table as LaTeX with booktabs, shaped like the paper's; graphicx scales it to the line.

use super::layout::{Column, EVIDENCE_HEADS, Row, Table};

/// The whole `table*` environment.
pub fn latex(table: &Table) -> String {
    let numbers = table.columns.len();
    let mut out = String::from("% needs \\usepackage{booktabs} and \\usepackage{graphicx}\n");
    out.push_str("\\begin{table*}[!htbp]\n\\centering\n\\scriptsize\n\\setlength{\\tabcolsep}{3pt}\n");
    out.push_str(&format!("\\caption{{{} (paper: {}).}}\n", escaped(table.title), escaped(table.source)));
    out.push_str(&format!("\\label{{tab:evodrive-{}}}\n", table.name));
    out.push_str("\\resizebox{\\linewidth}{!}{%\n");
    out.push_str(&format!("\\begin{{tabular}}{{ll{}rrl}}\n\\toprule\n", "r".repeat(numbers)));
    out.push_str(&group_heads(&table.columns));
    let heads = table.columns.iter().map(head);
    let heads = ["Method", "Policy"].map(String::from).into_iter().chain(heads).chain(EVIDENCE_HEADS.map(String::from));
    line(&mut out, heads.collect());
    out.push_str("\\midrule\n");
    for row in &table.rows {
        line(&mut out, ours(table, row));
        if row.in_paper() {
            line(&mut out, paper(table, row));
        }
    }
    out.push_str("\\bottomrule\n\\end{tabular}}\n");
    for note in &table.notes {
        out.push_str(&format!("\\par\\smallskip\\parbox{{\\linewidth}}{{\\raggedright {}}}\n", escaped(note)));
    }
    out.push_str("\\end{table*}\n");
    out
}

/// Heads over neighbouring columns of one group, with their rules.
fn group_heads(columns: &[Column]) -> String {
    let (mut cells, mut rules) = (vec![String::new(), String::new()], String::new());
    let mut first = 3;
    for group in columns.chunk_by(|a, b| a.group == b.group) {
        let last = first + group.len() - 1;
        cells.push(format!("\\multicolumn{{{}}}{{c}}{{{}}}", group.len(), escaped(group[0].group)));
        rules.push_str(&format!("\\cmidrule(lr){{{first}-{last}}}"));
        first = last + 1;
    }
    cells.extend(EVIDENCE_HEADS.map(|_| String::new()));
    let mut out = String::new();
    line(&mut out, cells);
    format!("{out}{rules}\n")
}

fn head(column: &Column) -> String {
    let arrow = match column.upward {
        Some(true) => "$\\uparrow$",
        Some(false) => "$\\downarrow$",
        None => "",
    };
    format!("{}{arrow}", escaped(column.head))
}

fn ours(table: &Table, row: &Row) -> Vec<String> {
    let mut cells = vec![escaped(&row.method), escaped(&row.policy)];
    for (column, value) in table.columns.iter().zip(&row.values) {
        cells.push(match value.ours {
            None if row.missing() => "missing".into(),
            None => "--".into(),
            Some(estimate) => {
                let interval = |i| format!("\\,{{\\tiny {}}}", escaped(&column.form.interval(i)));
                let interval = estimate.interval.map(interval).unwrap_or_default();
                format!("{}{interval}", escaped(&column.form.number(estimate.value)))
            }
        });
    }
    if row.missing() {
        cells.extend(["--"; 3].map(String::from));
    } else {
        cells.extend([row.held_out_scenes.to_string(), row.rollouts.to_string(), escaped(&row.proposals)]);
    }
    cells
}

fn paper(table: &Table, row: &Row) -> Vec<String> {
    let italic = |figure: String| format!("\\textit{{{}}}", escaped(&figure));
    let numbers = table.columns.iter().zip(&row.values);
    let numbers = numbers.map(|(c, value)| value.paper.map_or("--".into(), |figure| italic(c.form.number(figure))));
    let first = ["\\quad\\textit{paper}", ""].map(String::from).into_iter();
    first.chain(numbers).chain(["", "", ""].map(String::from)).collect()
}

fn line(out: &mut String, cells: Vec<String>) {
    out.push_str(&format!("{} \\\\\n", cells.join(" & ")));
}

/// Text that LaTeX prints as it stands. A bracket is kept from being read as the option of a line's end.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => out.extend(['\\', c]),
            '\\' => out.push_str("\\textbackslash{}"),
            '~' => out.push_str("\\textasciitilde{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            '<' => out.push_str("\\textless{}"),
            '>' => out.push_str("\\textgreater{}"),
            '|' => out.push_str("\\textbar{}"),
            '"' => out.push_str("''"),
            '[' | ']' => out.extend(['{', c, '}']),
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
    fn every_character_that_latex_reads_is_escaped() {
        assert_eq!(escaped("10.66% & a_b #1 $x$ {y}"), "10.66\\% \\& a\\_b \\#1 \\$x\\$ \\{y\\}");
        assert_eq!(escaped("\\ ~ ^"), "\\textbackslash{} \\textasciitilde{} \\textasciicircum{}");
        assert_eq!(escaped("R >= 0.95 | <b>"), "R \\textgreater{}= 0.95 \\textbar{} \\textless{}b\\textgreater{}");
        assert_eq!(escaped("[1]\n\"q\""), "{[}1{]} ''q''");
    }
}
