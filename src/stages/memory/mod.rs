//! Memory: cards from attempts, and their causal retrieval.

mod curate;
mod reflect;
mod retrieve;
mod store;
mod text;

#[cfg(test)]
mod tests;

pub use curate::{CurationContext, CurationOptions, curate};
pub use reflect::{Hint, hint, reflect};
pub use retrieve::{MemoryOptions, MemoryOptionsError, Query, retrieve, score, tags_of};
pub use store::{Memory, MemoryError};
