//! The table `[driver]` of a file that need not be an experiment.

use std::path::Path;

use super::place::problem;
use super::{ExperimentError, file, own_driver};
use crate::backend::DriverOptions;

/// The program of a file with a table `[driver]`: an experiment file, or one with that table alone.
///
/// # Errors
/// A file without such a table, or with one that is unfit.
pub fn named_driver(path: &Path) -> Result<DriverOptions, ExperimentError> {
    let composed = file::composed(path)?;
    let table = composed.table.get("driver").cloned();
    let table =
        table.ok_or_else(|| problem(path, "no table [driver], which names the program (docs/EGOS.md)".into()))?;
    let driver: DriverOptions =
        table.try_into().map_err(|error: toml::de::Error| problem(path, format!("[driver]: {}", error.message())))?;
    own_driver::fit(&driver).map_err(|error| composed.error(error))?;
    Ok(driver)
}
