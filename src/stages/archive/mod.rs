//! Non-dominated front, hypervolume, acceptance gates, active selector.

mod front;
mod gates;
mod objectives;
pub mod openevolve;
mod paired;
mod pf_area;
mod plane;
mod promotion;
pub mod search;
mod selector;

pub use front::{Archive, ArchiveError, Challenger, Duplicate, Inserted};
pub use gates::{ArchiveOptions, OptionsError, Standing, consider};
pub use objectives::{ObjectivesError, admissible};
pub use paired::{Account, MeanOverScenes, Means, Measure, Panel, is_shown};
pub use pf_area::pf_area_pct;
pub use plane::{hypervolume, non_dominated, non_dominated_with_copies, point, ranks};
pub use promotion::{Leaders, PromotionRule, promote};
pub use selector::{Contender, Selection, SelectionRule, SelectorOptions, first_by_rule, select_active};
