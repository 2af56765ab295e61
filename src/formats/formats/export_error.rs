//! The result of an export, and the errors of an export that fails.

use serde::Serialize;

use crate::scene::Scene;

/// The bytes of a file, and notes on the parts that they lack.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// The file.
    pub bytes: Vec<u8>,
    /// Everything in the scene that the format cannot hold, or holds only in another form.
    pub notes: Vec<Note>,
}

/// One thing that a reader of the exported file should know.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Note {
    /// Part of the scene, such as `tracks[3] "v12"`; empty for the whole scene.
    pub what: String,
    /// A plain sentence.
    pub reason: String,
}

impl Note {
    pub(super) fn new(what: impl Into<String>, reason: impl Into<String>) -> Note {
        Note { what: what.into(), reason: reason.into() }
    }
}

/// Why a scene cannot be exported.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ExportError {
    /// The scene breaks a rule that every scene keeps.
    #[error("scene {scene:?} cannot be exported: {violation}; correct it or import it again")]
    Unsound {
        /// Id of the scene.
        scene: String,
        /// The first rule that it breaks.
        violation: String,
    },
    /// The staging of a SafeBench scene does not match its traffic family.
    #[error(
        "the staging of scene {scene:?} does not fit it: found {found}, expected {expected}; build it from a rollout of this scene"
    )]
    Staging {
        /// Id of the scene.
        scene: String,
        /// Staging found.
        found: String,
        /// Staging expected.
        expected: String,
    },
    /// The scene lacks something that the format requires.
    #[error("scene {scene:?} cannot be a {format} file: it has no {missing}; choose the ScenarioNet JSON export")]
    Missing {
        /// Id of the scene.
        scene: String,
        /// The format.
        format: &'static str,
        /// Part that it lacks.
        missing: &'static str,
    },
}

/// Refuses a scene that breaks a rule of a valid scene.
pub(super) fn sound(scene: &Scene) -> Result<(), ExportError> {
    match scene.validate().first() {
        None => Ok(()),
        Some(violation) => Err(ExportError::Unsound { scene: scene.id.clone(), violation: violation.to_string() }),
    }
}
