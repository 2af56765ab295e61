//! Files of their own beside experiments (trainings, downstream studies): one TOML text, every key known.

use serde::de::DeserializeOwned;
use std::path::Path;

use super::ExperimentError;
use crate::store;

/// Bytes that such a file may have.
const BYTES_MAX: u64 = 1 << 20;

/// An error of that file.
pub fn problem(file: &Path, problem: impl std::fmt::Display) -> ExperimentError {
    ExperimentError::File { file: file.display().to_string(), problem: problem.to_string() }
}

/// Reads one; `kind` says what it is.
///
/// # Errors
/// A file that cannot be read, is no text or no TOML; a key that is unknown, missing or of another kind.
pub fn read<T: DeserializeOwned>(path: &Path, kind: &str) -> Result<T, ExperimentError> {
    let bytes = store::read_bounded(path, BYTES_MAX)?;
    let text =
        String::from_utf8(bytes).map_err(|_| problem(path, format!("is not UTF-8; a {kind} file is a text file")))?;
    if let Some((expected, found)) = store::toml_too_large(&text) {
        return Err(problem(path, format!("expected {expected}, found {found}")));
    }
    toml::from_str(&text).map_err(|error: toml::de::Error| problem(path, error.to_string().trim_end()))
}

/// Checks a name that becomes the name of files.
///
/// # Errors
/// An empty one, or other letters.
pub fn check_name(file: &Path, name: &str) -> Result<(), ExperimentError> {
    let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    match !name.is_empty() && name.chars().all(fits) {
        true => Ok(()),
        false => Err(problem(file, format!("name is {name:?}, expected lower-case letters, digits, - and _"))),
    }
}
