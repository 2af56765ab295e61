//! Scene descriptions in pickles, as MetaDrive and ScenarioNet write them.

use super::pickle;
use super::read_json::described;
use super::write_pickle::is_of_data_set;
use crate::formats::conventions::Conventions;
use crate::formats::import_error::ImportError;
use crate::formats::imported::Imported;

/// The scene in a pickle.
///
/// # Errors The file is not a pickle of plain data, lacks something that a scene needs, or holds NaN or infinity.
pub fn import(file_name: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    import_as(file_name, bytes, Conventions::default())
}

/// [`import`] with fields read in these conventions. An export of this project is read as it is.
///
/// # Errors
/// As [`import`].
pub fn import_as(file_name: &str, bytes: &[u8], conventions: Conventions) -> Result<Imported, ImportError> {
    let pickle = pickle::read(file_name, bytes)?;
    if is_of_data_set(&pickle.root()) {
        let reason = "a data set's list of its pickles: it holds no scene itself";
        let mut imported = Imported::default();
        imported.leave_out(file_name, || (String::new(), reason.into()));
        return Ok(imported);
    }
    described(file_name, &pickle.root(), "scenarionet", conventions)
}
