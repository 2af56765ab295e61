//! The desk: everything of a run that acts. It takes the events, gives answers of models and labels, meters costs and reports
//! progress. What the result depends on is in `study.rs`.

use std::sync::Arc;

use super::cost::{Asking, Meter};
use super::progress::Progress;
use super::situations::Situations;
use super::study::Study;
use crate::agents::AgentError;
use crate::backend::Backend;
use crate::compiler::Searched;
use crate::epoch::RunError;
use crate::epoch::labelling::made::Made;
use crate::epoch::labelling::rollouts::Rollouts;
use crate::epoch::planning::wanted::Wanted;
use crate::kernel::{Digest, LruCache, Threads};
use crate::llm::{Ask, AskError};
use crate::objects::{LineageId, counsel::Vehicle};
use crate::store::Transcript;

/// Most compilations that are kept: some epochs' worth of what probe scenes and windows share, about 10 kB each.
const COMPILED_MAX: usize = 8192;

/// Most scenes whose vehicles are kept.
const COUNSELLED_MAX: usize = 4096;

/// Most bytes of searches that are kept: a lineage's window several times over.
const SEARCHED_BYTES_MAX: usize = 192 << 20;

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
    /// Source of the models' answers.
    ask: &'a dyn Ask,
    /// Most questions that are open together, where answers take time; without it as many as there are threads.
    open: Option<usize>,
    pub threads: &'a Threads,
    /// Labels that are on record.
    pub rollouts: &'a Rollouts<'a>,
    /// Rollouts of our own simulator that only predict what another one will say. They do not count among the labels.
    pub(in crate::epoch) predictions: Rollouts<'a>,
    pub meter: Meter<'a>,
    /// Simulator of rollouts for labels.
    pub backend: Backend<'a>,
    /// List in which a plan gathers missing work; `None` where the work is done.
    pub(in crate::epoch) wanted: Option<&'a Wanted>,
    /// List of the labels and trials that are read; `None` where nobody asks for it.
    pub(in crate::epoch) noted: Option<&'a Wanted>,
    /// Returns `true` once whoever started the run wants it to stop.
    stop: Option<&'a (dyn Fn() -> bool + Sync)>,
    pub(in crate::epoch) situations: Situations,
    /// Compiled programs, or why they cannot be compiled, by all that decides the result.
    pub(in crate::epoch) compiled: LruCache<Digest, Result<Arc<Made>, String>>,
    /// The vehicles that were ranked for a scene's counsel, or why none could be.
    pub(in crate::epoch) counselled: LruCache<Digest, Result<Vec<Vehicle>, String>>,
    /// Results of the programs' motion and search nodes.
    pub(in crate::epoch) searched: Searched,
}

impl<'a> Tools<'a> {
    pub fn new(
        study: &Study,
        ask: &'a dyn Ask,
        threads: &'a Threads,
        rollouts: &'a Rollouts<'a>,
        meter: Meter<'a>,
    ) -> Tools<'a> {
        let (situations, compiled) = (Situations::of(study), LruCache::new(COMPILED_MAX));
        let (counselled, searched) = (LruCache::new(COUNSELLED_MAX), Searched::new(SEARCHED_BYTES_MAX));
        let (backend, wanted, noted, stop, open) = (Backend::Own, None, None, None, None);
        Tools {
            ask,
            open,
            threads,
            rollouts,
            predictions: rollouts.beside(),
            meter,
            backend,
            wanted,
            noted,
            stop,
            situations,
            compiled,
            counselled,
            searched,
        }
    }

    /// The same tools with so many questions open together, counted over all lineages of an epoch.
    pub fn asking_at_once(self, open: usize) -> Tools<'a> {
        Tools { open: Some(open.max(1)), ..self }
    }

    /// The same tools with rollouts from a backend.
    pub fn behind(self, backend: Backend<'a>) -> Tools<'a> {
        Tools { backend, ..self }
    }

    /// Returns `true` if an error says that a plan cannot see further: a record is missing, or an answer that workers get themselves.
    pub(in crate::epoch) fn is_wanting(&self, error: &RunError) -> bool {
        match error {
            RunError::Wanting => true,
            RunError::Agent(AgentError::Ask(AskError::Miss(_))) => self.wanted.is_some_and(Wanted::asked_elsewhere),
            _ => false,
        }
    }

    /// The same tools for a plan: missing work is asked of `wanted`.
    pub fn planning(self, wanted: &'a Wanted) -> Tools<'a> {
        Tools { wanted: Some(wanted), ..self }
    }

    /// The same, which lists what is read in `noted`.
    pub fn noting(self, noted: &'a Wanted) -> Tools<'a> {
        Tools { noted: Some(noted), ..self }
    }

    /// The same tools, which stop once `stop` is true.
    pub fn until(self, stop: &'a (dyn Fn() -> bool + Sync)) -> Tools<'a> {
        Tools { stop: Some(stop), ..self }
    }

    /// Returns the source of answers to a lineage's questions, which meters their cost.
    pub(in crate::epoch) fn asking<'t>(&'t self, lineage: &'t LineageId) -> Asking<'t, 'a> {
        self.meter.asking(self.ask, lineage)
    }

    /// Returns how many lineages of an epoch are worked on together. A plan looks at all of them.
    pub(in crate::epoch) fn lineages_together(&self, study: &Study) -> usize {
        match (self.wanted, self.open) {
            (Some(_), _) => study.lineages.len().max(1),
            (None, None) => 1,
            (None, Some(open)) => (open / study.budget.slots.max(1) as usize).max(1),
        }
    }

    /// Returns how many of them are under way at the same time. A plan that waits for nobody takes one after the other.
    pub(in crate::epoch) fn at_once(&self, study: &Study, together: usize) -> usize {
        match (self.wanted, self.open) {
            (Some(_), None) => 1,
            (Some(_), Some(open)) => (open / study.budget.slots.max(1) as usize).clamp(1, together.max(1)),
            (None, _) => together,
        }
    }

    /// Maps `f` over items each of which asks questions, and returns the results in item order.
    pub(in crate::epoch) fn ask_all<T: Sync, R: Send>(
        &self,
        items: &[T],
        f: impl Fn(usize, &T) -> R + Sync + Send,
    ) -> Vec<R> {
        match self.open {
            Some(open) => self.threads.map_waiting(items, open, f),
            None => self.threads.map(items, f),
        }
    }

    /// Asked before each piece of work: an interrupted run ends with what it has on record, and with no half-made event.
    pub(in crate::epoch) fn go_on(&self) -> Result<(), RunError> {
        match self.stop {
            Some(stop) if stop() => Err(RunError::Interrupted),
            _ => Ok(()),
        }
    }
}
