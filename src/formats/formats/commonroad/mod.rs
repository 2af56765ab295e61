//! CommonRoad XML, both ways.

pub mod read;
pub mod write;

pub use read::import;
pub use write::export;
