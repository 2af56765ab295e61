//! Why a program cannot be compiled.

use crate::scene::TrackIx;
use crate::stage::StageError;

/// A failed compilation: a finding about the program, never a score.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompileFailure {
    /// The program breaks its family's contract.
    #[error("the program breaks its contract: {}", .0.join("; "))]
    Contract(Vec<String>),
    /// The program has no canonical bytes, and so no name; the text says why.
    #[error("the program cannot be hashed: {0}")]
    Hash(String),
    /// A node of the program, by its name, cannot do its work in this scene.
    #[error("node {node}: {source}")]
    Node {
        /// Its name in the program.
        node: String,
        /// Error that stopped it.
        source: StageError,
    },
    /// Γ_map, Γ_dyn or Γ_api does not hold in this scene.
    #[error("scene {scene}, track {actor}, step {step}: constraint {constraint} needs {expected}, found {found}")]
    Constraint {
        /// The scene's name.
        scene: String,
        /// The constraint that does not hold.
        constraint: &'static str,
        /// Road user for which it does not hold: a track, or a place beyond the tracks for an inserted one.
        actor: TrackIx,
        /// The step of the scene.
        step: usize,
        /// Measured value, with its unit.
        found: String,
        /// Requirement of the constraint.
        expected: &'static str,
    },
}
