//! Chains of parents, promotion, continuity.

mod continuity;
mod record;
mod store;

pub use record::{AttemptRecord, Leader, Lineage, Link, Promotion};
pub use store::{LineageError, LineageStore};
