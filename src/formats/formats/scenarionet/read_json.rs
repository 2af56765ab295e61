//! ScenarioNet's ScenarioDescription as JSON: what this project exports, and what `json.dump` makes of the pickles'
//! dictionaries (arrays as lists). An export of this project gives back exactly the exported scene.

use super::pickle::{self, Node};
use super::read::{finish, log_of};
use crate::formats::assemble::assembled;
use crate::formats::conventions::Conventions;
use crate::formats::import_error::ImportError;
use crate::formats::imported::Imported;
use crate::kernel::Vec2;
use crate::scene::remainder::Remainder;
use crate::scene::{Origin, Scene};

const FORMAT: &str = "scenarionet-json";

/// The scene in a JSON file. If an export of this project was edited, only its standard keys count, and `left_out` says
/// so.
///
/// # Errors The file is not JSON, or not a ScenarioDescription with a self-driving car; see [`super::read_pickle::import`].
pub fn import(file_name: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    import_as(file_name, bytes, Conventions::default())
}

/// [`import`] with fields read in these conventions. An export of this project is read as it is.
///
/// # Errors
/// As [`import`].
pub fn import_as(file_name: &str, bytes: &[u8], conventions: Conventions) -> Result<Imported, ImportError> {
    described(file_name, &pickle::read_json(file_name, bytes)?.root(), FORMAT, conventions)
}

/// The scene of a description, which may be an export of this project.
pub(super) fn described(
    file_name: &str,
    root: &Node<'_>,
    format: &str,
    conventions: Conventions,
) -> Result<Imported, ImportError> {
    let beside = root.get("metadata").and_then(|metadata| metadata.get("evodrive")).filter(|node| !node.is_none());
    let plain = |mut imported: Imported| {
        let log = log_of(file_name, root, format, &mut imported)?;
        finish(file_name, log, conventions, &mut imported);
        Ok(imported)
    };
    let Some(beside) = beside else { return plain(Imported::default()) };
    let origin = Origin { format: format.into(), name: file_name.into() };
    let remainder = beside.text().and_then(Remainder::from_text);
    let exact = remainder.and_then(|remainder| remainder.laid_over(&in_its_own_frame(file_name, root).ok()?, &origin));
    if let Some(scene) = exact {
        return Ok(Imported { scenes: vec![scene], ..Imported::default() });
    }
    let mut imported = Imported::default();
    let reason = "the file was edited after its export, or exported by another version; what its standard keys say \
                  was read, without the exact lane boundaries, start and route";
    imported.leave_out(file_name, || ("metadata.evodrive".into(), reason.into()));
    plain(imported)
}

/// The scene that the standard keys of one of our exports give, without our private key.
pub(crate) fn read_plainly(file_name: &str, bytes: &[u8]) -> Result<Scene, ImportError> {
    in_its_own_frame(file_name, &pickle::read_json(file_name, bytes)?.root())
}

/// Coordinates stay as they are.
fn in_its_own_frame(file_name: &str, root: &Node<'_>) -> Result<Scene, ImportError> {
    let mut log = log_of(file_name, root, FORMAT, &mut Imported::default())?;
    log.frame = Some(Vec2::ZERO);
    let (scene, _) = assembled(log).map_err(|reason| root.refuse(format!("a whole scene ({reason})")))?;
    Ok(scene)
}
