//! Commands that read finished runs: attempts, tables, figures, comparisons, reasons.

pub mod compare;
pub mod compared_pairs;
pub mod credit;
pub mod data;
pub mod diff;
pub mod driven;
pub mod faults;
pub mod figure;
pub mod impact;
pub mod kept_credit;
pub mod lineage;
mod manoeuvres;
pub mod others;
pub mod page;
pub mod playables;
mod program_words;
pub mod redraws;
pub mod report;
pub mod rollout;
pub mod show;
pub mod table;
pub mod table_options;
pub mod why;
pub mod world;
