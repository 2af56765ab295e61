//! Comparisons of texts: the nearest known word for messages, and unified diffs for readers. Counts with their nouns, long texts cut.
//!
//! A crate of its own, for a short build: the library behind it chooses its method at run time and is generic in what it compares, so
//! each crate that called it compiled all methods anew.

#![forbid(unsafe_code)]
#![cfg_attr(not(test), warn(missing_docs))]

use similar::TextDiff;

/// Least similarity at which a word is proposed (share of common characters, as in Python's difflib).
const SIMILAR_MIN: f32 = 0.6;

/// The most similar of the allowed words; `None` if none is similar.
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let known: Vec<&str> = known.into_iter().collect();
    similar::get_close_matches(word, &known, 1, SIMILAR_MIN).first().copied()
}

/// How alike two words are, in parts of a thousand: the share of common characters, as in difflib.
pub fn likeness(one: &str, other: &str) -> u32 {
    (1000.0 * TextDiff::from_chars(one, other).ratio()) as u32
}

/// A number with its noun: `1 scene`, `0 scenes`, `2 patches`. `noun` stands in the singular, and may have words before it.
pub fn counted(count: usize, noun: &str) -> String {
    let ending = match noun {
        _ if count == 1 => "",
        // `epoch` has no hiss at its end, `patch` has.
        _ if ["s", "x", "sh", "tch", "nch", "rch"].iter().any(|end| noun.ends_with(end)) => "es",
        _ => "s",
    };
    format!("{count} {noun}{ending}")
}

/// A text of at most about `bytes_max` bytes: beginning and end of a longer one, and between them how much is left out. The end stays
/// because a message says there what to do.
pub fn cut(text: &str, bytes_max: usize) -> std::borrow::Cow<'_, str> {
    if text.len() <= bytes_max {
        return text.into();
    }
    let head = text.floor_char_boundary(bytes_max / 4 * 3);
    let tail = text.ceil_char_boundary(text.len() - bytes_max / 4);
    format!("{} [{} bytes are left out here] {}", &text[..head], tail - head, &text[tail..]).into()
}

/// A name of programs and files as words: `lane_change_cost` is `lane change cost`.
pub fn in_words(name: &str) -> String {
    name.replace('_', " ")
}

/// Unified diff of the lines of two texts with their names as its head, and `context` unchanged lines around each change. Empty for
/// equal texts.
pub fn unified_diff(old: &str, new: &str, context: usize, names: [&str; 2]) -> String {
    if old == new {
        return String::new();
    }
    TextDiff::from_lines(old, new).unified_diff().context_radius(context).header(names[0], names[1]).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_word_is_proposed_and_a_strange_one_is_not() {
        let known = ["gap_m", "speed_mps", "lane_count"];
        assert_eq!(nearest("gab_m", known), Some("gap_m"));
        assert_eq!(nearest("speed_ms", known), Some("speed_mps"));
        assert_eq!(nearest("zzz", known), None);
    }

    #[test]
    fn one_thing_stands_in_the_singular_and_any_other_number_of_them_does_not() {
        assert_eq!([0, 1, 2].map(|count| counted(count, "scene")), ["0 scenes", "1 scene", "2 scenes"]);
        assert_eq!(["patch", "epoch", "search"].map(|noun| counted(3, noun)), ["3 patches", "3 epochs", "3 searches"]);
    }

    #[test]
    fn a_long_text_keeps_its_beginning_and_its_end_and_says_what_is_left_out() {
        let text = format!("begin {} end", "\u{e9}".repeat(1_000_000));
        let cut_text = cut(&text, 100);
        assert!(cut_text.len() < 200 && cut_text.starts_with("begin ") && cut_text.ends_with(" end"), "{cut_text}");
        assert!(cut_text.contains("[1999912 bytes are left out here]"), "{cut_text}");
        assert_eq!(cut(&text, text.len()), text);
    }

    #[test]
    fn a_diff_has_as_many_lines_around_a_change_as_asked() {
        let (old, new) = ("a\nb\nc\nd\ne\n", "a\nb\nC\nd\ne\n");
        assert_eq!(unified_diff(old, new, 0, ["x", "y"]), "--- x\n+++ y\n@@ -3 +3 @@\n-c\n+C\n");
        assert_eq!(unified_diff(old, new, 1, ["x", "y"]), "--- x\n+++ y\n@@ -2,3 +2,3 @@\n b\n-c\n+C\n d\n");
        assert_eq!(unified_diff(old, old, 1, ["x", "y"]), "");
    }
}
