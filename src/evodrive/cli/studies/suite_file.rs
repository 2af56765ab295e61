//! Suites and results of them on disk.

use std::path::{Path, PathBuf};

use crate::backend::RolloutCassette;
use crate::cli::terminal::answer::progress;
use crate::cli::terminal::exit::Failure;
use crate::cli::terminal::output::Output;
use crate::kernel::Digest;
use crate::sim::SIM_VERSION;
use crate::store;
use crate::suite::{
    Frozen, Suite, SuiteError, SuiteResult, asked, decode, disagreements, encode, is_as_sealed, result_from_bytes,
    result_to_bytes,
};

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

/// Returns `true` if a path is that of a suite.
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
    if frozen.suite.simulator == SIM_VERSION {
        Ok(frozen)
    } else {
        Err(Failure::bad_input(format!(
            "{}: its labels are of simulator version {}, this build has {SIM_VERSION}, under which the same scene may come out otherwise; \
             use the release that froze it, or freeze it anew",
            path.display(),
            frozen.suite.simulator
        )))
    }
}

/// Writes a suite and gives its digest.
pub fn write(suite: &Suite, path: &Path, output: Output) -> Result<Digest, Failure> {
    let (bytes, digest) = encode(suite).map_err(Failure::internal)?;
    output.write(path, &store::packed(path, &bytes)?)?;
    Ok(digest)
}

/// A result of `suite run`, whether or not it is as it was written.
pub fn parse_result(path: &Path) -> Result<SuiteResult, Failure> {
    let bytes = store::read_bounded(path, RESULT_BYTES_MAX)?;
    result_from_bytes(&path.display().to_string(), &bytes).map_err(Failure::bad_input)
}

/// Returns what shows that a result was changed, if something does. For a format without a seal it says that nobody can tell.
pub fn broken_seal(path: &Path, result: &SuiteResult) -> Result<Option<&'static str>, Failure> {
    match is_as_sealed(result).map_err(Failure::bad_input)? {
        Some(true) => Ok(None),
        Some(false) => Ok(Some("its seal is not that of what it holds: it was changed after it was written")),
        None => {
            progress(format!(
                "{}: of a format without a seal: nobody can say whether it was changed; `evodrive suite run SUITE --recorded` derives a \
                 planner's result from its answers, and seals it with --out",
                path.display()
            ));
            Ok(None)
        }
    }
}

/// A result that is as it was written, with the recorded answers that it was written with where they lie beside it.
pub fn read_result(path: &Path) -> Result<SuiteResult, Failure> {
    let result = parse_result(path)?;
    if let Some(broken) = broken_seal(path, &result)? {
        return Err(changed(path, broken));
    }
    for recording in &result.recordings {
        let beside = answers_beside(path, recording.rules);
        let Some(digest) = recording.digest else { continue };
        if !beside.is_file() {
            progress(format!("{}: not there, so recorded answers were not looked at", beside.display()));
        } else if answers_digest(&RolloutCassette::load(&beside)?, &result) != digest {
            return Err(changed(path, OTHER_ANSWERS));
        }
    }
    Ok(result)
}

/// Returns the file for the answers of a result: beside it, one file a set of rules.
pub fn answers_beside(result: &Path, rules: usize) -> PathBuf {
    let stem = result.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let number = if rules == 0 { String::new() } else { format!("-{}", rules + 1) };
    result.with_file_name(format!("{stem}.rollouts{number}.jsonl.zst"))
}

/// Said of answers that are not those of their result.
pub const OTHER_ANSWERS: &str = "the recorded answers beside it are not those that it was written with";

/// A result that does not hold.
pub fn changed(path: &Path, what: impl std::fmt::Display) -> Failure {
    Failure::divergence(format!(
        "{}: {what}; restore the result and its recorded answers, or make it anew with `evodrive suite run`",
        path.display()
    ))
}

/// The digest of a planner's answers as a result knows them: of their text in this suite.
pub fn answers_digest(answers: &RolloutCassette, result: &SuiteResult) -> Digest {
    Digest::of_bytes(&answers.to_bytes(&result.suite.name))
}

/// Refuses a result of another suite or simulator.
pub fn of_suite(path: &Path, result: &SuiteResult, frozen: &Frozen) -> Result<(), Failure> {
    let place = path.display();
    if result.suite.digest != frozen.digest {
        return Err(Failure::bad_input(format!(
            "{place} is a result in another suite, {} ({}), not in this one ({}); name that suite",
            result.suite.name,
            result.suite.digest.short(12),
            frozen.digest.short(12)
        )));
    }
    if result.simulator != frozen.suite.simulator {
        return Err(Failure::bad_input(format!(
            "{place} was made by simulator version {}, the suite is of {}; make it anew with this release",
            result.simulator, frozen.suite.simulator
        )));
    }
    Ok(())
}

/// Reads a result of this suite.
///
/// # Errors
/// A file that is no result, or one of another suite.
pub fn read_result_of(path: &Path, frozen: &Frozen) -> Result<SuiteResult, Failure> {
    let result = read_result(path)?;
    of_suite(path, &result, frozen).map(|()| result)
}

/// Refuses a result that does not hold every case of its suite that it was asked for, as the suite has it.
pub fn is_whole(path: &Path, result: &SuiteResult, frozen: &Frozen) -> Result<(), Failure> {
    of_suite(path, result, frozen)?;
    match disagreements(result, &frozen.suite, &asked(result, &frozen.suite)) {
        wrong if wrong.is_empty() => Ok(()),
        wrong => Err(changed(path, wrong.join("; "))),
    }
}

/// Writes a result.
pub fn write_result(result: &SuiteResult, path: &Path, output: Output) -> Result<(), Failure> {
    output.write(path, &result_to_bytes(result).map_err(Failure::internal)?)
}
