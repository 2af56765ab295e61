//! Who meets whom, in what manner, and whether the ego could have avoided it.

pub(super) mod avoidance;
pub(super) mod bystanders;
pub(super) mod class;
pub(super) mod contact;
mod evasion;
pub mod gaps;
pub(super) mod hit;
mod sight;
mod threat;
pub(super) mod touch;

pub use avoidance::{assess, lateness_s};
pub use class::ContactClass;
pub use contact::meeting;
pub use touch::{Side, Striker};
