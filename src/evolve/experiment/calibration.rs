//! The one value of an experiment file that may be the name of a file: the calibration of realism. The file is read where
//! it is named, and its table takes the name's place, so that digest and run folder hold the numbers and not a path.

use toml::{Table, Value};

use super::place::Place;
use super::toml_file::said;
use super::{ExperimentError, OptionError};
use crate::evaluation::Calibration;

const KEY: &str = "evaluation.realism.calibration";
const EXPECTED: &str =
    "evodrive:recorded, evodrive:kinds, a file that `evodrive calibrate --out FILE` wrote, or its table";

/// Puts a named calibration's table into the table of the file at `place`. Says whether a file was named.
///
/// # Errors
/// A file that cannot be read or holds no calibration.
pub fn inline(table: &mut Table, place: &Place) -> Result<bool, ExperimentError> {
    let realism = table.get_mut("evaluation").and_then(|evaluation| evaluation.get_mut("realism"));
    let Some(value) = realism.and_then(|realism| realism.get_mut("calibration")) else { return Ok(false) };
    let Value::String(name) = value else { return Ok(false) };
    let refuse = |problem: String| ExperimentError::Option {
        file: place.name(),
        error: OptionError::new(KEY, format!("\"{name}\" ({})", problem.trim_end()), EXPECTED),
    };
    let text = place.text_beside(name).map_err(|error| refuse(error.to_string()))?;
    let read: Calibration = toml::from_str(&text).map_err(|error| refuse(said(&error, &text)))?;
    *value = Value::try_from(&read).map_err(|error| refuse(error.to_string()))?;
    Ok(true)
}
