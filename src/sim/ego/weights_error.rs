//! Why a file is no policy: what `weights` and `onnx` refuse by.

/// Remedy for a file of our own form.
const AGAIN: &str = "train the ego again (evodrive train experiments/train/<name>.toml), or write one of your own with \
                     evodrive.gym.save_policy (docs/FORMAT.md)";

/// Why a file's bytes are no weights.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{layer}: found {found}, expected {expected}; {remedy}")]
pub struct WeightsError {
    /// Where in the file.
    pub layer: String,
    /// What stands there.
    pub found: String,
    /// What should.
    pub expected: String,
    /// What to do.
    pub remedy: &'static str,
}

impl WeightsError {
    pub(super) fn new(layer: &str, found: impl ToString, expected: impl ToString) -> WeightsError {
        let [found, expected] = [found.to_string(), expected.to_string()];
        WeightsError { layer: layer.to_string(), found, expected, remedy: AGAIN }
    }
}
