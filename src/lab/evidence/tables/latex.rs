//! A table as LaTeX with booktabs: a float for a page, or a long table for an appendix, upright and inside the margins.

use super::caption;
use super::latex_grid::{Cell, Column as GridColumn, Grid, blocks};
use super::layout::{Column, Part, Row, Table};
use super::page;

/// Packages that a document must have, and commands that it may set otherwise: how a caption begins, and whether notes are printed.
const HEAD: &str = "% needs \\usepackage{array,booktabs,longtable}\n\
    \\providecommand{\\evointerval}[2]{\\begin{tabular}[t]{@{}r@{}}#1\\\\[-0.5ex]{\\fontsize{6}{7}\\selectfont #2}\\end{tabular}}\n\
    \\providecommand{\\evotitle}[2]{\\caption{#2}\\label{tab:evodrive-#1}}\n\
    \\providecommand{\\evonote}[1]{\\par\\smallskip{\\footnotesize\\raggedright #1\\par}}\n";

/// Form that a table takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Form {
    /// Every column, in a long table; the form for a page stands beside it and is taken where `\evopage` is defined.
    pub whole: bool,
    /// The paper's rows under ours.
    pub paper: bool,
}

/// The columns of a table as they are: as a float where they fit the width of a page, else as a long table.
pub fn latex(table: &Table, form: Form) -> String {
    let mut out = String::from(HEAD);
    if form.whole {
        out.push_str(
            "% \\newcommand{\\evopage}{} before \\input: the columns that fit a page alone\n\\ifdefined\\evopage\n",
        );
        let short = page::of_a_page(table);
        short.printed().into_iter().for_each(|part| float(&mut out, &short, part, form));
        out.push_str("\\else\n");
        long(&mut out, table, form);
        out.push_str("\\fi\n");
    } else {
        table.printed().into_iter().for_each(|part| float(&mut out, table, part, form));
    }
    out
}

/// A float a part. Columns in which all rows say the same are in the caption.
fn float(out: &mut String, table: &Table, part: &Part, form: Form) {
    let labels = page::telling_labels(table);
    let grid = grid(table, part, &labels, page::proposals_differ(table), form);
    // Columns that were asked for and do not fit one line of the page stand in several tables below each other.
    let blocks = blocks(&grid, labels.len());
    let environment = if blocks.iter().all(Grid::fits_a_column) { "table" } else { "table*" };
    out.push_str(&format!(
        "\\begin{{{environment}}}[!htbp]\n\\centering\n\\footnotesize\n\\setlength{{\\tabcolsep}}{{3pt}}\n"
    ));
    title(out, table, part, &grid, "");
    for (at, block) in blocks.iter().enumerate() {
        out.push_str(if at == 0 { "" } else { "\\par\\medskip\n" });
        block.tabular(out);
    }
    out.push_str(&format!("\\end{{{environment}}}\n"));
}

/// A long table a part with all columns of numbers, a block of them below the other; the notes stand below the last.
fn long(out: &mut String, table: &Table, form: Form) {
    let (labels, proposals) = (page::telling_labels(table), page::proposals_differ(table));
    out.push_str("{\\footnotesize\\setlength{\\tabcolsep}{3pt}\n");
    for part in table.printed() {
        let grid = grid(table, part, &labels, proposals, form);
        for (at, block) in blocks(&grid, labels.len()).iter().enumerate() {
            // A long table counts itself, also where it goes on with the one before.
            out.push_str(if at == 0 { "" } else { "\\addtocounter{table}{-1}\n" });
            let mut head = String::new();
            if at == 0 {
                title(&mut head, table, part, &grid, "-long");
                head = format!("{}\\\\\n", head.trim_end());
            }
            block.longtable(out, &head);
        }
        if let Some(label) = part.source {
            out.push_str(&format!("\\evonote{{Of the paper: its table \\texttt{{{}}}.}}\n", escaped(label)));
        }
    }
    for note in &table.notes {
        out.push_str(&format!("\\evonote{{{}}}\n", escaped(note)));
    }
    out.push_str("}\n");
}

fn title(out: &mut String, table: &Table, part: &Part, grid: &Grid, ending: &str) {
    let below = if grid.has_intervals() { " Below a number: its 95\\,\\% interval." } else { "" };
    let rests_on = escaped(&caption::rests_on(table));
    out.push_str(&format!("\\evotitle{{{}{ending}}}{{{}.{rests_on}{below}}}\n", part.name, escaped(&part.title)));
}

