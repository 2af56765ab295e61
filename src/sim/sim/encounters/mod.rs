//! Contacts between road users: their manner, and if the ego could have avoided them.

pub(super) mod avoidance;
pub(super) mod bystanders;
pub(super) mod class;
pub(super) mod contact;
mod evasion;
pub mod fault;
pub mod gaps;
pub(super) mod hit;
mod jury;
mod sight;
mod threat;
pub(super) mod timeline;
pub(super) mod touch;
pub(super) mod verdict;
mod ways;

pub use avoidance::{assess, lateness_s};
pub use class::ContactClass;
pub use contact::meeting;
pub use evasion::Manoeuvre;
pub use fault::Fault;
pub use jury::jury;
pub use timeline::{Chance, Reacted, Reaction, Timeline};
pub use touch::{Side, Striker};
pub use verdict::{Jury, avoided_in_words};
