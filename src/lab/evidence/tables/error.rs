//! Reasons why runs give no table.

use crate::kernel::canon::CanonError;
use crate::objects::{LineageId, SolutionId};

/// Runs that give no table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    #[error("no run is named; name at least one with --run")]
    NoRuns,
    #[error("run {run} is not finished, so its held-out scenes have not been opened; finish it with `evodrive resume`")]
    Unfinished { run: String },
    #[error(
        "run {run}: the result names {solution} of lineage {lineage}, but the transcript holds no held-out labels of it; \
         derive the run again with `evodrive replay`"
    )]
    NoLabels { run: String, lineage: LineageId, solution: SolutionId },
    #[error(
        "run {run} was recorded by an earlier build, which did not keep the single runs on held-out routes; make it again from its \
         cassette with `evodrive run` and its experiment file"
    )]
    NoHeldOutRuns { run: String },
    #[error("row {row} with ego {ego} is in {first} and in {second}; name runs that hold it once")]
    Twice { row: String, ego: String, first: String, second: String },
    #[error(
        "run {run} searched by {method}, and behind the first run this table takes null searches alone, one of each: search.method = \
         \"random_proposals\" or \"shuffled_labels\"; leave it out"
    )]
    NoNullSearch { run: String, method: String },
    #[error("run {run} followed {found}; its tables are {tables}")]
    OtherProtocol { run: String, found: &'static str, tables: &'static str },
    #[error(
        "attack of run {first} is `{of_first}`, that of run {second} is `{of_second}`: different measures cannot be compared; \
         name runs of experiments with the same [evaluation.attack]"
    )]
    OtherAttack { first: String, of_first: String, second: String, of_second: String },
    #[error("run {run}: the archive of lineage {lineage} {what}; derive the run again with `evodrive replay`")]
    Archive { run: String, lineage: LineageId, what: String },
    #[error("run {run}: {error}")]
    Canon { run: String, error: CanonError },
}
