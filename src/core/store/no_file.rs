//! Something of another kind where a file or a folder is expected: a matter of the place that was named.

/// What was expected, and what lies there.
#[derive(Debug, thiserror::Error)]
#[error("expected {expected}, found {found}")]
pub struct NoFile {
    expected: &'static str,
    found: &'static str,
}

impl NoFile {
    /// The same as the disk's word.
    pub fn error(expected: &'static str, found: &'static str) -> std::io::Error {
        std::io::Error::other(NoFile { expected, found })
    }
}
