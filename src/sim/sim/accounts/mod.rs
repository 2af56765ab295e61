//! Accounts of a rollout: the outcome, and the meters that sum it up.

pub(super) mod account;
pub mod driving;
pub(super) mod end;
pub mod feasibility;
pub(super) mod motion;
pub mod of_kind;
pub mod of_place;
pub mod outcome;
mod range;
pub mod smooth;
mod trace_digest;
mod watch;

pub use driving::{ActorConduct, Driving};
pub use end::End;
pub use feasibility::Feasibility;
pub use of_kind::OfKind;
pub use of_place::OfPlace;
pub use outcome::{ACTED_M, ActorTrace, AdversaryReport, Contact, Motion, Outcome, Trace, WithRecording};
