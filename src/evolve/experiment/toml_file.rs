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
    toml::from_str(&text).map_err(|error: toml::de::Error| problem(path, said(&error, &text)))
}

/// Characters of a line that an error shows whole.
const SHOWN_CHARS: usize = 400;

/// Says what is wrong with a TOML text, and where: in the reader's words, unless these would print a line too long to look at.
pub fn said(error: &toml::de::Error, text: &str) -> String {
    let at = error.span().map_or(0, |span| span.start.min(text.len()));
    let before = &text.as_bytes()[..at];
    let (begins, number) = before.iter().enumerate().fold((0, 1), |(begins, number), (place, byte)| match byte {
        b'\n' => (place + 1, number + 1),
        _ => (begins, number),
    });
    let length = text.as_bytes()[begins..].iter().take(SHOWN_CHARS + 1).take_while(|byte| **byte != b'\n').count();
    if length > SHOWN_CHARS {
        format!("line {number}, column {}: {}", at - begins + 1, store::shortened(error.message()))
    } else {
        error.to_string().trim_end().to_string()
    }
}

/// Checks a name that becomes the name of files.
///
/// # Errors
/// An empty one, or other letters.
pub fn check_name(file: &Path, name: &str) -> Result<(), ExperimentError> {
    let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    if !name.is_empty() && name.chars().all(fits) {
        Ok(())
    } else {
        Err(problem(file, format!("name is {name:?}, expected lower-case letters, digits, - and _")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_shows_its_line_unless_that_is_a_long_one() {
        let of = |text: &str| said(&text.parse::<toml::Table>().unwrap_err(), text);
        assert!(of("a = 1\nb = = 2\n").contains("2 | b = = 2"), "{}", of("a = 1\nb = = 2\n"));
        let long = of(&format!("a = 1\n{}\n", "x".repeat(10_000_000)));
        assert!(long.starts_with("line 2, column ") && long.len() < 1000, "{} bytes", long.len());
    }
}
