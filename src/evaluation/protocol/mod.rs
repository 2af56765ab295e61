//! Benchmark protocols: how scenes are rolled out and scored.

pub mod metadrive;
