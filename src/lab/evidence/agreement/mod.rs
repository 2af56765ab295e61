//! Agreement of two simulators about the same rollouts: whether the ego meets a road user, which one, when, and where it was
//! before, and whether the labels that a search maximises are the same. Pure counting over pairs of rollouts; who plays them is `cli::studies::agree`'s business.

mod count;
mod disagreement;
mod interval;
mod pair;
mod text;
mod transfer;

pub use count::{Report, report};
pub use pair::{Meeting, Pair, Side, Tried};
pub use text::text;
pub use transfer::{Descent, Transfer};

#[cfg(test)]
mod tests;
