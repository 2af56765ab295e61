//! The fixed drivers under test.

pub mod idm;
pub mod learned;
pub mod network;
pub mod policy;
pub mod replay;

pub use network::{Network, NetworkError};
pub use policy::{Policy, PolicyError};
