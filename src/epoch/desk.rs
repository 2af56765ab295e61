//! What acts in a run, apart from what it is a function of: where events go, where answers and labels come from, what the
//! work costs, who watches.

use std::sync::Mutex;

use super::{cost::Meter, progress::Progress, rollouts::Rollouts, situations::Situations, study::Study};
use crate::backend::Backend;
use crate::kernel::Threads;
use crate::llm::Ask;
use crate::store::Transcript;

/// Everything that a run works with besides the study.
pub struct Desk<'a> {
    /// Compares every event with what an earlier run of the same inputs wrote, and appends where that ends. Workers
    /// have no access to it.
    pub log: Transcript,
    pub watch: &'a mut dyn FnMut(Progress),
    pub tools: Tools<'a>,
}

/// The part that workers share. No result depends on it.
pub struct Tools<'a> {
    /// Who answers for the models.
    pub ask: &'a dyn Ask,
    pub threads: &'a Threads,
    /// Labels that are on record.
    pub rollouts: &'a Rollouts<'a>,
    pub meter: Meter<'a>,
    /// Who simulates rollouts for labels.
    pub backend: Backend<'a>,
    pub(super) situations: Situations,
    /// Held while a parent is compiled on a probe scene: the workers share it, and it is compiled once.
    pub(super) parent_trial: Mutex<()>,
}

impl<'a> Tools<'a> {
    pub fn new(
        study: &Study,
        ask: &'a dyn Ask,
        threads: &'a Threads,
        rollouts: &'a Rollouts<'a>,
        meter: Meter<'a>,
    ) -> Tools<'a> {
        let (situations, parent_trial) = (Situations::of(study), Mutex::new(()));
        Tools { ask, threads, rollouts, meter, backend: Backend::Own, situations, parent_trial }
    }

    /// The same with rollouts from a backend.
    pub fn behind(self, backend: Backend<'a>) -> Tools<'a> {
        Tools { backend, ..self }
    }
}
