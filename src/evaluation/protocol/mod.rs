//! What is run to label a candidate.

pub mod balanced;
pub mod metadrive;
pub mod safebench;
