//! An api key in memory: it goes into one header and nowhere else.

use std::collections::BTreeSet;

use base64::Engine;
use base64::engine::general_purpose::{STANDARD_NO_PAD, URL_SAFE_NO_PAD};

use crate::kernel::hex;

/// A key. Neither `Debug` nor `Display` shows it.
#[derive(Clone)]
pub struct Secret(String);

/// Shorter keys are place-holders for servers without keys (`EMPTY`, `none`). Answers may contain them as ordinary
/// words.
const SECRET_CHARS_MIN: usize = 8;

/// A server escapes what it repeats, and what holds its answer is escaped again before it is searched.
const SPELLED_OVER_MAX: usize = 4;

impl Secret {
    /// White space around the text is dropped: keys are often read from files. A text that a header cannot hold is
    /// refused, and the message does not repeat it.
    pub fn new(text: &str) -> Result<Secret, String> {
        let text = text.trim();
        if text.is_empty() {
            return Err("is empty".into());
        }
        if !text.chars().all(|c| c.is_ascii_graphic()) {
            return Err("holds characters that no HTTP header can carry".into());
        }
        Ok(Secret(text.to_string()))
    }

    pub(super) fn header(&self, before: &str) -> String {
        format!("{before}{}", self.0)
    }

    /// Returns `true` if a text holds the key: as it stands, in hexadecimal digits or in base64, each also where the
    /// text was percent-encoded or escaped as in JSON, up to [`SPELLED_OVER_MAX`] times over.
    pub(super) fn is_in(&self, text: &str) -> bool {
        if self.0.len() < SECRET_CHARS_MIN {
            return false;
        }
        let hex = hex::encoded(self.0.as_bytes());
        let base64 = in_base64(&self.0);
        let holds = |text: &str| {
            text.contains(&self.0)
                || text.to_ascii_lowercase().contains(&hex)
                || base64.iter().any(|spelled| text.contains(spelled))
        };
        // Each reading apart: a key may hold what looks like an escape of the other kind.
        let mut readings = BTreeSet::from([text.to_string()]);
        for _ in 0..SPELLED_OVER_MAX {
            if readings.iter().any(|text| holds(text)) {
                return true;
            }
            readings = readings.iter().flat_map(|text| [without_escapes(text), without_percents(text)]).collect();
        }
        readings.iter().any(|text| holds(text))
    }

    /// A text without the key; nothing of it where the key is spelled in another way than as it stands.
    pub(super) fn redacted(&self, text: &str) -> String {
        let without = text.replace(&self.0, "[api key]");
        if self.is_in(&without) { "[words that spell the api key]".into() } else { without }
    }
}

/// Returns what all texts that contain the key have in common in base64. The key's place in a group of three bytes is
/// not known, and the characters at its ends depend on what stands beside it.
fn in_base64(key: &str) -> Vec<String> {
    let inner = |before: usize, encode: &dyn Fn(&[u8]) -> String| {
        let spelled = encode(&[&vec![0; before][..], key.as_bytes()].concat());
        let (from, whole) = ((before * 8).div_ceil(6), (before + key.len()) * 8 / 6);
        spelled.get(from..whole).unwrap_or_default().to_string()
    };
    let both = |before| {
        [inner(before, &|bytes| STANDARD_NO_PAD.encode(bytes)), inner(before, &|bytes| URL_SAFE_NO_PAD.encode(bytes))]
    };
    (0..3).flat_map(both).collect()
}

/// `%41` read as `A`; what is no such pair stays.
fn without_percents(text: &str) -> String {
    decoded(text, |rest| {
        let digits = rest.strip_prefix('%')?.get(..2)?;
        Some((u8::from_str_radix(digits, 16).ok()? as char, 3))
    })
}

/// `\u0041` read as `A`, and `\/` as `/`; what is no such escape stays.
fn without_escapes(text: &str) -> String {
    decoded(text, |rest| {
        let escape = rest.strip_prefix('\\')?;
        match escape.strip_prefix('u') {
            Some(digits) => Some((char::from_u32(u32::from_str_radix(digits.get(..4)?, 16).ok()?)?, 6)),
            None => escape.chars().next().filter(char::is_ascii_punctuation).map(|c| (c, 2)),
        }
    })
}

/// A text in which `read` finds characters, each with how many bytes spell it.
fn decoded(text: &str, read: impl Fn(&str) -> Option<(char, usize)>) -> String {
    let (mut out, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(first) = rest.chars().next() {
        let (c, bytes) = read(rest).unwrap_or((first, first.len_utf8()));
        out.push(c);
        rest = &rest[bytes..];
    }
    out
}

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Secret")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_secret_is_trimmed_checked_and_never_shown() {
        let secret = Secret::new(" sk-0123456789\n").unwrap();
        assert_eq!(secret.header("Bearer "), "Bearer sk-0123456789");
        assert_eq!(format!("{secret:?}"), "Secret");
        assert_eq!(secret.redacted("no sk-0123456789!"), "no [api key]!");
        assert!(secret.is_in("..sk-0123456789..") && !Secret::new("EMPTY").unwrap().is_in("EMPTY"));
        for text in [" ", "a b", "a\u{7f}", "ä"] {
            assert!(!Secret::new(text).unwrap_err().contains(text.trim()) || text.trim().is_empty());
        }
    }

    proptest! {
        #[test]
        fn a_key_is_found_in_base64_whatever_stands_around_it(
            key in "[!-~]{8,40}", before in prop::collection::vec(any::<u8>(), 0..7), after in prop::collection::vec(any::<u8>(), 0..7),
        ) {
            let secret = Secret::new(&key).unwrap();
            let bytes = [&before[..], key.as_bytes(), &after[..]].concat();
            for text in [STANDARD_NO_PAD.encode(&bytes), URL_SAFE_NO_PAD.encode(&bytes)] {
                prop_assert!(secret.is_in(&text), "{text}");
                prop_assert_eq!(secret.redacted(&text), "[words that spell the api key]");
            }
        }

        #[test]
        fn a_key_is_found_where_it_was_escaped_or_percent_encoded_several_times_over(
            key in "[!-~]{8,40}", ways in prop::collection::vec(any::<bool>(), 1..=3),
        ) {
            let secret = Secret::new(&key).unwrap();
            let percent = |text: &str| text.bytes().map(|byte| format!("%{byte:02X}")).collect::<String>();
            let json = |text: &str| serde_json::to_string(text).unwrap();
            let text = ways.iter().fold(key, |text, way| if *way { percent(&text) } else { json(&text) });
            prop_assert!(secret.is_in(&text), "{text}");
        }

        #[test]
        fn any_text_is_read_and_one_without_the_key_stays(text in "\\PC{0,60}") {
            let secret = Secret::new("sk/te+st=0123456789").unwrap();
            prop_assert_eq!(secret.redacted(&text), text);
        }
    }
}
