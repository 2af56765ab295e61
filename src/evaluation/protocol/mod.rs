//! What is run to label a candidate.

pub mod metadrive;
pub mod safebench;
