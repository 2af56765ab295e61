//! Columns that stand under each other in plain text, within a width. A table that is too wide breaks its heads into lines, then
//! itself into blocks, one under the other, each of which begins with the table's labels.

/// Blanks between two columns.
const GAP: usize = 2;
/// Characters that a column of words keeps where numbers leave it little.
const WORDS_MIN: usize = 16;

/// A table of words and numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Aligned {
    /// Blanks before every line.
    pub indent: usize,
    /// Columns at the left that say what a row is about; every block begins with them.
    pub labels: usize,
    /// Columns at the right that hold words. What stands between labels and words are numbers, set to the right.
    pub words: usize,
    pub heads: Vec<String>,
    /// One cell a head in each.
    pub rows: Vec<Vec<String>>,
}

impl Aligned {
    /// The table in lines of at most `width` characters, each with its newline.
    pub fn text(&self, width: usize) -> String {
        let room = width.saturating_sub(self.indent);
        let spans = self.spans(room);
        let blocks = blocks(&spans, self.labels, room);
        let texts: Vec<String> = blocks.iter().map(|columns| self.block(columns, &spans)).collect();
        texts.join("\n")
    }

    /// The characters of each column: those of its longest cell. Where that is too wide words are broken first, then heads.
    fn spans(&self, room: usize) -> Vec<usize> {
        let cells = |i: usize| self.rows.iter().map(move |row| length(&row[i])).max().unwrap_or(0);
        let mut spans: Vec<usize> = self.heads.iter().enumerate().map(|(i, head)| cells(i).max(length(head))).collect();
        if total(&spans) <= room {
            return spans;
        }
        // Labels take the half of a line at most; beside them any other column has place.
        if total(&spans[..self.labels]) > room / 2 {
            let share = ((room / 2) / self.labels).saturating_sub(GAP).max(1);
            spans[..self.labels].iter_mut().for_each(|span| *span = share.min(*span));
        }
        let beside = room.saturating_sub(total(&spans[..self.labels]) + GAP).max(1);
        spans[self.labels..].iter_mut().for_each(|span| *span = beside.min(*span));
        for i in self.heads.len() - self.words..self.heads.len() {
            let over = total(&spans).saturating_sub(room);
            spans[i] = spans[i].saturating_sub(over).max(WORDS_MIN.min(spans[i]));
        }
        let least: Vec<usize> =
            self.heads.iter().enumerate().map(|(i, head)| cells(i).max(longest_word(head))).collect();
        while total(&spans) > room {
            let saved = |i: usize| spans[i].saturating_sub(least[i]);
            let numbers = self.labels..self.heads.len() - self.words;
            match numbers.max_by_key(|i| saved(*i)).filter(|i| saved(*i) > 0) {
                Some(widest) => spans[widest] = least[widest],
                None => break,
            }
        }
        // What broken heads left over goes to the words.
        if let Some(last) = (self.words > 0).then(|| self.heads.len() - 1) {
            spans[last] = cells(last).max(spans[last]).min(spans[last] + room.saturating_sub(total(&spans)));
        }
        spans
    }

    fn block(&self, columns: &[usize], spans: &[usize]) -> String {
        let mut out = self.lines(&self.heads, columns, spans, true);
        for row in &self.rows {
            out.push_str(&self.lines(row, columns, spans, false));
        }
        out
    }

    /// A row in as many lines as its longest cell needs. Heads stand at the bottom of theirs.
    fn lines(&self, row: &[String], columns: &[usize], spans: &[usize], heads: bool) -> String {
        let cells: Vec<Vec<String>> = columns.iter().map(|i| broken(&row[*i], spans[*i], LongWord::Broken)).collect();
        let height = cells.iter().map(Vec::len).max().unwrap_or(0);
        let mut out = String::new();
        for at in 0..height {
            let mut line = " ".repeat(self.indent);
            for (nth, (cell, &i)) in cells.iter().zip(columns).enumerate() {
                let above = if heads { height - cell.len() } else { 0 };
                let part = at.checked_sub(above).and_then(|at| cell.get(at)).map_or("", String::as_str);
                line.push_str(&" ".repeat(if nth == 0 { 0 } else { GAP }));
                let is_number = i >= self.labels && i + self.words < self.heads.len();
                let blank = " ".repeat(spans[i].saturating_sub(length(part)));
                line.push_str(&if is_number { blank + part } else { part.to_string() + &blank });
            }
            out.push_str(line.trim_end());
            out.push('\n');
        }
        out
    }
}

/// The columns of each block: the labels, and as many of the others as fit.
fn blocks(spans: &[usize], labels: usize, width: usize) -> Vec<Vec<usize>> {
    let begin: Vec<usize> = (0..labels.min(spans.len())).collect();
    let mut lines = vec![begin.clone()];
    for i in begin.len()..spans.len() {
        let block = &lines[lines.len() - 1];
        let wide = total(&block.iter().chain([&i]).map(|i| spans[*i]).collect::<Vec<_>>());
        if wide > width && block.len() > begin.len() {
            lines.push(begin.clone());
        }
        let last = lines.len() - 1;
        lines[last].push(i);
    }
    lines
}

