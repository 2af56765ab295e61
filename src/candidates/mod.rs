//! Applies a patch, then the gates.

mod admit;
mod apply;
mod interface;
mod isolation;
mod parent;
mod protected;
mod schema;
#[cfg(test)]
mod tests;
mod weight;

pub use admit::{Admission, Trials, admit};
pub use apply::{ApplyError, apply};
pub use protected::PROTECTED;
