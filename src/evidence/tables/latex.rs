//! A table as LaTeX with booktabs, shaped like the paper's; graphicx scales it to the line.

use super::cells::{self, Spelling};
use super::layout::{Column, Part, Table};

const SPELLING: Spelling = Spelling {
    text: escaped,
    none: "--",
    paper: "\\quad\\textit{paper}",
    interval: |number, interval| format!("\\evointerval{{{number}}}{{{}}}", escaped(&interval)),
    figure: |figure| format!("\\textit{{{figure}}}"),
};

/// An interval stands below its number: beside it, tables of many columns would have to shrink until nobody can read them.
const HEAD: &str = "% needs \\usepackage{booktabs} and \\usepackage{graphicx}\n\
    \\providecommand{\\evointerval}[2]{\\begin{tabular}[t]{@{}r@{}}#1\\\\[-0.4ex]{\\tiny #2}\\end{tabular}}\n";

/// A `table*` environment a part; the notes stand below the last.
pub fn latex(table: &Table) -> String {
    let mut out = String::from(HEAD);
    let printed = table.printed();
    for (at, one) in printed.iter().enumerate() {
        let notes = if at + 1 == printed.len() { table.notes.as_slice() } else { &[] };
        part(&mut out, table, one, notes);
    }
    out
}

fn part(out: &mut String, table: &Table, part: &Part, notes: &[String]) {
    let source = part.source.map_or(String::new(), |label| format!(" (paper: {})", escaped(label)));
    out.push_str("\\begin{table*}[!htbp]\n\\centering\n\\scriptsize\n\\setlength{\\tabcolsep}{3pt}\n");
    out.push_str(&format!("\\caption{{{}{source}.}}\n", escaped(&part.title)));
    out.push_str(&format!("\\label{{tab:evodrive-{}}}\n", part.name));
    out.push_str("\\resizebox{\\linewidth}{!}{%\n");
    let aligned = [(table.labels.len(), "l"), (table.columns.len() + table.counts.len(), "r"), (1, "l")];
    let aligned: String = aligned.map(|(columns, side)| side.repeat(columns)).concat();
    out.push_str(&format!("\\begin{{tabular}}{{{aligned}}}\n\\toprule\n"));
    out.push_str(&group_heads(table));
    let (before, after) = cells::outer_heads(table);
    line(out, before.into_iter().chain(table.columns.iter().map(head)).chain(after).collect());
    out.push_str("\\midrule\n");
    cells::lines(table, part, &SPELLING).into_iter().for_each(|cells| line(out, cells));
    out.push_str("\\bottomrule\n\\end{tabular}}\n");
    for note in notes {
        out.push_str(&format!("\\par\\smallskip\\parbox{{\\linewidth}}{{\\raggedright {}}}\n", escaped(note)));
    }
    out.push_str("\\end{table*}\n");
}

/// Heads over neighbouring columns of one group, with their rules; empty without groups.
fn group_heads(table: &Table) -> String {
    if table.columns.iter().all(|column| column.group.is_empty()) {
        return String::new();
    }
    let (mut cells, mut rules) = (vec![String::new(); table.labels.len()], String::new());
    let mut first = table.labels.len() + 1;
    for group in table.columns.chunk_by(|a, b| a.group == b.group) {
        let last = first + group.len() - 1;
        cells.push(format!("\\multicolumn{{{}}}{{c}}{{{}}}", group.len(), escaped(group[0].group)));
        rules.push_str(&format!("\\cmidrule(lr){{{first}-{last}}}"));
        first = last + 1;
    }
    cells.extend(vec![String::new(); table.counts.len() + 1]);
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

fn line(out: &mut String, cells: Vec<String>) {
    out.push_str(&format!("{} \\\\\n", cells.join(" & ")));
}

/// Text that LaTeX prints as it stands. A bracket is kept from being read as the option of a line's end.
pub fn escaped(text: &str) -> String {
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
