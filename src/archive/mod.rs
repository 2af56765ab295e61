//! Non-dominated front, hypervolume, acceptance gates, active selector.

mod front;
mod gates;
mod objectives;
mod pf_area;
mod plane;
mod selector;

pub use front::{Archive, ArchiveError, Duplicate, Inserted};
pub use gates::{ArchiveOptions, OptionsError, consider};
pub use objectives::{ObjectivesError, admissible};
pub use pf_area::pf_area_pct;
pub use plane::{hypervolume, non_dominated, non_dominated_with_copies, ranks};
pub use selector::{Contender, Selection, SelectionRule, SelectorOptions, promote, select_active};
