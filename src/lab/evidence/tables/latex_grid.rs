//! Columns and cells as LaTeX sets them: how wide they come out, how many fit a line of the page, and the environments around them.

/// Widths of the lines that tables are laid out for, points: one column and the whole of a page of two.
const COLUMN_PT: f64 = 238.0;
const PAGE_PT: f64 = 490.0;
/// Most columns of a block: a page's table has fewer, a long one is read by looking up.
const COLUMNS_MAX: usize = 10;
/// Mean width of a letter at the size of numbers and at that of intervals, and the room between two columns, points.
const LETTER_PT: f64 = 4.1;
const SMALL_PT: f64 = 2.75;
const BETWEEN_PT: f64 = 6.0;
/// Words beyond this width are broken into lines.
const WORDS_PT: f64 = 118.0;
/// A head of several words that is longer stands in two lines.
const HEAD_LETTERS: usize = 9;

/// A column: its head, the head over it and its neighbours, and what it holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Head over several columns; empty without one.
    pub group: String,
    pub head: String,
    /// Sign for whether more or less is better.
    pub arrow: &'static str,
    /// Words, set to the left.
    pub is_text: bool,
}

/// Content of a place in the grid, spelled for LaTeX.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    pub text: String,
    pub interval: Option<String>,
}

impl Cell {
    /// Makes a cell without an interval.
    pub fn text(text: String) -> Cell {
        Cell { text, interval: None }
    }

    fn spelled(&self) -> String {
        match &self.interval {
            Some(interval) => format!("\\evointerval{{{}}}{{{interval}}}", self.text),
            None => self.text.clone(),
        }
    }

    fn width_pt(&self) -> f64 {
        let interval = self.interval.as_ref().map_or(0.0, |interval| SMALL_PT * letters(interval) as f64);
        interval.max(LETTER_PT * letters(&self.text) as f64)
    }
}

/// Letters that are printed: commands and braces are not.
fn letters(spelled: &str) -> usize {
    let (mut count, mut rest) = (0, spelled.chars().peekable());
    while let Some(c) = rest.next() {
        match c {
            '{' | '}' => {}
            '\\' => {
                let mut name = 0;
                while rest.next_if(char::is_ascii_alphabetic).is_some() {
                    name += 1;
                }
                // An escaped sign is a letter of its own.
                count += usize::from(name == 0 && rest.next().is_some());
            }
            _ => count += 1,
        }
    }
    count
}

/// A head in one line or two.
fn head_lines(head: &str) -> Vec<String> {
    let words: Vec<&str> = head.split(' ').collect();
    if words.len() < 2 || letters(head) <= HEAD_LETTERS {
        return vec![head.to_string()];
    }
    let halves = |at: usize| [words[..at].join(" "), words[at..].join(" ")];
    let longest = |halves: &[String; 2]| halves.iter().map(|half| letters(half)).max().unwrap_or(0);
    (1..words.len()).map(halves).min_by_key(longest).map_or(vec![head.to_string()], Vec::from)
}

/// Rows of cells, one a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    pub columns: Vec<Column>,
    pub rows: Vec<Vec<Cell>>,
}

impl Grid {
    /// Returns `true` if a number has an interval below it.
    pub fn has_intervals(&self) -> bool {
        self.rows.iter().flatten().any(|cell| cell.interval.is_some())
    }

    /// Returns `true` if it fits one column of a two-column page.
    pub fn fits_a_column(&self) -> bool {
        self.width_pt() <= COLUMN_PT
    }

    fn width_pt(&self) -> f64 {
        (0..self.columns.len()).map(|at| self.column_pt(at)).sum()
    }

    fn column_pt(&self, at: usize) -> f64 {
        let column = &self.columns[at];
        let head = head_lines(&column.head).iter().map(|line| letters(line)).max().unwrap_or(0);
        let head = LETTER_PT * (head + usize::from(!column.arrow.is_empty())) as f64;
        let cells = self.rows.iter().map(|row| row[at].width_pt()).fold(head, f64::max);
        BETWEEN_PT + if column.is_text { cells.min(WORDS_PT) } else { cells }
    }

