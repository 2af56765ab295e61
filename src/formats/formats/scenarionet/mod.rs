//! ScenarioNet's and MetaDrive's scenario descriptions: pickles and JSON in and out.

pub mod pickle;
pub mod read;
pub mod read_json;
pub mod read_pickle;
pub mod write_json;
pub mod write_pickle;

pub use write_json::export;
pub use write_pickle::{DATA_SET_FILES, DataSet, Pickled, pickle_name, pickled};
