//! The names in an expression, and the words in any text.

use std::collections::BTreeSet;

/// Names that an expression reads: words that are neither functions nor key words.
pub fn names_in(expression: &str) -> BTreeSet<&str> {
    const KNOWN: [&str; 13] =
        ["and", "or", "not", "true", "false", "if", "min", "max", "clamp", "abs", "sqrt", "exp", "log"];
    words(expression).filter(|word| !KNOWN.contains(word)).collect()
}

/// The maximal runs of letters, digits and `_` that begin with no digit.
pub fn words(text: &str) -> impl Iterator<Item = &str> {
    let runs = text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
    runs.filter(|run| run.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_'))
}
