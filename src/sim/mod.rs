//! The seeded 2-D closed-loop simulator: what happens when an intervention meets the ego.

pub mod intervention;
pub mod outcome;

pub use intervention::{Action, ActorRef, Intervention};
pub use outcome::{ActorTrace, AdversaryReport, Contact, End, Motion, Outcome, Striker, Trace};

/// Part of every rollout key; rises when any outcome can change.
pub const SIM_VERSION: u32 = 1;
