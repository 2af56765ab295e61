//! A rollout for a label, from whoever simulates it.

use super::answer::Answer;
use super::error::{BackendError, Fault, NoOutcome};
use super::lower::lowered;
use super::request::{Answers, Request};
use super::spec::BackendOptions;
use crate::ego::Policy;
use crate::kernel::Seed;
use crate::sim::{Intervention, Outcome, Plant, Trace, assess, judge, rollout_assessed, rollout_traced};

/// Who simulates the rollouts of a run.
#[derive(Clone, Copy)]
pub enum Backend<'a> {
    /// Our own simulator.
    Own,
    /// Another one, by its answers.
    Other { options: &'a BackendOptions, answers: &'a dyn Answers },
}

impl Backend<'_> {
    /// The outcome of one rollout, its contact assessed.
    pub fn rollout(
        &self,
        plant: &Plant,
        intervention: &Intervention,
        ego: &Policy,
        seed: Seed,
    ) -> Result<Outcome, NoOutcome> {
        match self {
            Backend::Own => Ok(rollout_assessed(plant, intervention, ego.driver().as_mut())?),
            Backend::Other { .. } => self.traced(plant, intervention, ego, seed).map(|(outcome, _)| outcome),
        }
    }

    /// The same with the motion behind it.
    pub fn traced(
        &self,
        plant: &Plant,
        intervention: &Intervention,
        ego: &Policy,
        seed: Seed,
    ) -> Result<(Outcome, Trace), NoOutcome> {
        let Backend::Other { options, answers } = self else {
            let mut driver = ego.driver();
            let (mut outcome, trace) = rollout_traced(plant, intervention, driver.as_mut())?;
            assess(plant, intervention, driver.as_mut(), &mut outcome)?;
            return Ok((outcome, trace));
        };
        let intervention = lowered(plant, intervention, ego)?;
        let request = Request::new(options, plant, &intervention, ego, seed).map_err(BackendError::Key)?;
        match answers.answer(&request)? {
            Answer::Failed(reason) => Err(NoOutcome::Scene(reason)),
            Answer::Told(told) => judge(plant, &intervention, &told, request.replays).map_err(|error| {
                NoOutcome::Stop(BackendError::Worker(Fault {
                    command: options.name.clone(),
                    place: format!("recorded answer to request {}", request.key.short(16)),
                    expected: "a motion of the scene".into(),
                    found: error.to_string(),
                    remedy: "record it anew".into(),
                }))
            }),
        }
    }
}
