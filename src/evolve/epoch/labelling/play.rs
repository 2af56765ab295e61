//! Rollouts of a recorded run simulated again with the motion behind their labels: for players and exporters.

use super::labels::{meets_anyway, record};
use crate::backend::{Backend, DriveContext, NoOutcome};
use crate::compiler::{Compiled, Decision, Prepared, Situation};
use crate::ego::Policy;
use crate::epoch::briefs::counsels::Counsels;
use crate::epoch::setting::situations::Situations;
use crate::epoch::setting::study::{LineageSpec, SceneEntry, Study};
use crate::evaluation::RolloutRecord;
use crate::objects::{Counsel, Counselled, Program};
use crate::scene::Sample;
use crate::sim::{Intervention, Outcome, Timeline, Trace, commands};

/// Plays a study's rollouts again.
pub struct Player<'s> {
    pub study: &'s Study,
    backend: Backend<'s>,
    counsels: Counsels,
    situations: Situations,
}

/// A rollout simulated again.
#[derive(Clone, Debug)]
pub struct Traced {
    /// Equal to what the store holds of this rollout.
    pub record: RolloutRecord,
    pub decision: Decision,
    pub intervention: Intervention,
    /// Sample that each action commands its road user at every simulated step, whatever the ego does; `None` where it reacts.
    pub commanded: Vec<Vec<Option<Sample>>>,
    pub motion: Trace,
}

impl<'s> Player<'s> {
    /// Plays with the counsel that the run recorded.
    pub fn of(study: &'s Study, counselled: &[Counselled], backend: Backend<'s>) -> Player<'s> {
        Player { study, backend, counsels: Counsels::recorded(counselled), situations: Situations::of(study) }
    }

    /// The rollout of a program in the scene at a place. A text is the reason why there is none.
    pub fn trace(&self, spec: &LineageSpec, program: &Program, place: usize) -> Result<Traced, String> {
        self.prepared(spec, program, place, |prepared, situation, counsel, context| {
            traced(&self.backend, prepared, situation, counsel, context, &self.study.scenes[place], &spec.ego)
        })
    }

    /// Returns what led to the contact of that rollout, where it has one.
    ///
    /// # Errors
    /// The reason why there is no rollout.
    pub fn timeline(&self, spec: &LineageSpec, program: &Program, place: usize) -> Result<Option<Timeline>, String> {
        self.prepared(spec, program, place, |prepared, situation, counsel, context| {
            let compiled =
                prepared.compile_counselled(situation, context.seed, counsel).map_err(|failure| failure.to_string())?;
            let (plant, ego) = (&situation.plant, &spec.ego);
            let explained = self.backend.explained(plant, &compiled.intervention, ego, context);
            Ok(explained.map_err(NoOutcome::reason)?.2)
        })
    }

    fn prepared<T>(
        &self,
        spec: &LineageSpec,
        program: &Program,
        place: usize,
        then: impl FnOnce(&Prepared<'_>, &Situation, Option<&Counsel>, DriveContext) -> Result<T, String>,
    ) -> Result<T, String> {
        let source = self.study.source(spec).map_err(|error| error.to_string())?;
        let prepared = Prepared::new(program, source).map_err(|failure| failure.to_string())?;
        let situation = self.situations.at(place, &spec.ego, &self.backend).map_err(NoOutcome::reason)?;
        let counsel = self.counsels.at(self.study, spec, place).map_err(|error| error.to_string())?;
        then(&prepared, &situation, counsel, self.study.drive_context(prepared.hash()))
    }

    /// The scene at a place without a program, driven by a lineage's ego: outcome and motion, or the reason why there are none.
    ///
    /// # Errors
    /// The scene cannot be played, or another simulator's rollout of it is not recorded.
    pub fn replay(&self, spec: &LineageSpec, place: usize) -> Result<(Outcome, Trace), String> {
        let situation = self.situations.at(place, &spec.ego, &self.backend).map_err(NoOutcome::reason)?;
        let nothing = Intervention::default();
        let context = DriveContext::plain(self.study.seed);
        self.backend.traced(&situation.plant, &nothing, &spec.ego, context).map_err(NoOutcome::reason)
    }
}

/// One rollout with its motion: compiled, simulated, assessed.
pub fn traced(
    backend: &Backend<'_>,
    prepared: &Prepared<'_>,
    situation: &Situation,
    counsel: Option<&Counsel>,
    context: DriveContext,
    entry: &SceneEntry,
    ego: &Policy,
) -> Result<Traced, String> {
    let Compiled { decision, intervention } =
        prepared.compile_counselled(situation, context.seed, counsel).map_err(|failure| failure.to_string())?;
    let (outcome, motion) = backend.traced(&situation.plant, &intervention, ego, context).map_err(NoOutcome::reason)?;
    let anyway = meets_anyway(backend, situation, ego, context.seed).map_err(NoOutcome::reason)?;
    let record = record(entry, ego, prepared, anyway, &decision, outcome)?;
    let commanded = commands(&situation.plant, &intervention);
    Ok(Traced { record, decision, intervention, commanded, motion })
}
