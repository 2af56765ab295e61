//! The paper's tables from recorded runs: our numbers with their intervals, the paper's beside them, and what both rest on.

mod ablations;
mod applied;
mod archives;
mod bases;
mod bases_searched;
mod basis;
mod bootstrap;
mod cells;
mod compared;
mod contacts;
mod critics;
mod csv;
mod error;
mod html;
mod key;
mod labels;
mod latex;
mod layout;
mod markdown;
mod metadrive;
mod named;
mod notes;
mod paper;
mod proposals;
mod resampled;
mod safebench;
#[cfg(test)]
mod safebench_tests;
mod searches;
mod shares;
mod stopped;
#[cfg(test)]
pub(in crate::evidence) mod tests;
mod unseen;

pub use applied::{Applied, Played, applied};
pub use bases::Bases;
pub use basis::{Basis, Leaf, Piece};
pub use bootstrap::{Estimate, PerScene, RESAMPLES, Search, estimates, interval};
pub use compared::{Compared, Comparison, Paired, STRICT_REALISM, compared};
pub use contacts::metadrive_contacts;
pub use critics::{INTERVENED, REPAIRED, REVIEWED, STOPPED, actor_critic};
pub use csv::{csv, line as csv_line};
pub use error::TableError;
pub use html::html;
pub use key::RowKey;
pub use latex::{escaped, latex};
pub use layout::{Cell, Column, Form, Head, Part, Row, RunSource, Table};
pub use markdown::markdown;
pub use metadrive::{metadrive_main, metadrive_policy};
pub use named::{Make, NAMED};
pub(in crate::evidence) use paper::safebench::AVERAGE;
pub use proposals::proposals;
pub(in crate::evidence) use safebench::round_columns as family_columns;
pub use safebench::{safebench_main, safebench_rounds};
pub use unseen::safebench_held_out;
