//! The closed loop, and motion that another simulator tells.

pub(super) mod closed_loop;
#[cfg(test)]
mod plain;
mod recorder;
mod reenacted;
pub mod reported;
mod reported_check;
#[cfg(test)]
mod reported_tests;
pub mod rollout;

pub use reenacted::{judge, tell};
pub use reported::{Pose, ReportedActor, ReportedContact, ReportedError, ReportedRollout, adversaries_of, commands};
pub use rollout::{Part, RolloutCost, ending, rollout, rollout_counted, rollout_in_parts, rollout_traced};
