//! Backends that simulate rollouts for labels: our own simulator, or another one behind worker processes whose answers are recorded
//! and replayed. The outcome is always computed here, by the same code. `docs/BACKENDS.md` describes the protocol.

mod answer;
mod cassette;
mod crew;
mod driver;
mod error;
mod lines;
mod lower;
mod map_near;
mod planner;
mod planners;
mod record;
mod replay;
mod request;
mod rollouts;
mod serve;
mod spec;
mod under;
mod workers;

pub use answer::Answer;
pub use cassette::{Header, Recorded, RolloutCassette, RolloutCassetteError};
pub use driver::DriverOptions;
pub use error::{BackendError, Fault, Miss, NoOutcome};
pub use lower::lowered;
pub use planners::Planners;
pub use record::Recorder;
pub use replay::Replay;
pub use request::{Answers, PROTOCOL, Request};
pub use rollouts::Backend;
pub use serve::{Served, hello, serve};
pub use spec::{BackendOptions, PlanAround, WorkerOptions};
pub use under::{DriveContext, ProgramContext};
pub use workers::{Broken, Line, Start, Workers};

#[cfg(test)]
mod driver_tests;
#[cfg(test)]
mod tests;
