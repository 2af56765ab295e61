//! State, frozen snapshot, workers, serial acceptor: the paper's parallel epoch. `run.rs` is the page to read first.

mod acceptance;
mod ahead;
mod briefs;
#[cfg(test)]
mod compact_tests;
#[cfg(test)]
mod detailed_tests;
mod error;
mod freeze;
mod labelling;
mod open;
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
pub use ahead::carried::{Carried, RecordedAnswer};
pub use ahead::plan::plan;
pub use ahead::walk::{Walk, WalkRecord};
pub use ahead::walker::{go, known};
pub use ahead::wanted::{Task, Wanted, Whole};
pub use ahead::work::{Done, Workbench};
pub use briefs::briefing::cluster_of;
pub use error::RunError;
pub use labelling::applied::{Applied, Labelled};
pub use labelling::play::{Player, Traced};
pub use labelling::rollouts::{Mode, Rollouts, TrialRecord, no_label_key, record_digest};
pub use run::run;
pub use setting::cost::{Clock, Meter};
pub use setting::desk::{Desk, Tools};
pub use setting::options::{CompositionOptions, CounselOptions, ProposalOptions, Without};
pub use setting::progress::Progress;
pub use setting::questions::{Occasions, asked_at_most, occasion_of};
pub use setting::study::{Budget, LineageSpec, SceneEntry, Start, Study};
