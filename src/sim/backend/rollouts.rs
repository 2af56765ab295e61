//! A rollout for a label, from any simulator.

use super::answer::Answer;
use super::error::{BackendError, NoOutcome};
use super::lower::{as_driven, lowered, unstaged};
use super::request::{Answers, Request};
use super::spec::BackendOptions;
use super::under::DriveContext;
use crate::ego::Policy;
use crate::sim::{
    Intervention, Outcome, Plant, ReportedError, ReportedRollout, Timeline, Trace, assess, judge, reported_timeline,
    retraced, rollout_assessed, rollout_explained, rollout_traced,
};

/// The simulator of a run's rollouts.
#[derive(Clone, Copy)]
pub enum Backend<'a> {
    /// Our own simulator.
    Own,
    /// Another simulator, by its answers.
    Other { options: &'a BackendOptions, answers: &'a dyn Answers },
}

impl Backend<'_> {
    /// Returns the simulator for this ego. Where a planner is declared, every other ego drives in our own simulator.
    fn asked(&self, ego: &Policy) -> Result<Backend<'_>, NoOutcome> {
        match (self, ego) {
            (Backend::Other { options, .. }, Policy::Command(_)) if options.drives() => Ok(*self),
            (_, Policy::Command(_)) => {
                let reason = "the ego `command` drives by its planner alone; name it in [driver], or by --driver FILE";
                Err(BackendError::Unplayable(reason.into()).into())
            }
            (Backend::Other { options, .. }, _) if options.drives() => Ok(Backend::Own),
            _ => Ok(*self),
        }
    }

    /// Returns the outcome of one rollout, its contact assessed.
    pub fn rollout(
        &self,
        plant: &Plant,
        intervention: &Intervention,
        ego: &Policy,
        context: DriveContext,
    ) -> Result<Outcome, NoOutcome> {
        match self.asked(ego)? {
            Backend::Own => Ok(rollout_assessed(plant, intervention, ego.driver().as_mut())?),
            Backend::Other { .. } => self.traced(plant, intervention, ego, context).map(|(outcome, _)| outcome),
        }
    }

    /// Returns the same with the motion behind it.
    pub fn traced(
        &self,
        plant: &Plant,
        intervention: &Intervention,
        ego: &Policy,
        context: DriveContext,
    ) -> Result<(Outcome, Trace), NoOutcome> {
        let Backend::Other { options, answers } = self.asked(ego)? else {
            let mut driver = ego.driver();
            let (mut outcome, trace) = rollout_traced(plant, intervention, driver.as_mut())?;
            assess(plant, intervention, driver.as_mut(), &mut outcome)?;
            return Ok((outcome, trace));
        };
        asked_of(options, answers, plant, intervention, ego, context, judged)
    }

    /// Returns the outcome with its motion, and the time line of its contact, if it has one.
    pub fn explained(
        &self,
        plant: &Plant,
        intervention: &Intervention,
        ego: &Policy,
        context: DriveContext,
    ) -> Result<(Outcome, Trace, Option<Timeline>), NoOutcome> {
        let Backend::Other { options, answers } = self.asked(ego)? else {
            return Ok(rollout_explained(plant, intervention, ego.driver().as_mut())?);
        };
        asked_of(options, answers, plant, intervention, ego, context, |request, rollout| {
            let (outcome, motion) = judged(request, rollout)?;
            let driven = as_driven(plant, request.intervention, rollout);
            let timeline = |contact| reported_timeline(plant, &driven, rollout, request.replays, contact);
            let timeline = outcome.contact.as_ref().map(timeline).transpose();
            Ok((outcome, motion, timeline.map_err(|error| untrue(request, &error))?))
        })
    }
}

/// Gets the answer of another simulator or a planner's drive for a scene, checks it and hands it to `then`.
fn asked_of<T>(
    options: &BackendOptions,
    answers: &dyn Answers,
    plant: &Plant,
    intervention: &Intervention,
    ego: &Policy,
    context: DriveContext,
    then: impl FnOnce(&Request<'_>, &ReportedRollout) -> Result<T, NoOutcome>,
) -> Result<T, NoOutcome> {
    // Reacting adversaries meet a planner as they are. Another simulator lacks their rules and is told their motion.
    let intervention = if options.drives() {
        unstaged(plant, intervention)?;
        intervention.clone()
    } else {
        lowered(plant, intervention, ego)?
    };
    let request = Request::new(options, plant, &intervention, ego, context).map_err(BackendError::Key)?;
    match answers.answer(&request)? {
        Answer::Failed(reason) => Err(NoOutcome::Scene(reason)),
        Answer::ReportedRollout(rollout) => {
            if options.drives() {
                retraced(plant, &intervention, &rollout).map_err(|error| untrue(&request, &error))?;
            }
            then(&request, &rollout)
        }
    }
}

/// Returns the outcome and the motion of a reported rollout.
pub(super) fn judged(request: &Request<'_>, rollout: &ReportedRollout) -> Result<(Outcome, Trace), NoOutcome> {
    let Request { plant, intervention, .. } = *request;
    judge(plant, &as_driven(plant, intervention, rollout), rollout, request.replays)
        .map_err(|error| untrue(request, &error))
}

fn untrue(request: &Request<'_>, error: &ReportedError) -> NoOutcome {
    NoOutcome::Stop(BackendError::Untrue(format!(
        "recorded rollout of scene {} against the ego {} (request {}): {error}; its file was changed or is of another release: restore it, or \
         delete it and record anew",
        request.scene(),
        request.ego,
        request.key.short(16)
    )))
}
