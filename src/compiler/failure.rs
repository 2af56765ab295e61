//! Why a program cannot be compiled.

use crate::scene::TrackIx;
use crate::stage::StageError;

/// A failed compilation: a finding about the program, never a score.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompileFailure {
    /// The program breaks its family's contract.
    #[error("the program breaks its contract: {}", .0.join("; "))]
    Contract(Vec<String>),
    #[error("the program cannot be hashed: {0}")]
    Hash(String),
    #[error("node {node}: {source}")]
    Node { node: String, source: StageError },
    /// Γ_map, Γ_dyn or Γ_api does not hold in this scene.
    #[error("scene {scene}, track {actor}, step {step}: constraint {constraint} needs {expected}, found {found}")]
    Constraint {
        scene: String,
        constraint: &'static str,
        actor: TrackIx,
        step: usize,
        found: String,
        expected: &'static str,
    },
}
