//! The two forms of program files, known by their names.

use std::path::Path;

use crate::cli::terminal::exit::Failure;
use crate::experiment::ProgramFile;
use crate::store;

/// Endings of program files.
const ENDINGS: [&str; 2] = ["json", "toml"];

/// Returns `true` if a file is meant: one that is there, or a name that ends as theirs do.
pub fn is_file(name: &str) -> bool {
    let path = Path::new(name);
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known)) || store::is_plain_file(path).unwrap_or(false)
}

/// The bytes that a file of this name holds: TOML with comments where it ends so, else JSON.
///
/// # Errors
/// A value that TOML cannot hold.
pub fn bytes_for(path: &Path, file: &ProgramFile) -> Result<Vec<u8>, Failure> {
    if ProgramFile::is_toml(&path.to_string_lossy()) {
        Ok(file.to_toml().map_err(Failure::bad_input)?.into_bytes())
    } else {
        file.to_bytes().map_err(Failure::internal)
    }
}
