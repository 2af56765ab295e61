//! Contents of a page beside the run's events.

use serde::Serialize;
use std::collections::BTreeMap;

use super::super::agreement;
use super::super::credit::Credit;
use super::others::Other;
use crate::archive::SelectorOptions;
use crate::objects::cost::RunCost;
use crate::objects::{FlowStep, SolutionId};

/// Contents of a page beside the run's events.
pub struct Beside<'a> {
    /// The experiment's rule by which a program is chosen.
    pub selector: &'a SelectorOptions,
    /// Cost of the run, where that is known.
    pub cost: Option<&'a RunCost>,
    /// Contributions of the patches of reported programs, where they were worked out.
    pub credits: &'a [Credit],
    /// Agreement with another simulator's run, where one was compared.
    pub agreement: Option<&'a agreement::Report>,
    /// Other runs that are compared with it, in the order in which they were named.
    pub others: &'a [Other],
    /// Words of its families' contracts about its programs.
    pub words: &'a Words,
    /// Full length of an unfinished run, where the page is to follow it.
    pub live: Option<Live>,
}

/// Programs in the words of their families' contracts, which the record does not hold.
#[derive(Clone, Debug, Default)]
pub struct Words {
    /// For each chosen program, its differences from its lineage's parent, part by part.
    pub changes: BTreeMap<SolutionId, Vec<String>>,
    /// For each chosen program, what it does with a scene, step by step.
    pub flows: BTreeMap<SolutionId, Vec<FlowStep>>,
    /// For each chosen program, the number of held-out scenes in which each of its rules holds, in their order; and the number of scenes.
    pub rules_hold: BTreeMap<SolutionId, (Vec<usize>, usize)>,
    /// Meanings of the names in expressions, with their units.
    pub meanings: BTreeMap<String, String>,
}

/// A run that goes on while its page is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Live {
    /// Epochs that there will be.
    pub epochs: u32,
    /// Proposals of all lineages in all epochs.
    pub proposals: u64,
    /// Seconds after which the page loads itself again.
    pub reload_s: f64,
}
