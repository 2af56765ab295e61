//! The text of cards: one line, bounded, numbers at declared precision, and words that may cross lineages.

use crate::kernel::num;

/// Largest number of decimals that a card prints.
const DIGITS_MAX: u32 = 9;

/// A number as cards print it.
pub fn number(value: f64, digits: u32) -> String {
    let digits = digits.min(DIGITS_MAX);
    format!("{:.*}", digits as usize, num::rounded(value, digits))
}

/// Foreign text as cards carry it: white space and control characters become single spaces, decimals are cut to
/// `digits`, the length to `chars` characters.
pub fn normalised(text: &str, digits: u32, chars: usize) -> String {
    let clean: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(4 * chars + 64).collect();
    let words: Vec<String> = clean.split_whitespace().map(|word| with_fewer_decimals(word, digits)).collect();
    let line = words.join(" ");
    if line.chars().count() <= chars {
        return line;
    }
    let mut short: String = line.chars().take(chars.saturating_sub(3)).collect();
    short.push_str("...");
    short
}

/// Cuts each run of decimals in a word to `digits` of them: `R=0.91234` becomes `R=0.912`.
fn with_fewer_decimals(word: &str, digits: u32) -> String {
    let mut out = String::with_capacity(word.len());
    let (mut decimals, mut after_point, mut after_digit) = (0, false, false);
    for c in word.chars() {
        if c.is_ascii_digit() {
            decimals += u32::from(after_point);
            if !after_point || decimals <= digits {
                out.push(c);
            }
        } else {
            after_point = c == '.' && after_digit && !after_point;
            decimals = 0;
            out.push(c);
        }
        after_digit = c.is_ascii_digit();
    }
    out
}

/// Returns `true` if a tag is a plain word that names only a kind of mechanism or scene: lower-case letters and `_`,
/// at most 32. Digits are not allowed, so that no score, setting or path can be passed on in a tag.
pub fn is_plain_tag(tag: &str) -> bool {
    !tag.is_empty() && tag.len() <= 32 && tag.bytes().all(|b| b.is_ascii_lowercase() || b == b'_')
}

/// Sorted, without repeats.
pub fn tag_set<'a>(tags: impl IntoIterator<Item = &'a String>) -> Vec<String> {
    tags.into_iter().cloned().collect::<std::collections::BTreeSet<String>>().into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn text_becomes_one_short_line_with_few_decimals() {
        assert_eq!(normalised("a\n\tb  R=0.91239, x.y 12.5", 3, 80), "a b R=0.912, x.y 12.5");
        assert_eq!(normalised("abcdefghij", 3, 8), "abcde...");
    }

    #[test]
    fn numbers_have_the_declared_decimals_and_no_minus_zero() {
        assert_eq!(number(0.12345, 3), "0.123");
        assert_eq!(number(-0.0001, 3), "0.000");
    }

    #[test]
    fn a_tag_with_digits_or_marks_is_not_plain() {
        assert!(is_plain_tag("time_to_conflict"));
        for tag in ["", "r0", "R", "a b", "/parameters", "x=1", "score.9"] {
            assert!(!is_plain_tag(tag), "{tag}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_brought_under_its_bound(text in ".{0,300}", chars in 3usize..60) {
            let line = normalised(&text, 3, chars);
            prop_assert!(line.chars().count() <= chars);
            prop_assert!(!line.contains('\n'));
        }
    }
}
