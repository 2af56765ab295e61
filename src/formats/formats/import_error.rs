//! Import errors. Each names the file, the place in it, what was expected and what to do.

/// A file that is refused as a whole.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}: {place}: expected {expected}; {remedy}")]
pub struct ImportError {
    /// File name without folder.
    pub file: String,
    /// Line and element path, key path, or byte offset.
    pub place: String,
    /// Expected content, and the content found where that helps.
    pub expected: String,
    /// Advice on what to do about it.
    pub remedy: String,
}

impl ImportError {
    /// Makes an error at a place of a file.
    pub fn new(
        file: &str,
        place: impl Into<String>,
        expected: impl Into<String>,
        remedy: impl Into<String>,
    ) -> ImportError {
        ImportError { file: file.into(), place: place.into(), expected: expected.into(), remedy: remedy.into() }
    }

    /// Says why one part of a file is left out while the rest is kept.
    pub(super) fn as_part(&self, kept: &str) -> String {
        format!("{}: expected {}; {kept}", self.place, self.expected)
    }
}

/// Returns a text from a hostile file, cut and stripped of control characters, for an error message.
pub(super) fn shown(text: &str) -> String {
    let mut short: String = text.chars().take(60).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if short.len() < text.len() {
        short.push_str("...");
    }
    short
}
