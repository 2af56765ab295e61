//! State, frozen snapshot, workers, serial acceptor: the paper's parallel epoch. `run.rs` is the page to read first.

mod admit;
mod applied;
mod briefing;
mod composition;
mod consider;
mod cost;
mod counsel;
mod counsels;
mod desk;
mod draft;
mod error;
mod evaluate;
mod finale;
mod freeze;
mod labels;
mod measure;
mod open;
mod options;
mod play;
mod probes;
mod progress;
mod propose;
mod replayed;
mod rollouts;
mod rounds;
mod route;
mod run;
mod seal;
mod settle;
mod situations;
mod standings;
mod state;
mod study;
#[cfg(test)]
mod tests;

pub use applied::{Applied, Labelled};
pub use cost::{Clock, Meter};
pub use desk::{Desk, Tools};
pub use error::RunError;
pub use options::{CompositionOptions, CounselOptions};
pub use play::{Player, Traced};
pub use progress::Progress;
pub use rollouts::{Mode, Rollouts, record_digest};
pub use run::run;
pub use study::{Budget, LineageSpec, SceneEntry, Start, Study};
