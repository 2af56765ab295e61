//! `[driver]`: the program behind the ego `command`. Its files are read where they are named, and their digest takes its
//! place in the table, so that every key holds what the program is and not where it lies.

use std::path::Path;
use toml::{Table, Value};

use super::options::COMMAND;
use super::place::Place;
use super::{Experiment, ExperimentError, OptionError};
use crate::backend::{DriverOptions, RolloutCassette};
use crate::ego::Setting;
use crate::kernel::Digest;
use crate::store;

/// Bytes that one of its files may have.
const FILE_BYTES_MAX: u64 = 4 << 30;

/// Puts the digest of the program, and the folder in which it is started, into the table of the file at `place`. Says
/// whether there was one.
///
/// # Errors
/// A command without files or the other way round; a file that is missing where no digest stands; another digest.
pub fn inline(table: &mut Table, place: &Place) -> Result<bool, ExperimentError> {
    let Some(Value::Table(driver)) = table.get_mut("driver") else { return Ok(false) };
    let refuse = |field: &str, found: String, expected: &str| ExperimentError::Option {
        file: place.name(),
        error: OptionError::new(format!("driver.{field}"), found, expected),
    };
    for (one, other) in [("command", "files"), ("files", "command")] {
        if driver.contains_key(one) && !driver.contains_key(other) {
            let expected = "a list beside the other: program, arguments and files are one identity";
            return Err(refuse(other, "missing".into(), expected));
        }
    }
    // A run folder keeps what was found when it began. Other forms are refused against the list of keys.
    let (Some(command), Some(files)) = (texts(driver, "command"), texts(driver, "files")) else { return Ok(false) };
    if driver.contains_key("folder") {
        return Ok(false);
    }
    let declared = match driver.get("digest").map(|value| value.as_str().unwrap_or_default().parse::<Digest>()) {
        None => None,
        Some(Ok(digest)) => Some(digest),
        Some(Err(error)) => return Err(refuse("digest", error.to_string(), "64 hex digits, or nothing")),
    };
    let (observe, blind) = heard(driver).map_err(|(field, found, expected)| refuse(field, found, expected))?;
    let digest = match (found(&command, &files, observe, blind, place), declared) {
        (Ok(digest), Some(declared)) if digest != declared => {
            let expected = format!("{digest}, which the files and arguments have; write it, or restore the program");
            return Err(refuse("digest", declared.to_hex(), &expected));
        }
        (Ok(digest), _) => digest,
        // Recorded rollouts are replayed without the program.
        (Err(_), Some(declared)) => declared,
        (Err(missing), None) => {
            let recorded =
                driver.get("cassette").and_then(Value::as_str).map(|name| place.path_beside(Path::new(name)));
            let recorded =
                recorded.and_then(|path| RolloutCassette::load(&path).ok()).map(|of| of.recorded_of().to_hex());
            let digest = recorded.as_deref().unwrap_or("64 hex digits, which `evodrive record` printed");
            let expected = format!(
                "files beside the experiment file; to replay what is recorded without them write into [driver]: digest = \"{digest}\""
            );
            return Err(refuse("files", missing, &expected));
        }
    };
    // A file named without a folder lies in the working directory, and an empty path cannot be made absolute.
    let folder = std::path::absolute(place.path_beside(Path::new(".")))
        .map_err(|error| refuse("folder", error.to_string(), "a folder in which the program can be started"))?;
    driver.insert("digest".into(), Value::String(digest.to_hex()));
    driver.insert("folder".into(), Value::String(folder.to_string_lossy().into_owned()));
    Ok(true)
}

/// In the copy that a run folder keeps: the folder of an unfinished recording's program stands in its `run.json`.
pub fn leave_place(table: &mut Table) {
    if let Some(folder) = table.get_mut("driver").and_then(|driver| driver.get_mut("folder")) {
        *folder = Value::String(String::new());
    }
}

fn texts(driver: &Table, key: &str) -> Option<Vec<String>> {
    driver.get(key)?.as_array()?.iter().map(|value| value.as_str().map(String::from)).collect()
}

