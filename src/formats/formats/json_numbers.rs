//! Numbers of JSON files as programs write them: `NaN` and `Infinity` stand bare in what Python writes, and `null` in their
//! place in what others do. Each is read as NaN, so that it costs its own element and not the file.

use std::borrow::Cow;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

/// Words that no JSON has and Python's `json.dump` writes.
const WORDS: [&[u8]; 3] = [b"-Infinity", b"Infinity", b"NaN"];

/// The text with `null` for each number that JSON does not have. A word inside a text stays.
pub fn without_nan(bytes: &[u8]) -> Cow<'_, [u8]> {
    let holds = |word: &[u8]| holds_word(bytes, word);
    if !holds(b"NaN") && !holds(b"Infinity") {
        return Cow::Borrowed(bytes);
    }
    let mut out = Vec::with_capacity(bytes.len() + bytes.len() / 16);
    let (mut at, mut in_text) = (0, false);
    while let Some(&byte) = bytes.get(at) {
        let word = if in_text { None } else { WORDS.into_iter().find(|word| bytes[at..].starts_with(word)) };
        if let Some(word) = word {
            out.extend_from_slice(b"null");
            at += word.len();
            continue;
        }
        out.push(byte);
        at += 1;
        match byte {
            b'"' => in_text = !in_text,
            b'\\' if in_text => {
                out.extend(bytes.get(at));
                at += 1;
            }
            _ => {}
        }
    }
    Cow::Owned(out)
}

fn holds_word(bytes: &[u8], word: &[u8]) -> bool {
    bytes.windows(word.len()).any(|window| window == word)
}

/// A number, or NaN for `null`.
pub fn number<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// Numbers, each or all of which may be `null`.
pub fn numbers<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let given = Option::<Vec<Option<f64>>>::deserialize(deserializer)?.unwrap_or_default();
    Ok(given.into_iter().map(|number| number.unwrap_or(f64::NAN)).collect())
}

/// Flags, as `true` and `false` or as 1 and 0, which some programs write; `null` is no.
pub fn flags<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<bool>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "true, false, 1 or 0")]
    enum Flag {
        Word(bool),
        Number(f64),
    }
    let given = Vec::<Option<Flag>>::deserialize(deserializer)?;
    let flag = |flag| match flag {
        None => Ok(false),
        Some(Flag::Word(flag)) => Ok(flag),
        Some(Flag::Number(number)) if number == 0.0 || number == 1.0 => Ok(number == 1.0),
        Some(Flag::Number(number)) => Err(D::Error::custom(format!("expected true, false, 1 or 0, found {number}"))),
    };
    given.into_iter().map(flag).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn python_s_numbers_become_null_and_texts_stay() {
        let text = br#"{"a NaN \" NaN": [NaN, -Infinity, Infinity, 1.5], "b": "Infinity"}"#;
        let mended = without_nan(text);
        let expected = br#"{"a NaN \" NaN": [null, null, null, 1.5], "b": "Infinity"}"#;
        assert_eq!(String::from_utf8_lossy(&mended), String::from_utf8_lossy(expected));
        assert!(matches!(without_nan(b"[1, 2]"), Cow::Borrowed(_)));
        without_nan(b"\"NaN\\");
    }
}