fn total(spans: &[usize]) -> usize {
    spans.iter().sum::<usize>() + GAP * spans.len().saturating_sub(1)
}

fn longest_word(text: &str) -> usize {
    text.split(' ').map(length).max().unwrap_or(0)
}

fn length(text: &str) -> usize {
    text.chars().count()
}

/// Treatment of a word that is longer than a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LongWord {
    /// It is broken, so that no line is too wide: columns stand beside each other.
    Broken,
    /// It stays whole: somebody may want to copy it.
    Whole,
}

/// A text in lines of at most `width` characters, broken between words; what stands between backticks is one word.
pub fn broken(text: &str, width: usize, long: LongWord) -> Vec<String> {
    const SPACE: char = '\u{1}';
    let mut within = false;
    let quoted = |c: char| {
        within ^= c == '`';
        if c == ' ' && within { SPACE } else { c }
    };
    let kept: String = text.chars().map(quoted).collect();
    let mut lines = vec![String::new()];
    for word in kept.split(' ') {
        let last = lines.len() - 1;
        let line = &mut lines[last];
        if !line.is_empty() && length(line) + 1 + length(word) <= width {
            line.push(' ');
            line.push_str(word);
            continue;
        }
        let letters: Vec<char> = word.chars().collect();
        let room = if long == LongWord::Whole { letters.len() } else { width };
        for part in letters.chunks(room.max(1)) {
            let last = lines.len() - 1;
            let part = part.iter().collect();
            if lines[last].is_empty() { lines[last] = part } else { lines.push(part) }
        }
    }
    lines.iter().map(|line| line.replace(SPACE, " ")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(heads: &[&str], rows: &[&[&str]]) -> Aligned {
        let owned = |cells: &[&str]| cells.iter().map(|cell| cell.to_string()).collect::<Vec<_>>();
        Aligned {
            indent: 0,
            labels: 1,
            words: 1,
            heads: owned(heads),
            rows: rows.iter().map(|row| owned(row)).collect(),
        }
    }

    #[test]
    fn numbers_stand_at_the_right_and_words_at_the_left() {
        let of = table(&["lineage", "any crash", "chosen"], &[&["cat", "0.5", "e1s0"], &["adv_bmt-idm", "10.25", "-"]]);
        assert_eq!(
            of.text(80),
            "lineage      any crash  chosen\n\
             cat                0.5  e1s0\n\
             adv_bmt-idm      10.25  -\n"
        );
    }

    #[test]
    fn a_table_that_is_too_wide_breaks_its_heads_first() {
        let of = table(&["lineage", "any crash", "chosen"], &[&["cat", "0.5", "e1s0"]]);
        assert_eq!(of.text(22), "           any\nlineage  crash  chosen\ncat        0.5  e1s0\n");
    }

    #[test]
    fn then_it_breaks_into_blocks_that_begin_with_the_labels() {
        let of = table(&["lineage", "crash", "chosen"], &[&["cat", "0.5", "e1s0"], &["at", "0.6", "e2s0"]]);
        assert_eq!(
            of.text(18),
            "lineage  crash\ncat        0.5\nat         0.6\n\nlineage  chosen\ncat      e1s0\nat       e2s0\n"
        );
    }

    #[test]
    fn words_break_before_heads_do_and_every_line_is_indented() {
        let of = Aligned { indent: 2, ..table(&["a", "two words", ""], &[&["b", "0.5", "not realistic enough"]]) };
        assert_eq!(of.text(34), "  a  two words\n  b        0.5  not realistic\n                enough\n");
    }

    #[test]
    fn no_line_is_wider_than_the_width_whatever_the_cells_are() {
        let long = "a_lineage_whose_name_is_longer_than_any_column_of_a_narrow_terminal";
        let of = table(&[long, "any crash", "chosen"], &[&[long, "0.123 [0.100, 0.150]", "a sentence of many words"]]);
        for width in 20..100 {
            let text = of.text(width);
            assert!(text.lines().all(|line| line.chars().count() <= width), "{width}:\n{text}");
            // Nothing is lost by breaking.
            let letters = |text: &str| text.chars().filter(|c| !c.is_whitespace()).count();
            let blocks = text.split("\n\n").count();
            assert!(letters(&text) >= letters(&of.heads.concat()) + letters(&of.rows.concat().concat()), "{width}");
            assert!(blocks <= 3, "{width}");
        }
    }

    #[test]
    fn a_text_breaks_between_words_and_within_a_word_that_is_longer_than_a_line() {
        let cell = |text, width| broken(text, width, LongWord::Broken);
        assert_eq!(cell("one two three", 7), ["one two", "three"]);
        assert_eq!(cell("abcdefgh ij", 4), ["abcd", "efgh", "ij"]);
        assert_eq!(cell("", 4), [""]);
        assert_eq!(cell("`a b c` d", 3), ["`a ", "b c", "` d"], "a quoted word breaks only where it must");
        assert_eq!(broken("abcdefgh ij", 4, LongWord::Whole), ["abcdefgh", "ij"]);
    }
}
