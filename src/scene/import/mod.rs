//! From the formats people have to scenes: pure functions from bytes, one file a format. One bad file never stops
//! the others, and what is left out is named with its reason.

pub mod assemble;
pub mod centreline;
pub mod commonroad;
pub mod error;
pub mod gpudrive;
#[cfg(test)]
mod hostile;
pub mod opendrive;
pub mod pickle;
pub mod resample;
pub mod safebench;
pub mod scenarionet;
pub mod scenarionet_json;
pub mod summary;
pub mod tfrecord;
pub mod topology;
pub mod waymo;
pub mod xml;

pub use error::ImportError;
pub use summary::{ImportSummary, Imported, import_files};
