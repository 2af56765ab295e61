//! Rollouts of a recorded run simulated again with the motion behind their labels: for players and exporters.

use super::{
    counsels::Counsels,
    labels::record,
    situations::Situations,
    study::{LineageSpec, Study},
};
use crate::compiler::{Compiled, Decision, Prepared};
use crate::evaluation::RolloutRecord;
use crate::objects::{Counselled, Program};
use crate::sim::{Intervention, Trace, assess, rollout_traced};

/// Plays a study's rollouts again.
pub struct Player<'s> {
    pub study: &'s Study,
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
    pub motion: Trace,
}

impl<'s> Player<'s> {
    /// With the counsel that the run recorded.
    pub fn of(study: &'s Study, counselled: &[Counselled]) -> Player<'s> {
        Player { study, counsels: Counsels::recorded(counselled), situations: Situations::of(study) }
    }

    /// The rollout of a program in the scene at a place. A text is the reason why there is none.
    pub fn trace(&self, spec: &LineageSpec, program: &Program, place: usize) -> Result<Traced, String> {
        let source = self.study.source(spec).map_err(|error| error.to_string())?;
        let prepared = Prepared::new(program, source).map_err(|failure| failure.to_string())?;
        let situation = self.situations.at(place, &spec.ego)?;
        let counsel = self.counsels.at(self.study, spec, place).map_err(|error| error.to_string())?;
        let Compiled { decision, intervention } =
            prepared.compile_counselled(&situation, self.study.seed, counsel).map_err(|failure| failure.to_string())?;
        let mut driver = spec.ego.driver();
        let (mut outcome, motion) =
            rollout_traced(&situation.plant, &intervention, driver.as_mut()).map_err(|error| error.to_string())?;
        assess(&situation.plant, &intervention, driver.as_mut(), &mut outcome).map_err(|error| error.to_string())?;
        let record = record(&self.study.scenes[place], spec, &prepared, &decision, outcome)?;
        Ok(Traced { record, decision, intervention, motion })
    }
}
