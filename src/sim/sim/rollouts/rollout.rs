//! An episode with a driver that decides: move everyone through five physics steps, check contact, take account, until it ends.

use crate::sim::SimError;
use crate::sim::accounts::end::End;
use crate::sim::accounts::outcome::{Contact, Outcome, Trace};
use crate::sim::encounters::avoidance::assess;
use crate::sim::encounters::timeline::{Timeline, timeline};
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::driver::Driver;
use crate::sim::road_users::intervention::Intervention;

use super::episode::{Episode, Form};
use super::part::{Part, RolloutCost};
use super::recorder::{Recorder, Records};

/// One closed-loop rollout.
pub fn rollout(plant: &Plant, intervention: &Intervention, driver: &mut dyn Driver) -> Result<Outcome, SimError> {
    rollout_counted(plant, intervention, driver).map(|(outcome, _)| outcome)
}

/// [`rollout`] with the contact [`assess`]ed: what labels are read from.
pub fn rollout_assessed(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
) -> Result<Outcome, SimError> {
    let mut outcome = rollout(plant, intervention, driver)?;
    assess(plant, intervention, driver, &mut outcome)?;
    Ok(outcome)
}

/// [`rollout_assessed`] with its motion and the [`Timeline`] of its contact, where it has one.
pub fn rollout_explained(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
) -> Result<(Outcome, Trace, Option<Timeline>), SimError> {
    let (mut outcome, motion) = rollout_traced(plant, intervention, driver)?;
    assess(plant, intervention, driver, &mut outcome)?;
    let timeline =
        outcome.contact.as_ref().map(|contact| timeline(plant, intervention, driver, contact)).transpose()?;
    Ok((outcome, motion, timeline))
}

/// Returns the end of [`rollout`] and the ego's contact, bit for bit, without an outcome's sums: for searches that simulate
/// the ego again and again.
pub fn ending(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
) -> Result<(End, Option<Contact>), SimError> {
    let mut episode = begun(plant, intervention, driver, false, &mut |_| ())?;
    let end = drive(&mut episode, driver, None, &mut |_| ())?;
    Ok((end, episode.contact().copied()))
}

/// Whom the ego touches within so many decision steps, bit for bit as in [`ending`]: for searches to which nothing later counts.
pub fn contact_within(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
    steps: usize,
) -> Result<Option<Contact>, SimError> {
    let mut episode = begun(plant, intervention, driver, false, &mut |_| ())?;
    while episode.end().is_none() && episode.steps() < steps {
        let control = driver.decide(&episode.observe());
        episode.advance(control, &mut |_| (), None)?;
    }
    Ok(episode.contact().copied())
}

/// [`rollout`] with the number of agent-steps it simulated.
pub fn rollout_counted(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
) -> Result<(Outcome, RolloutCost), SimError> {
    rollout_in_parts(plant, intervention, driver, |_| ())
}

/// Does the same as [`rollout_counted`] and reports at every border which part begins, for a caller's clock. The outcome is the same.
pub fn rollout_in_parts(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
    mut begins: impl FnMut(Part),
) -> Result<(Outcome, RolloutCost), SimError> {
    begins(Part::Setup);
    let mut episode = begun(plant, intervention, driver, true, &mut begins)?;
    let end = drive(&mut episode, driver, None, &mut begins)?;
    begins(Part::Setup);
    Ok((episode.summed_up(end), episode.cost()))
}

/// [`rollout`] with the motion behind it; the outcome is the same bit for bit.
pub fn rollout_traced(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
) -> Result<(Outcome, Trace), SimError> {
    let mut episode = begun(plant, intervention, driver, true, &mut |_| ())?;
    let mut recorder = Recorder::new(plant, &episode.state);
    let end = drive(&mut episode, driver, Some(&mut recorder), &mut |_| ())?;
    Ok((episode.summed_up(end), recorder.finish()))
}

/// Returns the end of [`rollout`], its steps and its contact, with every state written to the recorder.
pub(super) fn rollout_recorded(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
    recorder: &mut dyn Records,
) -> Result<(End, usize, Option<Contact>), SimError> {
    let mut episode = begun(plant, intervention, driver, false, &mut |_| ())?;
    let end = drive(&mut episode, driver, Some(recorder), &mut |_| ())?;
    Ok((end, episode.steps(), episode.contact().copied()))
}

/// The episode that a driver is to drive.
fn begun<'a>(
    plant: &'a Plant,
    intervention: &'a Intervention,
    driver: &mut dyn Driver,
    keeps_account: bool,
    begins: &mut impl FnMut(Part),
) -> Result<Episode<'a>, SimError> {
    driver.begin(plant);
    let form = Form { follows_log: driver.follows_log(), keeps_account, reacts: true };
    Episode::of(plant.into(), intervention.into(), form, begins)
}

/// Drives an episode to its end.
fn drive(
    episode: &mut Episode<'_>,
    driver: &mut dyn Driver,
    mut recorder: Option<&mut dyn Records>,
    begins: &mut impl FnMut(Part),
) -> Result<End, SimError> {
    if let Some(recorder) = recorder.as_deref_mut() {
        recorder.push(&episode.state, 0);
    }
    let end = loop {
        if let Some(end) = episode.end() {
            break end;
        }
        begins(Part::Ego);
        let control = driver.decide(&episode.observe());
        episode.advance(control, begins, recorder.as_mut().map(|recorder| &mut **recorder as _))?;
    };
    driver.finish(&episode.observe(), end);
    Ok(end)
}
