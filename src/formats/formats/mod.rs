//! The file formats of scenarios, one folder each, with import and export side by side: pure functions between bytes
//! and scenes. One bad file never stops the others. Whatever is left out, or does not fit into a format, is named with
//! its reason.

pub mod assemble;
pub mod centreline;
pub mod commonroad;
pub mod conventions;
#[cfg(test)]
mod conventions_tests;
pub mod derived;
pub mod export_error;
#[cfg(test)]
mod export_tests;
pub mod gpudrive;
#[cfg(test)]
mod hostile;
pub mod import_error;
pub mod imported;
mod json_numbers;
mod levels;
pub mod log;
mod log_map;
pub mod opendrive;
pub mod openscenario;
pub mod read_as;
pub mod resample;
pub mod safebench;
pub mod scenarionet;
mod sizes;
pub mod speed_limit;
pub mod staging;
pub mod summary;
pub mod topology;
pub mod torch;
pub mod waymo;
mod wrapped;
pub mod xml_read;
pub mod xml_write;

pub use export_error::{ExportError, Exported, Note};
pub use import_error::ImportError;
pub use imported::Imported;
pub use staging::{Inserted, Staging};
pub use summary::{ImportSummary, import_files};
