//! Family contracts: editable ranges, operators, mechanisms, constraints; the registry of families.

pub mod contract;
pub mod vocabulary;

pub use contract::*;
pub use vocabulary::Feature;

/// Part of every LLM and rollout key; rises when a contract, a prompt or the compiler changes meaning.
pub const ADAPTER_VERSION: u32 = 1;
