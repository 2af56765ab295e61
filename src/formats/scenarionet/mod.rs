//! ScenarioNet's and MetaDrive's scenario descriptions: pickles and JSON in, JSON out.

pub mod pickle;
pub mod read;
pub mod read_json;
pub mod write_json;

pub use write_json::export;
