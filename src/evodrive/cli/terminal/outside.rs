//! Texts that came from outside, as they are printed: models, programs, servers and files may say whatever they like.

use std::borrow::Cow;

use crate::text::cut;

/// Bytes of a message: what a program, a server or a file said may be without end.
const TEXT_BYTES_MAX: usize = 16 << 10;

/// A message as it is told: of a long one beginning and end, and how much is left out.
pub fn bounded(text: &str) -> Cow<'_, str> {
    cut(text, TEXT_BYTES_MAX)
}

/// Returns `true` if a terminal does not just show it: controls, characters that turn the direction of writing, characters that are not seen.
fn acts(c: char) -> bool {
    match c {
        '\n' | '\t' => false,
        '\u{ad}' | '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' => true,
        '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}' => true,
        c => c.is_control(),
    }
}

/// A text for a terminal: what a model or a file wrote must not move its cursor, change its title, or show words in another order.
pub fn escaped(text: &str) -> Cow<'_, str> {
    with_escapes(text, |c| c.escape_unicode().to_string())
}

/// The same of JSON, in which such characters stand in texts alone.
pub fn json_escaped(text: &str) -> Cow<'_, str> {
    with_escapes(text, |c| c.encode_utf16(&mut [0; 2]).iter().map(|unit| format!("\\u{unit:04x}")).collect())
}

fn with_escapes(text: &str, escape: impl Fn(char) -> String) -> Cow<'_, str> {
    if !text.contains(acts) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(text.chars().map(|c| if acts(c) { escape(c) } else { c.to_string() }).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn what_acts_on_a_terminal_is_shown_as_its_number_and_json_says_the_same_as_before() {
        let hostile = "a\u{202e}b\u{2066}c\u{1b}[2Jd\u{9b}e\u{200f}f\u{e0041}g\th\n\u{e9}";
        assert_eq!(escaped(hostile), "a\\u{202e}b\\u{2066}c\\u{1b}[2Jd\\u{9b}e\\u{200f}f\\u{e0041}g\th\n\u{e9}");
        let value = json!({"name": hostile});
        let text = value.to_string();
        let printed = json_escaped(&text);
        assert!(!printed.contains(acts) && printed.contains("\\u202e"), "{printed}");
        assert_eq!(serde_json::from_str::<Value>(&printed).unwrap(), value);
    }
}
