//! The paper's tables from recorded runs: our numbers with their intervals, the paper's beside them, and what both rest on.

mod ablations;
mod applied;
mod archives;
mod basis;
mod called;
mod caption;
mod cells;
mod compared;
mod contacts;
mod critics;
mod csv;
mod derivations;
mod drivers;
mod error;
mod form;
mod frontier;
mod gains;
mod html;
mod key;
mod labels;
mod latex;
mod latex_grid;
mod layout;
mod markdown;
mod metadrive;
mod named;
mod notes;
mod page;
mod paper;
mod placed;
mod plain;
mod proposals;
mod readings;
mod resampled;
mod safebench;
#[cfg(test)]
mod safebench_tests;
#[cfg(test)]
pub(in crate::evidence) use safebench_tests::recorded_unseen;
mod searches;
mod shares;
mod stopped;
#[cfg(test)]
pub(in crate::evidence) mod tests;
mod transfer;
mod unseen;

pub use crate::statistics::{Estimate, PerScene, RESAMPLES, Search, estimates, interval};
pub use applied::{Applied, Played, applied};
pub use basis::{Derivation, Leaf, Repetition};
pub(in crate::evidence) use called::called;
pub use compared::{Compared, Comparison, Drawn, Paired, Pooled, STRICT_REALISM, compared, compared_labels, pooled};
pub use contacts::metadrive_contacts;
pub use critics::{INTERVENED, REPAIRED, REVIEWED, STOPPED, actor_critic};
pub use csv::{csv, line as csv_line};
pub use derivations::{Derivations, Source};
pub use drivers::DRIVERS;
pub use error::TableError;
pub use gains::metadrive_gains;
pub use html::html;
pub use key::RowKey;
pub(in crate::evidence) use labels::proposals as proposers;
pub use latex::{Form as LatexForm, escaped, latex};
pub use layout::{Cell, Column, Form, Head, Part, Row, RunSource, Table};
pub use markdown::markdown;
pub use metadrive::{metadrive_main, metadrive_policy};
pub use named::{Make, NAMED};
pub use notes::{AllAlike, one_seed};
pub(in crate::evidence) use notes::{of_runs as run_notes, runs as run_sources};
pub use page::of_a_page;
pub(in crate::evidence) use paper::safebench::AVERAGE;
pub use placed::{Placed, Point as PlacedPoint, SearchKind, placed, searched};
pub use plain::plain;
pub use proposals::proposals;
pub use readings::{
    Contacts, LineagePreventable, SearchedContacts, is_ram, metadrive_readings, prevented, searched_contacts,
};
pub(in crate::evidence) use safebench::round_columns as family_columns;
pub use safebench::{safebench_main, safebench_rounds};
pub use transfer::{Careful, Line, Transferred, judges, panels, sensitivity, transfer};
pub use unseen::{held_out_change, safebench_held_out};
