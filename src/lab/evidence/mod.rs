//! Path from recorded attempts to reports: it reads what was recorded and computes no label.

pub mod agreement;
pub mod aligned;
pub mod attempt_text;
pub mod audit;
pub mod best;
pub mod cell;
pub mod choice;
pub mod claims;
pub mod composition_text;
pub mod counsel_text;
pub mod credit;
pub mod credit_table;
pub mod data;
pub mod difference;
pub mod differing;
pub mod downstream;
pub mod evaluator;
pub mod figures;
pub mod impact;
pub mod lineage_text;
pub mod nearest;
pub mod paper;
pub mod realism;
pub mod recognised;
pub mod recorded_run;
pub mod report;
pub mod tables;
mod unlabelled;
pub mod why;
pub mod world_text;

pub use audit::{Finding, Gravity, audit};
pub use recorded_run::{Became, Declared, OWN_PLANNER, Reading, RecordedRun, RecordedRunError, RunEvents, Setting};
pub use unlabelled::unlabelled;
