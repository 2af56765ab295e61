//! Who simulates rollouts for labels: our own simulator, or another one behind worker processes whose answers are recorded
//! and replayed. The outcome is always summed up here, by one account. `docs/BACKENDS.md` describes the protocol.

mod answer;
mod cassette;
mod error;
mod lower;
mod record;
mod replay;
mod request;
mod rollouts;
mod serve;
mod spec;
mod workers;

pub use answer::Answer;
pub use cassette::{Header, Recorded, RolloutCassette, RolloutCassetteError};
pub use error::{BackendError, Fault, Miss, NoOutcome};
pub use record::Recorder;
pub use replay::Replay;
pub use request::{Answers, PROTOCOL, Request};
pub use rollouts::Backend;
pub use serve::{Served, hello, serve};
pub use spec::{BackendOptions, PlanAround, WorkerOptions};
pub use workers::{Broken, Line, Start, Workers};

#[cfg(test)]
mod tests;
