//! The paper's tables from recorded runs: our numbers with their intervals, the paper's beside them, and what both rest on.

mod bootstrap;
mod csv;
mod labels;
mod latex;
mod layout;
mod markdown;
mod metadrive;
mod paper;
mod stopped;

pub use bootstrap::Estimate;
pub use csv::csv;
pub use labels::TableError;
pub use latex::latex;
pub use layout::{Column, Form, Row, RunSource, Table, Value};
pub use markdown::markdown;
pub use metadrive::{metadrive_main, metadrive_policy};
