//! From a program to what it does in one scene: the decision, and the intervention that carries it out.

pub mod actors;
pub mod choice;
pub mod constraints;
pub mod decision;
pub mod failure;
pub mod filters;
pub mod prepared;
pub mod timing;
pub mod walk;

pub use crate::motion::Window;
pub use crate::stage::{Situation, SituationError};
pub use decision::{ActorDecision, Decision, FilterReport};
pub use failure::CompileFailure;
pub use prepared::Prepared;

use crate::adapters::Contract;
use crate::kernel::Seed;
use crate::objects::Program;
use crate::sim::Intervention;

/// A program made concrete for one scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Compiled {
    pub decision: Decision,
    /// Empty where the program does not apply: plain replay.
    pub intervention: Intervention,
}

/// Compiles for one scene. For many scenes prepare once: [`Prepared::new`], then [`Prepared::compile`].
pub fn compile(
    program: &Program,
    contract: &Contract,
    situation: &Situation,
    seed: Seed,
) -> Result<Compiled, CompileFailure> {
    Prepared::new(program, contract)?.compile(situation, seed)
}

#[cfg(test)]
mod tests;
