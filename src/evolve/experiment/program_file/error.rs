//! Faults of a program file, each with a message of its own.

use super::finding::Finding;
use crate::store::StoreError;

/// Characters of the file's own text that a message repeats.
const SHOWN_CHARS: usize = 400;

/// Text of the file as a message repeats it: cut, and without control characters.
pub(super) fn shown(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars().take(SHOWN_CHARS) {
        if c.is_control() {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    if text.chars().nth(SHOWN_CHARS).is_some() { out + "..." } else { out }
}

/// The first of several faults, and how to see the others.
fn listed(file: &str, findings: &[Finding]) -> String {
    let first = findings.first().map_or(String::new(), Finding::to_string);
    match findings.len() {
        0 | 1 => format!("{first}; correct it there"),
        more => format!("{first}; {} more, which `evodrive program check {file}` lists", more - 1),
    }
}

/// A program file that cannot be used. `file` is its name.
#[derive(Debug, thiserror::Error)]
pub enum ProgramFileError {
    #[error(
        "{file}: larger than {bytes_max} bytes, too large for a program file; name a file that `evodrive program export` wrote"
    )]
    TooLarge { file: String, bytes_max: u64 },
    #[error("{file}: ends after {bytes} bytes in the middle of a value, so it was cut off; copy or export it again")]
    Truncated { file: String, bytes: usize },
    #[error(
        "{file}, line {line}, column {column}: {found} where a finite number is expected; export the program again"
    )]
    NotFinite { file: String, line: usize, column: usize, found: String },
    #[error(
        "{file}: not JSON: {reason}; name a file that `evodrive program export` wrote (TOML has a name that ends in .toml)"
    )]
    NotJson { file: String, reason: String },
    #[error("{file}: {reason}; correct that place, or begin with `evodrive program new`")]
    NotToml { file: String, reason: String },
    /// Places of a program in TOML that do not fit, at least one.
    #[error("{file}, {}", listed(.file, .findings))]
    Findings { file: String, findings: Vec<Finding> },
    #[error(
        "{file}: `format` is {found}, expected \"{expected}\"; name a file that `evodrive program export` of this version wrote"
    )]
    Format { file: String, found: String, expected: &'static str },
    /// A field that is unknown, missing or of another type.
    #[error("{file}: {reason}; a program file has the fields of docs/FORMAT.md and no others")]
    Shape { file: String, reason: String },
    #[error("{file}: {place} is `{found}`, expected {expected}")]
    Family { file: String, place: &'static str, found: String, expected: String },
    #[error(
        "{file}: the contract of family {family} changed: {changed}. The program would be compiled into something else: play it \
         with the version of evodrive that exported it, or evolve it again"
    )]
    Contract { file: String, family: String, changed: String },
    #[error("{file}: {reason}; export the program again")]
    Options { file: String, reason: String },
    #[error(
        "{file}: {what} has digest {computed}, the file says {found}; it was damaged or edited, so copy or export it again \
         (`evodrive program edit` and `program set` change a program)"
    )]
    Digest { file: String, what: &'static str, found: String, computed: String },
    #[error("{file}: the program breaks its contract: {problem}; export it again")]
    Program { file: String, problem: String },
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// Why a program has no TOML.
#[derive(Debug, thiserror::Error)]
pub enum NotWritten {
    #[error("no family is called `{0}`")]
    Family(String),
    /// A number that TOML has no room for, such as a seed above 2^63.
    #[error("{place}: {reason}; keep the file as JSON")]
    Value { place: String, reason: String },
}
