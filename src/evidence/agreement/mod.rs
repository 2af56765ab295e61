//! How far two simulators agree about the same rollouts: whether the ego meets a road user, which one, when, and where it was
//! before, and whether the labels that a search maximises are the same. Pure counting over pairs of rollouts; who plays them is `cli::studies::agree`'s business.

mod count;
mod disagreement;
mod pair;
mod text;

pub use count::{Report, report};
pub use pair::{Meeting, Pair, Side, Tried};
pub use text::text;

#[cfg(test)]
mod tests;