fn grid(table: &Table, part: &Part, labels: &[usize], proposals: bool, form: Form) -> Grid {
    let words = |head: &str| GridColumn { group: String::new(), head: escaped(head), arrow: "", is_text: true };
    let counts = table.counts.iter().map(|count| GridColumn { is_text: false, ..words(count.head) });
    let columns =
        labels.iter().map(|at| words(table.labels[*at].head)).chain(table.columns.iter().map(head)).chain(counts);
    let columns = columns.chain(proposals.then(|| words("Proposals"))).collect();
    let both = |row: &Row| {
        let paper = (form.paper && row.in_paper()).then(|| paper(row, labels, proposals));
        [Some(ours(row, labels, proposals)), paper].into_iter().flatten()
    };
    Grid { columns, rows: part.printed().flat_map(both).collect() }
}

fn head(column: &Column) -> GridColumn {
    let arrow = match column.upward {
        Some(true) => "$\\uparrow$",
        Some(false) => "$\\downarrow$",
        None => "",
    };
    GridColumn { group: escaped(column.group), head: escaped(column.head), arrow, is_text: false }
}

fn ours(row: &Row, labels: &[usize], proposals: bool) -> Vec<Cell> {
    let mut cells: Vec<Cell> = labels.iter().map(|at| Cell::text(escaped(&row.labels[*at]))).collect();
    cells.extend(row.cells.iter().map(|cell| match cell.ours {
        None => Cell::text("--".into()),
        Some(estimate) => Cell {
            text: escaped(&cell.column.form.number(estimate.value)),
            interval: estimate.interval.map(|interval| escaped(&cell.column.form.interval(interval))),
        },
    }));
    cells.extend(row.counts.iter().map(|count| Cell::text(count.to_string())));
    cells.extend(proposals.then(|| Cell::text(escaped(&row.proposals))));
    cells
}

fn paper(row: &Row, labels: &[usize], proposals: bool) -> Vec<Cell> {
    let mut cells = vec![Cell::text(String::new()); labels.len()];
    cells[0] = Cell::text("\\quad\\textit{paper}".into());
    cells.extend(row.cells.iter().map(|cell| match cell.paper {
        Some(number) => Cell::text(format!("\\textit{{{}}}", escaped(&cell.column.form.number(number)))),
        None => Cell::text("--".into()),
    }));
    cells.extend(vec![Cell::text(String::new()); row.counts.len() + usize::from(proposals)]);
    cells
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
    use super::super::metadrive_policy;
    use super::super::tests::{CAT, add, run};
    use super::*;

    fn made() -> Table {
        let mut made = run("mine_100%", &[("actor", "scripted")]);
        add(&mut made, &CAT);
        metadrive_policy(&[made]).unwrap()
    }

    #[test]
    fn a_caption_says_what_the_numbers_rest_on_and_what_stands_below_them() {
        let text = latex(&page::of_a_page(&made()), Form::default());
        let caption = "\\evotitle{metadrive-policy}{Policy-specific results in MetaDrive. Pool: 6 scenes, 2 for evolution, 4 held out. \
                       Ego: IDM. Proposals: a rule-based stand-in, no language model. Searches a row: 1 seed. Below a number: its \
                       95\\,\\% interval.}";
        assert!(text.contains(caption), "{text}");
    }

    #[test]
    fn the_papers_rows_stand_there_where_they_are_asked_for() {
        let page = page::of_a_page(&made());
        let rows = |form| latex(&page, form).matches("\\quad\\textit{paper}").count();
        assert_eq!((rows(Form::default()), rows(Form { paper: true, ..Form::default() })), (0, 1));
    }

    #[test]
    fn the_whole_form_has_every_column_the_notes_and_the_form_for_a_page_beside_it() {
        let table = made();
        let text = latex(&table, Form { whole: true, paper: false });
        let (page, long) = text.split_once("\\else\n").unwrap();
        assert!(page.contains("\\begin{table") && !page.contains("longtable}["), "{page}");
        for part in ["\\label", "\\resizebox", "landscape"] {
            assert!(!long.contains(part), "{part}");
        }
        for column in &table.columns {
            // A head of two words stands in two lines.
            assert!(column.head.split(' ').all(|word| long.contains(&escaped(word))), "{}", column.head);
        }
        assert!(long.contains("\\evonote{Run mine\\_100\\%") && long.contains("Rollouts"), "{long}");
        let tables = long.matches("\\begin{longtable}").count();
        assert!(tables > 1 && long.matches("\\addtocounter{table}{-1}").count() == tables - 1, "{long}");
    }

    #[test]
    fn every_character_that_latex_reads_is_escaped() {
        assert_eq!(escaped("10.66% & a_b #1 $x$ {y}"), "10.66\\% \\& a\\_b \\#1 \\$x\\$ \\{y\\}");
        assert_eq!(escaped("\\ ~ ^"), "\\textbackslash{} \\textasciitilde{} \\textasciicircum{}");
        assert_eq!(escaped("R >= 0.95 | <b>"), "R \\textgreater{}= 0.95 \\textbar{} \\textless{}b\\textgreater{}");
        assert_eq!(escaped("[1]\n\"q\""), "{[}1{]} ''q''");
    }
}
