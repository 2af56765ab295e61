//! OpenDRIVE roads, both ways.

pub mod read;
pub mod write;

pub use read::road;
