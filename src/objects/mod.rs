//! The nouns that travel between rooms: program, patch, review, candidate, route, score, attempt, card, archive entry, ids.

pub mod attempt;
pub mod card;
pub mod event;
pub mod entry;
pub mod expr;
pub mod ids;
pub mod patch;
pub mod program;
pub mod review;
pub mod score;

pub use attempt::*;
pub use card::{Card, CardKind};
pub use entry::Entry;
pub use ids::{AttemptId, CardId, FamilyName, LineageId, SolutionId};
pub use patch::{EDITABLE_SURFACE, Operation, OperationKind, ProgramPatch};
pub use program::*;
pub use review::{Advice, Review, Role};
pub use score::{Objectives, SceneFailure, SceneScore, Score};
