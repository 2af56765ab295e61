//! From a file to an experiment: composed from its bases, then every option checked, once.

use std::path::Path;

use super::file::{self, Composed};
use super::{Experiment, ExperimentError, check, own_driver, relations};

impl Experiment {
    /// Reads an experiment file with its bases, and checks every option.
    ///
    /// # Errors
    /// Returns an error if a file cannot be read, and for the first option that is unknown, missing, out of its range or at odds with another one.
    pub fn read(path: &Path) -> Result<Experiment, ExperimentError> {
        Experiment::of(file::composed(path)?)
    }

    /// The same with values above the file's: `budget.slots=8`.
    ///
    /// # Errors
    /// Those of [`Experiment::read`], and a text that is not an assignment.
    pub fn read_under(path: &Path, assignments: &[String]) -> Result<Experiment, ExperimentError> {
        Experiment::of(file::composed_under(path, assignments)?)
    }

    fn of(composed: Composed) -> Result<Experiment, ExperimentError> {
        check::check(&composed.table).map_err(|error| composed.error(error))?;
        let file = composed.file.display().to_string();
        let problem = |problem: String| ExperimentError::File { file: file.clone(), problem };
        let read: Result<Experiment, toml::de::Error> = toml::Value::Table(composed.table.clone()).try_into();
        let mut experiment = read.map_err(|error| problem(error.to_string().trim_end().to_string()))?;
        own_driver::attach(&mut experiment).map_err(|error| composed.error(error))?;
        experiment.file = composed.file.clone();
        experiment.whole_text = composed.whole_text()?;
        relations::check(&experiment).map_err(|error| match error {
            relations::Problem::Option(error) => composed.error(error),
            relations::Problem::Several(text) => problem(text),
        })?;
        Ok(experiment)
    }
}
