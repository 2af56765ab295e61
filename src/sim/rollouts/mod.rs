//! The closed loop, and motion that another simulator tells.

pub(super) mod closed_loop;
#[cfg(test)]
mod plain;
mod recorder;
mod retold;
pub mod rollout;
pub mod told;
mod told_check;
#[cfg(test)]
mod told_tests;

pub use retold::{judge, tell};
pub use rollout::{Part, RolloutCost, ending, rollout, rollout_counted, rollout_in_parts, rollout_traced};
pub use told::{Pose, Told, ToldActor, ToldContact, ToldError, adversaries_of, commands};
