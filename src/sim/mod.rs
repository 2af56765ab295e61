//! The seeded 2-D closed-loop simulator: what happens when an intervention meets the ego.

pub mod bicycle;
pub mod body;
pub mod drivable;
pub mod driver;
pub mod driving;
pub mod error;
pub mod feasibility;
pub mod gaps;
pub mod idm;
pub mod intervention;
pub mod law;
pub mod options;
pub mod outcome;
pub mod path;
pub mod plant;
pub mod plant_options;
pub mod rollout;
mod rows;
pub mod script;
pub mod skills;
pub mod smooth;
pub mod told;

mod account;
mod actors;
mod avoidance;
mod bystanders;
mod class;
mod closed_loop;
mod contact;
mod course;
mod evasion;
mod motion;
mod obedience;
mod others;
mod ray;
mod recorder;
mod retold;
mod sight;
mod threat;
mod told_check;
mod touch;
mod trace_digest;
mod traffic;
mod triggered;
mod watch;

pub use avoidance::{assess, rollout_assessed};
pub use body::Size;
pub use class::ContactClass;
pub use contact::meeting;
pub use driver::{Control, Driver, EgoState, Seen, View};
pub use driving::{ActorConduct, Driving};
pub use error::SimError;
pub use feasibility::Feasibility;
pub use intervention::{Action, ActorRef, Intervention};
pub use law::{Law, Observed};
pub use options::{AvoidanceOptions, SimulatorOptions, SimulatorOptionsError};
pub use outcome::{ACTED_M, ActorTrace, AdversaryReport, Contact, End, Motion, Outcome, Striker, Trace};
pub use path::{Along, Path};
pub use plant::Plant;
pub use plant_options::{EgoBox, FollowerStart, Obstacle, PlantOptions};
pub use retold::{judge, tell};
pub use rollout::{Part, RolloutCost, ending, rollout, rollout_counted, rollout_in_parts, rollout_traced};
pub use script::{Phase, Script, Speed, Trigger, Until, Way};
pub use told::{Pose, Told, ToldActor, ToldContact, ToldError, adversaries_of, commands};
pub use touch::Side;

/// Part of every rollout key; rises when any outcome can change.
pub const SIM_VERSION: u32 = 3;

#[cfg(test)]
mod plain;
#[cfg(any(test, feature = "fixtures"))]
#[allow(dead_code)]
#[path = "../../tests/all/scenes.rs"]
pub mod scenes;
#[cfg(test)]
mod told_tests;
