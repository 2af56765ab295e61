//! Messages of the scripted model where it cannot answer.

use crate::llm::ModelError;

/// No answer, and why: a fault of the prompt or of the experiment file.
pub(crate) fn unanswerable(reason: impl Into<String>) -> ModelError {
    ModelError::Unanswerable { reason: reason.into() }
}
