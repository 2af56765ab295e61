//! Parts of our own paper beside tables and figures: its plan, its numbers as macros, and the check that none is typed.

mod numbers;
mod pages;
mod plan;
mod quoted;
mod roots;
mod typed;

pub use numbers::{numbers, numbers_with, outdated};
pub use pages::{
    FIGURE_TEXT_PT, FigureUse, Page, figures_of, overfull, pages_of, smallest_text_pt, unsound_fonts, unsound_pages,
};
pub use plan::{Named, Piece, Plan, PlanError, PlannedRun, What, plan};
pub use quoted::quoted;
pub use roots::{Root, roots};
pub use typed::{Typed, typed_numbers, unknown_numbers};
