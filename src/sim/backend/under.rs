//! The program under which a rollout is driven, as `begin` names it to a planner that is not blind.

use serde::Serialize;

use crate::kernel::Digest;

/// The program that moves others in a rollout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum ProgramContext {
    /// None: the scene as it is.
    Plain,
    /// One with which a lineage starts, by its hash.
    Parent { program: Digest },
    /// Any other one: evolved, or written by hand.
    Program { program: Digest },
}

impl ProgramContext {
    /// A program by its hash, and whether a lineage starts with it.
    pub fn program(program: Digest, is_parent: bool) -> ProgramContext {
        if is_parent { ProgramContext::Parent { program } } else { ProgramContext::Program { program } }
    }
}
