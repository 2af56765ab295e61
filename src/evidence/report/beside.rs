//! What a page tells beside the run's events.

use super::super::agreement;
use crate::archive::SelectorOptions;
use crate::objects::cost::RunCost;

/// What a page tells beside the run's events.
pub struct Beside<'a> {
    /// The experiment's rule by which a program is chosen.
    pub selector: &'a SelectorOptions,
    /// What the run cost, where that is known.
    pub cost: Option<&'a RunCost>,
    /// How far another simulator's run agrees, where one was compared.
    pub agreement: Option<&'a agreement::Report>,
}
