//! The fixed drivers under test.

pub mod arrays;
pub mod checkpoint;
mod four_numbers;
pub mod frenet;
mod graph;
pub mod idm;
pub mod learned;
mod nearest;
pub mod network;
pub mod observation;
mod onnx;
pub mod pdm;
pub mod policy;
pub mod replay;
pub mod weights;
mod weights_error;

pub use arrays::Arrays;
pub use graph::Graph;
pub use observation::Setting;
pub use policy::{Policy, PolicyError};
pub use weights::{Activation, Actor, Form, Squash, Weights};
pub use weights_error::WeightsError;