    /// These columns alone.
    fn part(&self, kept: &[usize]) -> Grid {
        Grid {
            columns: kept.iter().map(|at| self.columns[*at].clone()).collect(),
            rows: self.rows.iter().map(|row| kept.iter().map(|at| row[*at].clone()).collect()).collect(),
        }
    }

    /// Writes the grid as a `tabular`.
    pub fn tabular(&self, out: &mut String) {
        out.push_str(&format!("\\begin{{tabular}}{{{}}}\n\\toprule\n{}\\midrule\n", self.preamble(), self.heads()));
        self.lines(out);
        out.push_str("\\bottomrule\n\\end{tabular}\n");
    }

    /// Writes the grid as a `longtable` that begins with this caption, or with none.
    pub fn longtable(&self, out: &mut String, caption: &str) {
        let heads = self.heads();
        out.push_str(&format!(
            "\\begin{{longtable}}{{{}}}\n{caption}\\toprule\n{heads}\\midrule\n\\endfirsthead\n",
            self.preamble()
        ));
        out.push_str(&format!("\\toprule\n{heads}\\midrule\n\\endhead\n\\bottomrule\n\\endfoot\n"));
        self.lines(out);
        out.push_str("\\end{longtable}\n");
    }

    fn preamble(&self) -> String {
        let of = |at: usize| {
            if !self.columns[at].is_text {
                "r".to_string()
            } else if self.column_pt(at) >= BETWEEN_PT + WORDS_PT {
                format!(">{{\\raggedright\\arraybackslash}}p{{{WORDS_PT}pt}}")
            } else {
                "l".to_string()
            }
        };
        format!("@{{}}{}@{{}}", (0..self.columns.len()).map(of).collect::<String>())
    }

    /// The heads, with those over several columns and their rules where there are such.
    fn heads(&self) -> String {
        let mut out = String::new();
        if self.columns.iter().any(|column| !column.group.is_empty()) {
            let (mut cells, mut rules, mut first) = (Vec::new(), String::new(), 1);
            for group in self.columns.chunk_by(|a, b| a.group == b.group) {
                let last = first + group.len() - 1;
                match group[0].group.as_str() {
                    "" => cells.extend(vec![String::new(); group.len()]),
                    name => {
                        cells.push(format!("\\multicolumn{{{}}}{{c}}{{{name}}}", group.len()));
                        rules.push_str(&format!("\\cmidrule(lr){{{first}-{last}}}"));
                    }
                }
                first = last + 1;
            }
            line(&mut out, cells);
            out.push_str(&format!("{rules}\n"));
        }
        line(&mut out, self.columns.iter().map(head).collect());
        out
    }

    fn lines(&self, out: &mut String) {
        self.rows.iter().for_each(|row| line(out, row.iter().map(Cell::spelled).collect()));
    }
}

fn head(column: &Column) -> String {
    let lines = head_lines(&column.head);
    let side = if column.is_text { 'l' } else { 'r' };
    match lines.len() {
        1 => format!("{}{}", column.head, column.arrow),
        _ => format!("\\begin{{tabular}}[b]{{@{{}}{side}@{{}}}}{}{}\\end{{tabular}}", lines.join("\\\\"), column.arrow),
    }
}

fn line(out: &mut String, cells: Vec<String>) {
    out.push_str(&format!("{} \\\\\n", cells.join(" & ")));
}

