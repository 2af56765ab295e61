//! Reasons why runs give no figure.

use crate::evidence::tables::TableError;
use crate::objects::LineageId;

/// Runs that give no such figure.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    #[error("no run holds a proposal with a patch that could be read; name a run with attempts")]
    NoPatches,
    #[error(
        "in no epoch of these runs were all ranked candidates simulated, so random and ranked order cannot be compared; \
         name a run whose budget takes every candidate, e.g. of experiments/world/full.toml"
    )]
    NothingRanked,
    #[error("the run has no lineage {wanted}; it has {}", known.join(", "))]
    NoLineage { wanted: LineageId, known: Vec<String> },
    #[error("the run's labels tell no traffic family {wanted} apart; they tell {}", if known.is_empty() { "none, as it is not of SafeBench's protocol".into() } else { known.join(", ") })]
    NoFamily { wanted: String, known: Vec<String> },
    #[error(
        "no run holds archives by round; name a run of SafeBench's protocol, e.g. of experiments/safebench/all-idm.toml"
    )]
    NoRounds,
    #[error(
        "these runs have no held-out scene in which a reported program attacks and its parent does not, so there is no pair to show"
    )]
    NothingWon,
    #[error("no run holds a labelled program that acts; finish a run with `evodrive resume`, or name another")]
    NoLabels,
    #[error("these runs have more than {most} lineages, too many for a sheet; name one by --lineage: {}", known.join(", "))]
    TooManyLineages { most: usize, known: Vec<String> },
    #[error(transparent)]
    Table(#[from] TableError),
    #[error(
        "docs/ARCHITECTURE.md holds no journey of a patch: expected two lines of words under `## A patch's journey`, verbs and rooms"
    )]
    NoJourney,
    #[error("docs/ARCHITECTURE.md holds no table of rooms: expected lines `| floor | room | holds | may import |`")]
    NoRooms,
}
