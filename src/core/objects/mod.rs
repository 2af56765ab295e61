//! The nouns that travel between rooms: program, patch, review, candidate, route, score, attempt, card, archive entry,
//! world snapshot, ids.

pub mod attempt;
pub mod benchmark;
pub mod card;
pub mod composition;
pub mod cost;
pub mod counsel;
pub mod diff;
pub mod downstream;
pub mod entry;
pub mod event;
pub mod expr;
#[cfg(any(test, feature = "fixtures"))]
pub mod fixture;
pub mod flow_step;
pub mod ids;
pub mod origin;
pub mod patch;
pub mod pointer;
pub mod program;
pub mod replay;
pub mod review;
pub mod rules;
pub mod score;
pub mod value_type;
pub mod world;
pub mod world_audit;
pub mod world_patch;

pub use attempt::*;
pub use card::{Card, CardKind};
pub use composition::{Composed, Composition};
pub use counsel::{Counsel, Counselled};
pub use diff::{Surface, edit_categories, program_diff, program_text};
pub use entry::Entry;
pub use flow_step::FlowStep;
pub use ids::{AttemptId, CardId, FamilyName, LineageId, SolutionId};
pub use origin::{HandOrigin, Origin, RunOrigin};
pub use patch::{EDITABLE_SURFACE, FREE_SIGN, FreeConstant, Operation, OperationKind, ProgramPatch};
pub use pointer::Pointer;
pub use program::*;
pub use review::{Advice, Review, Role};
pub use rules::{
    AcceptanceRequirement, AttackRequirement, FrontOf, FrontPer, GatesAsked, JudgedOn, LabelRules, OverEgos,
    RealismMean, ReportedBy, Required, Taking, Ties, UnreadableCritic, UnreadablePatch, is_unsaid, is_yes, yes,
};
pub use score::{Met, Objectives, RealismSums, SceneFailure, SceneScore, Score, abandoned, realism_name, too_slow};
pub use value_type::ValueType;
pub use world::*;
pub use world_audit::*;
pub use world_patch::*;