/// Returns what the planner is told beyond what every one is; the error is the key, what it holds and what was expected.
fn heard(driver: &Table) -> Result<(Option<Setting>, bool), (&'static str, String, &'static str)> {
    let observe = match driver.get("observe") {
        None => None,
        Some(value) => match Setting::ALL.into_iter().find(|setting| value.as_str() == Some(setting.name())) {
            Some(setting) => Some(setting),
            None => return Err(("observe", value.to_string(), "\"metadrive-1\" or another of docs/EGOS.md")),
        },
    };
    match driver.get("blind").map_or(Some(true), Value::as_bool) {
        Some(blind) => Ok((observe, blind)),
        None => Err(("blind", driver.get("blind").map_or_else(String::new, Value::to_string), "true or false")),
    }
}

/// The identity of a program whose files are at hand, or what is not.
fn found(
    command: &[String],
    files: &[String],
    observe: Option<Setting>,
    blind: bool,
    place: &Place,
) -> Result<Digest, String> {
    let mut read = Vec::with_capacity(files.len());
    for name in files {
        let path = place.path_beside(Path::new(name));
        let bytes = store::read_bounded(&path, FILE_BYTES_MAX).map_err(|error| format!("{name:?} ({error})"))?;
        // Without its folder: the same file elsewhere is the same program.
        let own = Path::new(name).file_name().map_or_else(|| name.clone(), |own| own.to_string_lossy().into_owned());
        read.push((own, Digest::of_bytes(&bytes)));
    }
    DriverOptions::identity(command, &read, observe, blind).map_err(|error| error.to_string())
}

/// Gives lineages whose ego is a program that program, and the experiment the backend that plays with it.
///
/// # Errors
/// A program that no lineage names; a lineage that names one that is not there; another simulator beside it.
pub fn attach(experiment: &mut Experiment) -> Result<(), OptionError> {
    let named = experiment.lineages.iter().position(|lineage| lineage.ego == COMMAND);
    let other = experiment.simulator.backend.as_ref();
    let Some(driver) = &experiment.driver else {
        if let Some(i) = named {
            let expected = "an ego that needs no program, or a table [driver] that names the program (docs/EGOS.md)";
            return Err(OptionError::new(format!("lineage[{i}].ego"), "\"command\"", expected));
        }
        return match other {
            Some(backend) if backend.drives() => {
                let expected = "another name: this one belongs to the table [driver]";
                Err(OptionError::new("simulator.backend.name", format!("{:?}", backend.name), expected))
            }
            _ => Ok(()),
        };
    };
    if named.is_none() {
        let expected = "nothing: no lineage has ego = \"command\"; name it there, or take [driver] out";
        return Err(OptionError::new("driver", "given", expected));
    }
    if other.is_some() {
        let expected = "nothing: with [driver] the built-in simulator is used; remove one of the two";
        return Err(OptionError::new("simulator.backend", "given", expected));
    }
    fit(driver)?;
    let rules = experiment.simulator.rules();
    let backend = driver.backend(&rules);
    let backend = backend.map_err(|error| OptionError::new("driver", error, "a table that has a digest"))?;
    for lineage in experiment.lineages.iter_mut().filter(|lineage| lineage.ego == COMMAND) {
        lineage.command = driver.digest;
    }
    experiment.simulator.backend = Some(backend);
    Ok(())
}

/// Checks what the list of keys checks too: a file that is named on the command line need not be an experiment.
pub fn fit(driver: &DriverOptions) -> Result<(), OptionError> {
    let refuse = |field: &str, found: String, expected: &str| {
        Err(OptionError::new(format!("driver.{field}"), found, expected.to_string()))
    };
    match driver {
        DriverOptions { command, .. } if command.first().is_none_or(String::is_empty) => {
            refuse("command", format!("{command:?}"), "a program and its arguments")
        }
        DriverOptions { timeout_s, .. } if !(0.001..=3600.0).contains(timeout_s) => {
            refuse("timeout_s", timeout_s.to_string(), "a number from 0.001 to 3600")
        }
        DriverOptions { processes, .. } if !(1..=64).contains(processes) => {
            refuse("processes", processes.to_string(), "a whole number from 1 to 64")
        }
        DriverOptions { repeat_share, .. } if !(0.0..=1.0).contains(repeat_share) => {
            refuse("repeat_share", repeat_share.to_string(), "a number from 0 to 1")
        }
        DriverOptions { digest: None, .. } => refuse("digest", "missing".into(), "64 hex digits beside driver.folder"),
        _ => Ok(()),
    }
}
