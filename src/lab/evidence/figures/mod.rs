//! The paper's figures from recorded runs, each one function from runs to a sheet of shapes (`draw::Figure`): what the command
//! `figure`, the report and the paper show is the same sheet.

mod area_rounds;
mod case_evolution;
mod cases;
mod contact_bars;
mod edits;
mod error;
mod front;
mod heat_map;
mod journey;
pub mod legend;
mod pareto_front;
mod rooms;
mod shown;
#[cfg(test)]
mod tests;
mod world_order;

pub use area_rounds::area_rounds;
pub use case_evolution::{Evolved, case_evolution, credit_of, with_a_chain};
pub use cases::{Case, Side, WonScene, cases, met_in_words, won_scenes};
pub use contact_bars::contact_bars;
pub use edits::patch_surface;
pub use error::FigureError;
pub use front::front;
pub use heat_map::{Panel, heat_map};
pub use journey::method;
pub use pareto_front::pareto_front;
pub use rooms::architecture;
pub use shown::{Shown, of_run};
pub use world_order::world_order;
