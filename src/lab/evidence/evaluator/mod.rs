//! Quality of the world evaluator: what it predicted before there were labels beside what the rollouts then showed, read from
//! recorded events. A route holds the prediction of a snapshot that knew labels of earlier epochs only, so that every epoch
//! tests what the ones before it taught.

mod beside;
mod case;
mod evolution;
pub mod order;
mod quality;
mod report;
mod text;

pub use beside::{Beside, beside};
pub use case::{Case, cases};
pub use evolution::{Evolution, measures, said};
pub use quality::{Quality, quality};
pub use report::{Against, EvaluatorReport, report};
pub use text::text;

#[cfg(test)]
mod tests;
