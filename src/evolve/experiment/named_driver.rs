//! A planner that is named on the command line: itself, as a program or a .py file, or by a file with a table `[driver]`.

use std::path::Path;
use toml::{Table, Value};

use super::place::{Place, problem};
use super::{ExperimentError, OptionError, file, own_driver};
use crate::backend::DriverOptions;

/// The helper of examples/own_ego, which a planner in Python may import.
const HELPER: &str = "evodrive_driver.py";

/// A planner as `[driver]` names it from the working directory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlannerFile {
    /// Program and arguments.
    pub command: Vec<String>,
    /// The files that are its identity.
    pub files: Vec<String>,
}

impl PlannerFile {
    /// A program, or a .py file, beside which the helper for Python is found.
    ///
    /// # Errors
    /// No such file.
    pub fn named(path: &Path) -> Result<PlannerFile, ExperimentError> {
        if !path.is_file() {
            let expected = "the program or Python file that drives (docs/EGOS.md, \"A planner of your own\")";
            let what = format!("no such file; expected {expected}");
            return Err(problem(Path::new(&format!("--driver {}", path.display())), what));
        }
        let named = path.display().to_string();
        if path.extension().is_none_or(|ending| ending != "py") {
            let command = if path.components().count() == 1 { format!("./{named}") } else { named.clone() };
            return Ok(PlannerFile { command: vec![command], files: vec![named] });
        }
        let helper = path.with_file_name(HELPER);
        let files = std::iter::once(named.clone()).chain(helper.is_file().then(|| helper.display().to_string()));
        Ok(PlannerFile { command: vec!["python3".into(), named], files: files.collect() })
    }

    /// The table that `init` would write for it. Nothing is recorded where a planner is named like this.
    fn table(self) -> Table {
        let list = |words: Vec<String>| Value::from(words);
        let driver = Table::from_iter([
            ("command".to_string(), list(self.command)),
            ("files".to_string(), list(self.files)),
            ("cassette".to_string(), Value::from("none")),
        ]);
        Table::from_iter([("driver".to_string(), Value::Table(driver))])
    }
}

/// The planner of a TOML file's table `[driver]` (an experiment file, or one with that table alone); any other file is the
/// planner itself.
///
/// # Errors
/// No such file; a TOML file without such a table, or with one that is unfit.
pub fn named_driver(path: &Path) -> Result<DriverOptions, ExperimentError> {
    if path.extension().is_none_or(|ending| ending != "toml") {
        let mut table = PlannerFile::named(path)?.table();
        // Its files are named from the working directory, as those of a file there would be.
        own_driver::inline(&mut table, &Place::of(Path::new("--driver")))?;
        return read(&mut table, path, |error| ExperimentError::Option { file: "--driver".into(), error });
    }
    let composed = file::composed(path)?;
    read(&mut composed.table.clone(), path, |error| composed.error(error))
}

fn read(
    table: &mut Table,
    path: &Path,
    refused: impl Fn(OptionError) -> ExperimentError,
) -> Result<DriverOptions, ExperimentError> {
    let missing = "no table [driver], which names the program (docs/EGOS.md); or name the program itself";
    let table = table.remove("driver").ok_or_else(|| problem(path, missing.into()))?;
    let driver: DriverOptions =
        table.try_into().map_err(|error: toml::de::Error| problem(path, format!("[driver]: {}", error.message())))?;
    own_driver::fit(&driver).map_err(refused)?;
    Ok(driver)
}
