//! A fault of a program: its place, what was found, and what is expected.

use serde::Serialize;
use std::fmt;

use crate::text::nearest;

/// Longest `found`, in characters: it may quote hostile text.
const FOUND_MAX: usize = 160;

/// One finding of a check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// JSON Pointer into the program.
    pub place: String,
    /// Value found there.
    pub found: String,
    /// Description of what would be accepted there.
    pub expected: String,
}

impl Problem {
    /// A problem at a JSON Pointer; `found` is shortened.
    pub fn new(place: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Problem {
        let found: String = found.into();
        let short = found.chars().take(FOUND_MAX).collect::<String>();
        let found = if short.len() < found.len() { short + "…" } else { short };
        Problem { place: place.into(), found, expected: expected.into() }
    }

    /// Returns the same problem below another place.
    pub fn below(self, place: &str) -> Problem {
        Problem { place: format!("{place}{}", self.place), ..self }
    }

    /// The problem of a word that is not allowed here.
    pub fn unknown<'a>(
        place: impl Into<String>,
        what: &str,
        word: &str,
        known: impl IntoIterator<Item = &'a str>,
    ) -> Problem {
        let known: Vec<&str> = known.into_iter().collect();
        let list = if known.is_empty() { "none is declared".into() } else { format!("one of {}", known.join(", ")) };
        let hint = nearest(word, known).map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
        Problem::new(place, format!("unknown {what} `{word}`"), format!("{list}{hint}"))
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place: String = self.place.chars().take(FOUND_MAX).collect();
        write!(f, "at {place}: found {}, expected {}", self.found, self.expected)
    }
}

/// Names that agents give to nodes, rules, modules and tags: `[a-z][a-z0-9_]*`, at most 48 characters.
pub fn check_name(place: &str, name: &str) -> Option<Problem> {
    let legal = name.len() <= 48
        && name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_');
    (!legal).then(|| {
        Problem::new(
            place,
            format!("the name {name:?}"),
            "lower-case letters, digits and `_`, at most 48, a letter first",
        )
    })
}
