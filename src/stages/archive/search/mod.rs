//! Other ways to search than the archive of this system, for comparison at the same rollouts: what each keeps, and which
//! programs its slots edit (paper, tab:attack-only-openevolve-ablation, and what the paper lacks: hill climbing, NSGA-II, random search).

mod nsga2;
mod options;
mod state;

pub use options::{Method, SearchOptions, TuningOptions};
pub use state::{Child, SearchState, SlotDraw};
