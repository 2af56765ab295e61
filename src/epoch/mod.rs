//! State, frozen snapshot, workers, serial acceptor: the paper's parallel epoch. `run.rs` is the page to read first.

mod acceptor;
mod briefing;
mod composition;
mod cost;
mod counsel;
mod draft;
mod error;
mod finale;
mod labels;
mod open;
mod progress;
mod rollouts;
mod rounds;
mod run;
mod state;
mod study;

pub use composition::CompositionOptions;
pub use cost::{Clock, Meter};
pub use counsel::{CounselOptions, Counsels};
pub use error::RunError;
pub use labels::{Traced, labelled_rollout, trace};
pub use progress::Progress;
pub use rollouts::{Mode, Rollouts, record_digest};
pub use run::{Desk, run};
pub use study::{Budget, LineageSpec, SceneEntry, Study};
