//! The fixed drivers under test.

pub mod arrays;
pub mod checkpoint;
mod four_numbers;
pub mod frenet;
pub mod idm;
pub mod learned;
pub mod network;
pub mod observation;
pub mod pdm;
pub mod policy;
pub mod replay;
pub mod weights;

pub use observation::Setting;
pub use policy::{Policy, PolicyError};
pub use weights::{Activation, Form, Squash, Weights, WeightsError};
