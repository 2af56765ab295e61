//! From a program to what it does in one scene: the decision, and the intervention that carries it out.

mod actions;
pub mod actors;
pub mod choice;
pub mod constraints;
pub mod decision;
pub mod failure;
pub mod filters;
mod flow;
pub mod law;
mod merge;
pub mod prepared;
mod rehearse;
mod reshape;
pub mod searched;
pub mod timing;
pub mod walk;

pub use crate::motion::Window;
pub use crate::stage::{Situation, SituationError};
pub use decision::{ActorDecision, Compiled, Decision, FilterReport};
pub use failure::CompileFailure;
pub use prepared::Prepared;
pub use searched::Searched;

use crate::kernel::Seed;
use crate::objects::Program;
use crate::stage::Source;

/// Compiles for one scene. For many scenes prepare once: [`Prepared::new`], then [`Prepared::compile`].
pub fn compile(
    program: &Program,
    source: &Source,
    situation: &Situation,
    seed: Seed,
) -> Result<Compiled, CompileFailure> {
    Prepared::new(program, source)?.compile(situation, seed)
}

#[cfg(test)]
mod tests;
