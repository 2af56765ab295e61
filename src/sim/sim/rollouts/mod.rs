//! The closed loop, and motion that another simulator reports.

pub(super) mod closed_loop;
mod episode;
mod fault_of;
mod held;
mod part;
#[cfg(test)]
mod plain;
mod recorder;
mod reenacted;
mod repeated;
pub mod reported;
mod reported_check;
#[cfg(test)]
mod reported_tests;
mod retraced;
pub mod rollout;
pub(super) mod rules;
mod shared;
mod undriven;

pub use episode::Episode;
pub use fault_of::fault_of;
pub use held::Held;
pub use part::{Part, RolloutCost};
pub use reenacted::{judge, reported_timeline, tell};
pub use repeated::Repeated;
pub use reported::{
    ContactBoxes, Pose, ReportedActor, ReportedContact, ReportedError, ReportedRollout, adversaries_of, commands,
};
pub use retraced::{Retraced, retraced};
pub use rollout::{
    contact_within, ending, rollout, rollout_assessed, rollout_counted, rollout_explained, rollout_in_parts,
    rollout_traced,
};
pub use shared::{Agent, SharedScene};
pub use undriven::Undriven;
