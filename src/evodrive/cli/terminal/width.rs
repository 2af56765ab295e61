//! How wide the reader's terminal is, and prose broken to it. A pipe or a file gets whole lines: what reads them breaks them itself.

use std::io::IsTerminal;

use crate::evidence::aligned::{LongWord, broken};

/// Prose is not wider than this, however wide the terminal.
const WIDEST: usize = 100;
/// The width of a terminal that does not tell its own.
pub const USUAL: usize = 80;
/// The narrowest line that prose is broken to.
const NARROWEST: usize = 24;

/// Characters of a line of standard output; `None` where it is no terminal.
pub fn stdout_width() -> Option<usize> {
    let stdout = std::io::stdout();
    stdout.is_terminal().then(|| usual_or(terminal_size::terminal_size_of(&stdout)))
}

/// Characters of a line of standard error; `None` where it is no terminal.
pub fn stderr_width() -> Option<usize> {
    let stderr = std::io::stderr();
    stderr.is_terminal().then(|| usual_or(terminal_size::terminal_size_of(&stderr)))
}

/// Characters that a table may be wide: those of the terminal. In a pipe or a file every row is one line, and no id is broken.
pub fn table_width() -> usize {
    stdout_width().unwrap_or(usize::MAX)
}

/// Returns columns with words that explain them: in one line if that fits, otherwise on a terminal with the words below.
pub fn with_words(columns: &str, words: &str, width: Option<usize>) -> String {
    let line = format!("{columns} {words}\n");
    match width {
        Some(width) if line.trim_end().chars().count() > width => format!("{}\n    {words}\n", columns.trim_end()),
        _ => line,
    }
}

/// A pseudo-terminal that was given no size says 0.
fn usual_or(size: Option<(terminal_size::Width, terminal_size::Height)>) -> usize {
    let columns = size.map_or(0, |(width, _)| usize::from(width.0));
    if columns == 0 { USUAL } else { columns.min(WIDEST) }
}

/// The text with its long lines broken between words; what follows stands under the beginning of what was broken. Lines that
/// are no prose stay: those of Markdown tables and diffs, and commands, which are there to be copied.
pub fn wrapped(text: &str, width: usize) -> String {
    text.split_inclusive('\n').map(|line| wrapped_line(line, width)).collect()
}

fn wrapped_line(line: &str, width: usize) -> String {
    let (bare, end) = line.strip_suffix('\n').map_or((line, ""), |bare| (bare, "\n"));
    let begins = hang(bare);
    let room = width.saturating_sub(begins);
    if bare.chars().count() <= width || room < NARROWEST || !is_prose(bare) {
        return line.to_string();
    }
    let head: String = bare.chars().take(begins).collect();
    let tail: String = bare.chars().skip(begins).collect();
    let lines = broken(&tail, room, LongWord::Whole);
    format!("{head}{}{end}", lines.join(&format!("\n{}", " ".repeat(begins))))
}

/// Returns where the part of a line begins that may be broken: behind its last wide gap, which parts columns, or behind
/// its indent and the dash of a list.
fn hang(line: &str) -> usize {
    let letters: Vec<char> = line.trim_end().chars().collect();
    if let Some(gap) = letters.windows(2).rposition(|pair| pair == [' ', ' ']) {
        return gap + 2;
    }
    let indent = letters.iter().take_while(|c| **c == ' ').count();
    if letters[indent..].starts_with(&['-', ' ']) { indent + 2 } else { indent }
}

/// Returns `true` if a line is made of words, and is neither markup nor a command that somebody copies.
fn is_prose(line: &str) -> bool {
    let first = line.split_whitespace().next().unwrap_or_default();
    // A dash and one blank begin a point of a list; a dash and anything else is a line that a diff removes.
    let is_point = line.starts_with("- ") && !line.starts_with("-  ");
    let is_markup = ["|", "+", "-", "@@", "{", "["].iter().any(|mark| line.starts_with(*mark)) && !is_point;
    !is_markup && !first.ends_with("evodrive")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prose_is_broken_between_words_and_goes_on_under_its_beginning() {
        let broken = wrapped("  rule: realism of at least 0.95, then the best attack\nshort\n", 30);
        assert_eq!(broken, "  rule: realism of at least\n  0.95, then the best attack\nshort\n");
        assert_eq!(wrapped("- one two three four five six seven", 30), "- one two three four five six\n  seven");
    }

    #[test]
    fn words_behind_columns_go_on_in_their_column() {
        let broken = wrapped("a  0.5  not realistic enough for this experiment", 34);
        assert_eq!(broken, "a  0.5  not realistic enough for\n        this experiment");
    }

    #[test]
    fn words_that_do_not_fit_behind_their_columns_stand_below_them() {
        let line =
            |width| with_words("actor        time_to_conflict_s     s       ", "Seconds until both are there.", width);
        assert_eq!(line(None), "actor        time_to_conflict_s     s        Seconds until both are there.\n");
        assert_eq!(line(Some(100)), line(None));
        assert_eq!(line(Some(60)), "actor        time_to_conflict_s     s\n    Seconds until both are there.\n");
    }

    #[test]
    fn what_somebody_copies_or_a_program_reads_stays_in_one_line() {
        for line in [
            "| a | b | a long row of a table in Markdown |",
            "-    remove_this_line(of, a, diff)",
            "evodrive record experiments/quickstart.toml --cassette mine.jsonl",
            "    /usr/bin/evodrive resume runs/quickstart-12345678 --jobs 4",
        ] {
            assert_eq!(wrapped(line, 32), line);
        }
        let quoted = wrapped("to go on type `evodrive resume runs/mine` and wait for it", 30);
        assert_eq!(quoted, "to go on type\n`evodrive resume runs/mine`\nand wait for it");
    }

    #[test]
    fn the_summary_of_the_quickstart_fits_a_terminal_of_80_columns() {
        let summary = include_str!("../../../../golden/quickstart.txt");
        let shown = wrapped(summary, 80);
        // Rows of tables are laid out within the width before.
        let is_row = |line: &str| line.trim_start().contains("  ");
        let wide: Vec<&str> = shown.lines().filter(|line| line.chars().count() > 80 && !is_row(line)).collect();
        assert!(wide.is_empty(), "{wide:#?}");
        let words = |text: &str| text.split_whitespace().map(String::from).collect::<Vec<_>>();
        assert_eq!(words(&shown), words(summary), "nothing is lost by breaking");
    }

    #[test]
    fn a_width_that_is_not_told_is_the_usual_one_and_none_is_wider_than_prose_may_be() {
        let size = |columns| Some((terminal_size::Width(columns), terminal_size::Height(24)));
        assert_eq!([usual_or(None), usual_or(size(0)), usual_or(size(72)), usual_or(size(250))], [80, 80, 72, 100]);
    }
}
