//! What a page tells beside the run's events.

use serde::Serialize;
use std::collections::BTreeMap;

use super::super::agreement;
use super::super::credit::Credit;
use super::others::Other;
use crate::archive::SelectorOptions;
use crate::objects::cost::RunCost;
use crate::objects::{FlowStep, SolutionId};

/// What a page tells beside the run's events.
pub struct Beside<'a> {
    /// The experiment's rule by which a program is chosen.
    pub selector: &'a SelectorOptions,
    /// What the run cost, where that is known.
    pub cost: Option<&'a RunCost>,
    /// What patches of reported programs account for, where that was worked out.
    pub credits: &'a [Credit],
    /// How far another simulator's run agrees, where one was compared.
    pub agreement: Option<&'a agreement::Report>,
    /// Other runs that are compared with it, in the order in which they were named.
    pub others: &'a [Other],
    /// What the contracts of its families say of its programs.
    pub words: &'a Words,
    /// How far a run should go that is not finished, where the page is to follow it.
    pub live: Option<Live>,
}

/// Programs in the words of their families' contracts, which the record does not hold.
#[derive(Clone, Debug, Default)]
pub struct Words {
    /// Of each chosen program what it does otherwise than its lineage's parent, part by part.
    pub changes: BTreeMap<SolutionId, Vec<String>>,
    /// Of each chosen program what it does with a scene, step by step.
    pub flows: BTreeMap<SolutionId, Vec<FlowStep>>,
    /// Of each chosen program in how many held-out scenes each of its rules holds, in their order; and how many there are.
    pub rules_hold: BTreeMap<SolutionId, (Vec<usize>, usize)>,
    /// What the names in expressions mean, with their units.
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
