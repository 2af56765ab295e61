//! Road users: the ego's driver, the traffic, and adversaries with their laws, scripts and skills.

pub(super) mod actors;
pub mod bicycle;
pub mod driver;
pub mod idm;
pub mod intervention;
pub mod law;
pub(super) mod obedience;
pub(super) mod observing;
pub(super) mod others;
pub mod script;
pub mod skills;
pub(super) mod sprung;
pub(super) mod traffic;
mod triggered;

pub use driver::{Control, Driver, EgoState, View};
pub use intervention::{Action, ActorRef, Intervention};
pub use law::{Law, Observed};
pub use others::Seen;
pub use script::{Phase, Script, Speed, Trigger, Until, Way};