/// The grid in blocks that each fit the width of a page, every one with the columns that name the row. A group stays together where it fits.
pub fn blocks(grid: &Grid, names: usize) -> Vec<Grid> {
    let outer: Vec<usize> = (0..names).collect();
    let fits = |kept: &[usize]| {
        let all: Vec<usize> = outer.iter().chain(kept).copied().collect();
        all.len() <= COLUMNS_MAX && grid.part(&all).width_pt() <= PAGE_PT
    };
    let rest: Vec<usize> = (names..grid.columns.len()).collect();
    let groups =
        rest.chunk_by(|a, b| grid.columns[*a].group == grid.columns[*b].group && !grid.columns[*a].group.is_empty());
    let mut kept: Vec<Vec<usize>> = Vec::new();
    for group in groups {
        let whole = |last: &Vec<usize>| [last.as_slice(), group].concat();
        match kept.last_mut() {
            Some(last) if fits(&whole(last)) => last.extend(group),
            _ => {
                kept.push(Vec::new());
                for at in group {
                    let place = kept.len() - 1;
                    if kept[place].is_empty() || fits(&[kept[place].as_slice(), &[*at]].concat()) {
                        kept[place].push(*at)
                    } else {
                        kept.push(vec![*at])
                    }
                }
            }
        }
    }
    kept.iter().map(|kept| grid.part(&outer.iter().chain(kept).copied().collect::<Vec<_>>())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(heads: &[(&str, &str)], cell: &str) -> Grid {
        let column = |(group, head): &(&str, &str)| Column {
            group: group.to_string(),
            head: head.to_string(),
            arrow: "",
            is_text: *head == "name",
        };
        let of_cell =
            |_: &(&str, &str)| Cell { text: cell.into(), interval: Some(format!("{{[}}{cell}, {cell}{{]}}")) };
        Grid { columns: heads.iter().map(column).collect(), rows: vec![heads.iter().map(of_cell).collect()] }
    }

    #[test]
    fn letters_are_what_is_printed() {
        assert_eq!(letters("{[}0.1, 2\\%{]}"), "[0.1, 2%]".len());
        assert_eq!(letters("\\textit{ab}"), 2);
    }

    #[test]
    fn a_long_head_stands_in_two_lines_that_are_alike_long() {
        assert_eq!(head_lines("Random patches"), ["Random", "patches"]);
        assert_eq!(head_lines("RP of successes"), ["RP of", "successes"]);
        assert_eq!(head_lines("PF-Area@3").len(), 1);
    }

    #[test]
    fn every_column_stands_in_one_block_beside_the_names_and_no_block_is_wider_than_the_page() {
        let heads: Vec<(&str, &str)> = [("", "name")]
            .into_iter()
            .chain(["a", "b", "c"].map(|head| ("one", head)))
            .chain(["d", "e", "f", "g", "h", "i"].map(|head| ("two", head)))
            .chain([("", "j")])
            .collect();
        let all = blocks(&grid(&heads, "+0.125"), 1);
        let shown: Vec<String> =
            all.iter().flat_map(|block| block.columns[1..].iter().map(|of| of.head.clone())).collect();
        assert_eq!(shown, ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j"]);
        assert_eq!(all[0].columns.len(), 4, "a group stays together");
        for block in &all {
            assert!(block.columns[0].is_text && block.columns.len() <= COLUMNS_MAX && block.width_pt() <= PAGE_PT);
        }
        // Wide cells leave room for fewer.
        assert!(blocks(&grid(&heads, "+1000000.125"), 1).len() > all.len());
    }

    #[test]
    fn every_line_has_a_cell_for_each_column() {
        let heads = [("", "name"), ("one", "Attack diff."), ("one", "b"), ("", "Seeds")];
        let (mut tabular, mut long) = (String::new(), String::new());
        grid(&heads, "0.5").tabular(&mut tabular);
        grid(&heads, "0.5").longtable(&mut long, "\\evotitle{a}{b}\\\\\n");
        for text in [&tabular, &long] {
            assert!(text.contains("\\multicolumn{2}{c}{one}") && text.contains("\\cmidrule(lr){2-3}"), "{text}");
            for row in text.lines().filter(|line| line.ends_with(" \\\\") && !line.contains("multicolumn")) {
                assert_eq!(row.matches(" & ").count(), 3, "{row}");
            }
        }
        assert!(long.contains("\\endfirsthead") && !tabular.contains("\\endhead"));
    }
}
