//! The seeded 2-D closed-loop simulator: what happens when an intervention meets the ego.

pub mod bicycle;
pub mod body;
pub mod drivable;
pub mod driver;
pub mod driving;
pub mod error;
pub mod gaps;
pub mod idm;
pub mod intervention;
pub mod outcome;
pub mod path;
pub mod plant;
pub mod rollout;
mod rows;
pub mod script;
pub mod skills;

mod actors;
mod contact;
mod course;
mod motion;
mod others;
mod recorder;
mod trace_digest;
mod traffic;
mod triggered;
mod watch;

pub use body::Size;
pub use driver::{Control, Driver, EgoState, Seen, View};
pub use driving::{ActorConduct, Driving};
pub use error::SimError;
pub use intervention::{Action, ActorRef, Intervention};
pub use outcome::{ActorTrace, AdversaryReport, Contact, End, Motion, Outcome, Striker, Trace};
pub use path::{Along, Path};
pub use plant::Plant;
pub use rollout::{Part, RolloutCost, rollout, rollout_counted, rollout_in_parts, rollout_traced};
pub use script::{Phase, Script, Speed, Trigger, Until, Way};

/// Part of every rollout key; rises when any outcome can change.
pub const SIM_VERSION: u32 = 1;

#[cfg(test)]
mod plain;
#[cfg(test)]
#[allow(dead_code)]
#[path = "../../tests/all/scenes.rs"]
mod scenes;
