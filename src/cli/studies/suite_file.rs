//! Suites and results of them on disk.

use std::path::Path;

use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::output::Output;
use crate::kernel::Digest;
use crate::sim::SIM_VERSION;
use crate::store;
use crate::suite::{Frozen, Suite, SuiteError, SuiteResult, decode, encode, result_from_bytes, result_to_bytes};

/// Bytes that a suite may have, unpacked.
const SUITE_BYTES_MAX: u64 = 1 << 30;
/// Bytes that a result may have.
const RESULT_BYTES_MAX: u64 = 64 << 20;
/// How names of suites end.
const ENDING: &str = "suite";

impl From<SuiteError> for Failure {
    fn from(error: SuiteError) -> Failure {
        match &error {
            SuiteError::Damaged { .. } => Failure::corruption(error),
            _ => Failure::bad_input(error),
        }
    }
}

/// Whether a path is that of a suite.
pub fn is_suite(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == ENDING)
}

/// A suite as its file holds it, whatever version of the simulator froze it.
pub fn read(path: &Path) -> Result<Frozen, Failure> {
    let file = path.display().to_string();
    let bytes = store::read_text(path, SUITE_BYTES_MAX)?.map_err(|(expected, found)| {
        Failure::corruption(format!("{file}: expected {expected}, found {found}; restore it from a copy"))
    })?;
    Ok(decode(&file, &bytes)?)
}

/// A suite that can be driven here.
pub fn read_to_drive(path: &Path) -> Result<Frozen, Failure> {
    let frozen = read(path)?;
    match frozen.suite.simulator == SIM_VERSION {
        true => Ok(frozen),
        false => Err(Failure::bad_input(format!(
            "{}: its labels are of simulator version {}, this build has {SIM_VERSION}, under which the same scene may come out otherwise; \
             use the release that froze it, or freeze it anew",
            path.display(),
            frozen.suite.simulator
        ))),
    }
}

/// Writes a suite and gives its digest.
pub fn write(suite: &Suite, path: &Path, output: Output) -> Result<Digest, Failure> {
    let (bytes, digest) = encode(suite).map_err(Failure::internal)?;
    output.write(path, &store::packed(path, &bytes)?)?;
    Ok(digest)
}

/// A result of `suite run`.
pub fn read_result(path: &Path) -> Result<SuiteResult, Failure> {
    let bytes = store::read_bounded(path, RESULT_BYTES_MAX)?;
    result_from_bytes(&path.display().to_string(), &bytes).map_err(Failure::bad_input)
}

/// Writes a result.
pub fn write_result(result: &SuiteResult, path: &Path, output: Output) -> Result<(), Failure> {
    output.write(path, &result_to_bytes(result).map_err(Failure::internal)?)
}
