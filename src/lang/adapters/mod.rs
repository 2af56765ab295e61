//! Family contracts: editable ranges, operators, mechanisms, constraints; the registry of families.

pub mod changes;
pub mod check;
pub mod contract;
pub mod domain;
pub mod flow;
pub mod graph;
pub mod isolation;
pub mod mechanisms;
pub mod names;
pub mod problem;
pub mod prompt;
#[cfg(test)]
mod tests;
#[cfg(test)]
pub mod toy;
pub mod vocabulary;

pub use changes::Change;
pub use contract::*;
pub use graph::node_count_range;
pub use isolation::{ForeignVocabulary, ForeignWord};
pub use problem::Problem;
pub use vocabulary::Feature;

/// Part of every LLM and rollout key; rises when a contract, a prompt or the compiler changes meaning.
pub const ADAPTER_VERSION: u32 = 3;
