//! How sure a number is: percentile bootstrap over scenes, Student's t over seeds. How two samples differ. Regression trees.

pub mod boosted;
pub mod bootstrap;
pub mod student;
pub mod table;
pub mod two_samples;

pub use bootstrap::{Estimate, PerScene, RESAMPLES, Search, estimates, interval};
