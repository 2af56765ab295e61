//! What the paper of ours is made of beside tables and figures: its plan, its numbers as macros, and the check that none is typed.

mod numbers;
mod plan;
mod typed;

pub use numbers::{numbers, of_agreement};
pub use plan::{Piece, Plan, PlanError, PlannedRun, What, plan};
pub use typed::{Typed, typed_numbers, unknown_numbers};
