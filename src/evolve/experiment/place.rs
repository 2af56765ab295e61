//! Places of an experiment's files: on the disk, or in the program.

use std::path::{Component, Path, PathBuf};

use super::{ExperimentError, OptionError};
use crate::store;

/// Bytes that an experiment file may have: a run folder's holds the programs that its lineages start from.
const FILE_BYTES_MAX: u64 = 64 << 20;
/// Prefix of the name of a protocol that the program carries.
pub const SHIPPED: &str = "evodrive:";

/// The protocols that the program carries: name and file.
pub const PROTOCOLS: [(&str, &str); 3] = [
    ("metadrive", include_str!("../../../experiments/protocols/metadrive.toml")),
    ("metadrive-2", include_str!("../../../experiments/protocols/metadrive_2.toml")),
    ("safebench", include_str!("../../../experiments/protocols/safebench.toml")),
];

/// The protocol of families that move traffic staged for them.
pub const STAGED: &str = "safebench";

/// The calibrations that the program carries: name and file.
const CALIBRATIONS: [(&str, &str); 2] = [
    ("recorded", include_str!("../../../experiments/calibration/recorded.toml")),
    ("kinds", include_str!("../../../experiments/calibration/kinds.toml")),
];

/// Place of a file.
pub enum Place {
    Disk(PathBuf),
    Shipped(&'static str, &'static str),
}

/// The weights of learned egos that the program carries: name and file.
pub(super) const POLICIES: [(&str, &[u8]); 5] = [
    ("sac-safebench-2", include_bytes!("../../../policies/sac-safebench-2.safetensors")),
    ("sac-chatscene", include_bytes!("../../../policies/sac-chatscene.safetensors")),
    ("sac-safebench", include_bytes!("../../../policies/sac-safebench.safetensors")),
    ("sac-metadrive", include_bytes!("../../../policies/sac-metadrive.safetensors")),
    ("sac-metadrive-2", include_bytes!("../../../policies/sac-metadrive-2.safetensors")),
];

/// The learned ego of SafeBench's families where a lineage names none.
pub const PUBLISHED: &str = "evodrive:sac-chatscene";

/// The weights behind a name that begins with `evodrive:`; `None` for the name of a file.
///
/// # Errors
/// A name that the program does not carry; `place` is where it stands.
pub fn shipped_weights(place: &str, name: &str) -> Option<Result<&'static [u8], OptionError>> {
    let wanted = name.strip_prefix(SHIPPED)?;
    let carried = POLICIES.iter().find(|(known, _)| *known == wanted);
    let known = POLICIES.map(|(known, _)| format!("{SHIPPED}{known}"));
    Some(carried.map(|(_, bytes)| *bytes).ok_or_else(|| OptionError::word(place, name, &known)))
}

impl Place {
    pub fn of(path: &Path) -> Place {
        // `a/../b.toml` and `b.toml` are one file, so that a circle is seen.
        let mut plain = PathBuf::new();
        for component in path.components() {
            match component {
                Component::CurDir => {}
                Component::ParentDir if matches!(plain.components().next_back(), Some(Component::Normal(_))) => {
                    plain.pop();
                }
                other => plain.push(other),
            }
        }
        Place::Disk(plain)
    }

    /// As messages name it.
    pub fn name(&self) -> String {
        match self {
            Place::Disk(path) => path.display().to_string(),
            Place::Shipped(name, _) => format!("{SHIPPED}{name}"),
        }
    }

    /// Its whole text.
    pub fn read(&self) -> Result<String, ExperimentError> {
        let path = match self {
            Place::Shipped(_, text) => return Ok(text.to_string()),
            Place::Disk(path) => path,
        };
        let text = String::from_utf8(store::read_bounded(path, FILE_BYTES_MAX)?).map_err(|error| {
            let byte = error.utf8_error().valid_up_to();
            problem(path, format!("byte {byte} is not UTF-8; an experiment is a text file"))
        })?;
        match store::toml_too_large(&text) {
            Some((expected, found)) => Err(problem(path, format!("expected {expected}, found {found}"))),
            None => Ok(text),
        }
    }

    /// The text of the calibration that a file here names: `evodrive:recorded`, `evodrive:kinds`, or a file beside it.
    pub fn text_beside(&self, name: &str) -> Result<String, ExperimentError> {
        if let Some(wanted) = name.strip_prefix(SHIPPED) {
            let known = CALIBRATIONS.map(|(known, _)| format!("{SHIPPED}{known}")).join(" and ");
            let unknown = || problem(Path::new(name), format!("the program carries {known} only"));
            let carried = CALIBRATIONS.into_iter().find(|(known, _)| *known == wanted);
            return carried.map(|(_, text)| text.to_string()).ok_or_else(unknown);
        }
        Place::of(&self.path_beside(Path::new(name))).read()
    }

    /// Returns the path of a file that a file here names.
    pub fn path_beside(&self, name: &Path) -> PathBuf {
        match self {
            Place::Shipped(..) => name.to_path_buf(),
            Place::Disk(path) => path.parent().unwrap_or(Path::new("")).join(name),
        }
    }

    /// The base that a file here names.
    pub fn beside(&self, base: &str, name: &str) -> Result<Place, ExperimentError> {
        if let Some(wanted) = base.strip_prefix(SHIPPED) {
            let known = PROTOCOLS.map(|(name, _)| format!("{SHIPPED}{name}"));
            let protocol = PROTOCOLS.iter().find(|(name, _)| *name == wanted);
            return protocol.map(|(name, text)| Place::Shipped(name, text)).ok_or_else(|| ExperimentError::Option {
                file: name.to_string(),
                error: OptionError::word("base", base, &known),
            });
        }
        match self {
            Place::Disk(path) => Ok(Place::of(&path.parent().unwrap_or(Path::new("")).join(base))),
            Place::Shipped(..) => Ok(Place::of(Path::new(base))),
        }
    }
}

/// A file that cannot be used.
pub fn problem(path: &Path, problem: String) -> ExperimentError {
    ExperimentError::File { file: path.display().to_string(), problem }
}
