//! The paper's figures from recorded runs, each one function from runs to a sheet of shapes (`draw::Figure`): what the command
//! `figure`, the report and the paper show is the same sheet.

mod area_rounds;
mod case_evolution;
mod edits;
mod legend;
mod rooms;
#[cfg(test)]
mod tests;
mod world_order;

pub use area_rounds::area_rounds;
pub use case_evolution::case_evolution;
pub use edits::patch_surface;
pub use rooms::architecture;
pub use world_order::world_order;

use super::recorded_run::RecordedRun;
use crate::objects::LineageId;

/// Runs that give no such figure.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    #[error("no run holds a proposal with a patch that could be read; name a run with attempts")]
    NoPatches,
    #[error(
        "no epoch of these runs was simulated whole while its candidates were ranked, so random and ranked order cannot be compared; \
         name a run whose budget takes every candidate, e.g. of experiments/world/full.toml"
    )]
    NothingRanked,
    #[error("the run has no lineage {wanted}; it has {}", known.join(", "))]
    NoLineage { wanted: LineageId, known: Vec<String> },
    #[error(
        "no run holds archives by round; name a run of SafeBench's protocol, e.g. of experiments/safebench/all-idm.toml"
    )]
    NoRounds,
    #[error("docs/ARCHITECTURE.md holds no table of rooms: expected lines `| floor | room | holds | may import |`")]
    NoRooms,
}

/// What stands under a figure: the runs, and what their proposals came from.
fn source(stories: &[&RecordedRun]) -> String {
    let named: Vec<String> =
        stories.iter().map(|story| format!("{} (root {})", story.opened.name, story.root.short(12))).collect();
    let scripted = stories.iter().any(|story| !story.opened.scripted_roles().is_empty());
    let from = if scripted { "; proposals of the scripted stand-in, which is no language model" } else { "" };
    format!("Recorded: {}{from}.", named.join(", "))
}
