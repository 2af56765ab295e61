//! From a scene, with or without what a rollout changed in it, to the formats that others read: pure functions to
//! bytes, one file or folder a format. What a format cannot hold is named in the notes beside the bytes.

mod commonroad;
mod error;
mod opendrive;
mod openscenario;
mod scenarionet_json;
mod staging;
mod xml;

#[cfg(test)]
mod tests;

pub use commonroad::commonroad;
pub use error::{ExportError, Exported, Note};
pub use openscenario::{OpenScenario, openscenario};
pub use scenarionet_json::scenarionet_json;
pub use staging::{Inserted, Staging};
