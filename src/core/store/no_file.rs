//! Something of another kind where a file or a folder is expected: a fault of the place that was named.

/// The kind that was expected, and the kind that is there.
#[derive(Debug, thiserror::Error)]
#[error("expected {expected}, found {found}")]
pub struct NoFile {
    expected: &'static str,
    found: &'static str,
}

impl NoFile {
    /// Returns it as an error of the disk.
    pub fn error(expected: &'static str, found: &'static str) -> std::io::Error {
        std::io::Error::other(NoFile { expected, found })
    }
}
