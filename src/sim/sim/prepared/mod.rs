//! A scene prepared for many rollouts: its rows, its road, and the laws of motion that an experiment chooses.

pub mod body;
pub(super) mod course;
pub mod drivable;
pub(super) mod edges;
pub mod error;
pub mod options;
pub mod path;
pub mod plant;
pub mod plant_options;
pub(super) mod ray;
pub(super) mod rows;
mod segment;

pub use body::Size;
pub use error::SimError;
pub use options::{AvoidanceOptions, Forecast, Scripts, SimulatorOptions, SimulatorOptionsError};
pub use path::{Along, Path};
pub use plant::Plant;
pub use plant_options::{EgoBox, EgoCar, FollowerStart, Obstacle, PlantOptions, ReactiveTraffic, TrafficBoxes};
