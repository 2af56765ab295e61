//! Applies a patch, then the gates.

mod admit;
mod apply;
mod bodies;
mod free;
mod interface;
mod isolation;
mod parent;
mod protected;
mod random;
mod schema;
#[cfg(test)]
mod tests;
mod weight;

pub use admit::{Admission, Judging, Trials, admit};
pub use apply::{ApplyError, apply};
pub use free::{FreeRange, free_ranges};
pub use isolation::words_of_others;
pub use protected::PROTECTED;
pub use random::{Places, random_patch};
