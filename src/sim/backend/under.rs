//! The program under which a rollout is driven, as `begin` names it to a planner that is not blind.

use serde::Serialize;

use crate::kernel::{Digest, Seed};

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

/// What a planner or another simulator may go by beside a scene and its commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveContext {
    /// The seed of the run.
    pub seed: Seed,
    /// The program behind the commands, for planners that ask for it.
    pub under: ProgramContext,
}

impl DriveContext {
    /// The context of a scene without a program.
    pub fn plain(seed: Seed) -> DriveContext {
        DriveContext { seed, under: ProgramContext::Plain }
    }
}
