//! Faults of an experiment: the option, what was found there, what is expected.

use crate::store::StoreError;
use crate::text::nearest;

/// An option that cannot be used. Every table of the file is checked against the same list of keys, once, when it is read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{path} is {found}, expected {expected}")]
pub struct OptionError {
    /// Place of the option, e.g. `budget.slots` or `lineage[0].family`.
    pub path: String,
    /// The value as the file writes it; `missing` and `unknown` for keys without one.
    pub found: String,
    pub expected: String,
}

impl OptionError {
    pub fn new(path: impl Into<String>, found: impl ToString, expected: impl Into<String>) -> OptionError {
        OptionError { path: path.into(), found: found.to_string(), expected: expected.into() }
    }

    /// An unknown word; the nearest known one is proposed.
    pub fn word(path: impl Into<String>, found: &str, known: &[String]) -> OptionError {
        let expected = format!("one of {}{}", known.join(", "), did_you_mean(found, known));
        OptionError::new(path, format!("{found:?}"), expected)
    }

    /// A key that no table has; the nearest one is proposed.
    pub fn unknown(path: impl Into<String>, name: &str, known: &[String]) -> OptionError {
        OptionError::new(path, "unknown", format!("one of {}{}", known.join(", "), did_you_mean(name, known)))
    }
}

/// `; did you mean ...?`, or nothing where no known word is near.
pub fn did_you_mean(word: &str, known: &[String]) -> String {
    let near = |word: &str| nearest(word, known.iter().map(String::as_str));
    near(word).or_else(|| near(&word.to_lowercase())).map_or(String::new(), |near| format!("; did you mean `{near}`?"))
}

/// An experiment that cannot be carried out.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// `file` is the one that holds the value: the experiment file or one of its bases.
    #[error("{file}: {error}")]
    Option { file: String, error: OptionError },
    /// A fault of several options at once, or a file that is no TOML.
    #[error("{file}: {problem}")]
    File { file: String, problem: String },
    /// Scenes that cannot be read, generated or split.
    #[error("{0}")]
    Scenes(String),
    #[error(transparent)]
    Store(#[from] StoreError),
}
