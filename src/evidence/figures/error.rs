//! Why runs give no figure.

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
    #[error(
        "in no lineage of these runs is there a held-out scene in which the reported program attacks and its parent does not, so there is no \
         pair to show"
    )]
    NothingWon,
    #[error("docs/ARCHITECTURE.md holds no table of rooms: expected lines `| floor | room | holds | may import |`")]
    NoRooms,
}
