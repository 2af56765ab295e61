//! How sure a number is: percentile bootstrap over scenes, Student's t over seeds.

pub mod bootstrap;
pub mod student;

pub use bootstrap::{Estimate, PerScene, RESAMPLES, Search, estimates, interval};
