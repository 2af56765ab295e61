//! State, frozen snapshot, workers, serial acceptor: the paper's parallel epoch. `run.rs` is the page to read first.

mod acceptance;
mod briefs;
#[cfg(test)]
mod compact_tests;
#[cfg(test)]
mod detailed_tests;
mod error;
mod freeze;
#[cfg(test)]
mod groups_tests;
mod labelling;
mod open;
mod planning;
#[cfg(test)]
mod predicting_tests;
#[cfg(test)]
mod rules_tests;
mod run;
#[cfg(test)]
mod search_tests;
mod setting;
mod slots;
mod state;
#[cfg(test)]
mod tests;

pub use acceptance::redraw::{Redraw, Replaced};
pub use briefs::briefing::cluster_of;
pub use error::RunError;
pub use labelling::applied::{Applied, Labelled};
pub use labelling::play::{Player, Traced};
pub use labelling::rollouts::{Mode, RolloutCounts, Rollouts, TrialRecord, no_label_key, record_digest};
pub use planning::carried::{CarriedAnswers, RecordedAnswer};
pub use planning::plan::plan;
pub use planning::walk::{LineageJob, WalkRecord};
pub use planning::walker::{go, known};
pub use planning::wanted::{Task, Wanted, Whole};
pub use planning::work::{Done, Workbench};
pub use run::run;
pub use setting::cost::{Clock, Meter};
pub use setting::desk::{Desk, Tools};
pub use setting::options::{CompositionOptions, CounselOptions, ProposalOptions, Without};
pub use setting::progress::Progress;
pub use setting::questions::{Occasions, asked_at_most, occasion_of};
pub use setting::study::{Budget, LineageSpec, SceneEntry, Start, Study};
