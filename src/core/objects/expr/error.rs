//! Why a text is not an expression, or not one of the type that its place needs.

/// The place, what was found there, and what would be accepted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("column {column}: found {found}, expected {expected}")]
pub struct ExprError {
    /// Counted in characters from 1.
    pub column: usize,
    /// Text found there.
    pub found: String,
    /// Description of what would be accepted there.
    pub expected: String,
}

impl ExprError {
    pub(super) fn new(column: usize, found: impl Into<String>, expected: impl Into<String>) -> ExprError {
        ExprError { column, found: found.into(), expected: expected.into() }
    }
}
