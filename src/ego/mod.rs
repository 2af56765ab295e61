//! The fixed drivers under test.

pub mod idm;
pub mod policy;
pub mod replay;

pub use policy::{Policy, PolicyError};
