//! Findings of a downstream study: the last actors of its arms side by side, their differences, and their curves (fig:sac-adv-bmt,
//! tab:carla-chatscene-finetune).

mod by_family;
mod figure;
mod found;
mod page;
mod table;
#[cfg(test)]
mod tests;

pub use figure::figure;
pub use page::page;

use crate::evidence::tables::Table;
use crate::objects::downstream::Downstream;

/// The table of a record: a row an arm and a pair of arms, with a column a traffic family where each has an ego of its own.
pub fn table(record: &Downstream) -> Table {
    if record.opening.families.is_empty() { table::of_arms(record) } else { by_family::of_arms(record) }
}
