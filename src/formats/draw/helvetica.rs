//! Widths of Helvetica's letters, so that text can be laid out without a font: the font of PDF files (`arimo`) has the same, and
//! so have Arial and Liberation Sans, which readers of SVG put in its place.

use super::arimo::REGULAR;

/// Widths of the characters from space to tilde in thousandths of the size (Adobe's metrics of Helvetica).
const WIDTHS: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, // space to slash
    556, 556, 556, 556, 556, 556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, // digits to question mark
    1015, 667, 667, 722, 722, 667, 611, 778, 722, 278, 500, 667, 556, 833, 722, 778, // at sign to O
    667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469, 556, // P to underscore
    333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556, // grave to o
    556, 556, 333, 500, 278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584, // p to tilde
];
/// Of a character that the font lacks, too: that of most letters.
const OTHER: u16 = 556;

/// Width of a line of text at a size; both in the figure's units.
pub fn width(text: &str, size: f64) -> f64 {
    let of = |c: char| {
        let place = u32::from(c).checked_sub(32).map(|at| at as usize);
        let known = place.and_then(|at| WIDTHS.get(at).or(REGULAR.widths.get(at))).copied();
        known.filter(|width| *width > 0).unwrap_or(OTHER)
    };
    let thousandths: u32 = text.chars().map(|c| u32::from(of(c))).sum();
    f64::from(thousandths) * size / 1000.0
}

/// The text as lines that are no wider than `room`, broken at spaces; a word that is wider is broken inside. At most `lines_max`
/// lines, the last one ending in dots where something is left out.
pub fn wrapped(text: &str, size: f64, room: f64, lines_max: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let joined = if line.is_empty() { word.to_string() } else { format!("{line} {word}") };
        if width(&joined, size) <= room {
            line = joined;
            continue;
        }
        if !line.is_empty() {
            lines.push(std::mem::take(&mut line));
        }
        for c in word.chars() {
            if !line.is_empty() && width(&format!("{line}{c}"), size) > room {
                lines.push(std::mem::take(&mut line));
            }
            line.push(c);
        }
    }
    if !line.is_empty() {
        lines.push(line);
    }
    if lines.len() > lines_max {
        lines.truncate(lines_max);
        if let Some(last) = lines.last_mut() {
            while width(&format!("{last} ..."), size) > room && last.pop().is_some() {}
            last.push_str(" ...");
        }
    }
    lines
}

/// The text as lines like [`wrapped`], ended where a sentence ends: as many whole sentences as `lines_max` lines hold, and the first one in any
/// case, on as many lines as it takes.
pub fn whole_sentences(text: &str, size: f64, room: f64, lines_max: usize) -> Vec<String> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let upper = |word: &&str| word.chars().next().is_some_and(|c| !c.is_lowercase());
    // A full stop ends a sentence unless the text goes on in small letters, as behind an abbreviation.
    let ends = (1..=words.len()).filter(|end| {
        *end == words.len() || words[end - 1].ends_with(['.', '!', '?']) && words.get(*end).is_some_and(upper)
    });
    let mut kept = Vec::new();
    for end in ends {
        let lines = wrapped(&words[..end].join(" "), size, room, usize::MAX);
        if !kept.is_empty() && lines.len() > lines_max {
            break;
        }
        kept = lines;
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_told_text_ends_where_a_sentence_ends() {
        let text = "One gains 3.5 m/s, i.e. more than before. Two is a longer sentence that needs room. Three.";
        let lines = |most| whole_sentences(text, 8.0, 120.0, most).join(" ");
        assert_eq!(lines(9), text);
        assert_eq!(lines(2), "One gains 3.5 m/s, i.e. more than before.");
        assert_eq!(lines(1), lines(2), "the first sentence is told in any case");
        assert_eq!(whole_sentences("no end at all", 8.0, 20.0, 1).join(" "), "no end at all");
        assert!(whole_sentences("", 8.0, 20.0, 2).is_empty());
    }

    #[test]
    fn a_line_is_as_wide_as_its_letters() {
        assert_eq!(width("il", 1000.0), 444.0);
        assert_eq!(width("W", 10.0), 9.44);
        assert!(width("é", 10.0) > 0.0, "a letter that is not in the table has a width, too");
    }

    #[test]
    fn lines_stay_within_their_room_and_nothing_is_lost() {
        let text = "a patch that names /mechanism_modules/time_to_conflict_pressure_of_the_nearest_vehicle and more";
        let lines = wrapped(text, 8.0, 90.0, usize::MAX);
        assert!(lines.len() > 3 && lines.iter().all(|line| width(line, 8.0) <= 90.0), "{lines:?}");
        let bare = |text: &str| text.replace(' ', "");
        assert_eq!(bare(&lines.concat()), bare(text));
        let cut = wrapped(text, 8.0, 90.0, 2);
        assert!(cut.len() == 2 && cut[1].ends_with(" ...") && width(&cut[1], 8.0) <= 90.0, "{cut:?}");
    }
}
