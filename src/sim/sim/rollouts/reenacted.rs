//! The outcome of a rollout that another simulator reported. Given the motion of our own rollout, it finds that rollout's outcome
//! bit for bit.
//!
//! Taken from the report: where everyone was, which road user the ego touched first and when, and how it ended. Computed
//! here: everything else of an [`Outcome`], with the scene's boxes. Our own plant finds out if a contact could have been
//! avoided: it takes over from the reported state at the moment at which the ego could have reacted, because no report holds
//! a manoeuvre that nobody drove. The adversaries go on with their commands then, and traffic with our IDM.

use crate::scene::Sample;
use crate::sim::SimError;
use crate::sim::accounts::account::Account;
use crate::sim::accounts::end::End;
use crate::sim::accounts::outcome::{Contact, Outcome, Trace};
use crate::sim::encounters::avoidance::{Relived, assess_relived};
use crate::sim::encounters::contact::row_during;
use crate::sim::encounters::hit::{Hit, Swept};
use crate::sim::encounters::timeline::{Timeline, timeline_relived};
use crate::sim::prepared::body::{SUBSTEPS, Size};
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::actors::{Actor, Mind};
use crate::sim::road_users::bicycle::Car;
use crate::sim::road_users::driver::Driver;
use crate::sim::road_users::intervention::{ActorRef, Intervention};

use super::closed_loop::{ClosedLoop, EgoStep, reach, seconds_after};
use super::recorder::{Recorder, Records};
use super::reported::{Pose, ReportedActor, ReportedContact, ReportedError, ReportedRollout};
use super::rollout::rollout_recorded;

/// Returns the outcome of a reported rollout, its contact assessed, and the motion as players show it. `replays` is true if the
/// ego repeated its recording: then nobody turns reactive when our plant takes over.
pub fn judge(
    plant: &Plant,
    intervention: &Intervention,
    reported: &ReportedRollout,
    replays: bool,
) -> Result<(Outcome, Trace), ReportedError> {
    super::reported_check::check(plant, intervention, reported, replays)?;
    let mut reenacted = Reenacted::new(plant, intervention, reported, replays)?;
    let mut recorder = Recorder::new(plant, &reenacted.state);
    let mut outcome = reenacted.account(&mut recorder);
    assess_relived(&mut Reenacted::new(plant, intervention, reported, replays)?, outcome.contact.as_mut())?;
    Ok((outcome, recorder.finish()))
}

/// Returns the [`Timeline`] of a contact in a reported rollout that was judged before.
///
/// # Errors
/// The same as those of our own simulator for this scene and intervention.
pub fn reported_timeline(
    plant: &Plant,
    intervention: &Intervention,
    reported: &ReportedRollout,
    replays: bool,
    contact: &Contact,
) -> Result<Timeline, ReportedError> {
    Ok(timeline_relived(&mut Reenacted::new(plant, intervention, reported, replays)?, contact)?)
}

/// Returns a rollout of our own as a worker reports it.
pub fn tell(plant: &Plant, intervention: &Intervention, driver: &mut dyn Driver) -> Result<ReportedRollout, SimError> {
    let (ego, actors, controls) = (Vec::new(), Vec::new(), Vec::new());
    let reported = ReportedRollout { end: End::Horizon, contact: None, ego, actors, controls };
    let mut writer = Writer { reported, within: None };
    let (end, steps, contact) = rollout_recorded(plant, intervention, driver, &mut writer)?;
    let (step, substep) = writer.within.unwrap_or((steps, 0));
    let contact = contact.map(|contact| ReportedContact { with: contact.with, step, substep, boxes: None });
    Ok(ReportedRollout { end, contact, ..writer.reported })
}

/// Writes a rollout of our own down as reported.
struct Writer {
    reported: ReportedRollout,
    /// Step and physics step of a contact within a step.
    within: Option<(usize, usize)>,
}

impl Records for Writer {
    fn push(&mut self, state: &ClosedLoop<'_>, _: usize) {
        let row = self.reported.ego.len();
        self.reported.ego.push(Pose { sample: state.ego.sample, axis: state.ego.axis });
        for (i, actor) in state.world.actors.iter().enumerate() {
            if i == self.reported.actors.len() {
                self.reported.actors.push(ReportedActor { who: actor.who, from_step: row, poses: Vec::new() });
            }
            self.reported.actors[i].poses.push(actor.now.map(|sample| Pose { sample, axis: actor.axis }));
        }
    }

    fn push_during(&mut self, state: &ClosedLoop<'_>, k: usize, substep: usize) {
        self.within = Some((k, substep));
        self.push(state, k);
    }
}

/// A reported rollout under way.
struct Reenacted<'a> {
    state: ClosedLoop<'a>,
    reported: &'a ReportedRollout,
    /// Index in `told.actors` of each of `state.world.actors`.
    teller: Vec<usize>,
}

impl<'a> Reenacted<'a> {
    fn new(
        plant: &'a Plant,
        intervention: &'a Intervention,
        reported: &'a ReportedRollout,
        replays: bool,
    ) -> Result<Reenacted<'a>, SimError> {
        let mut state = ClosedLoop::without_driver(plant.into(), intervention.into(), replays)?;
        let first = &reported.ego[0];
        state.ego.sample = first.sample;
        state.ego.axis = first.axis;
        state.ego.along = plant.route.project(first.sample.position);
        let mut teller = Vec::new();
        for actor in &mut state.world.actors {
            let of = reported.actors.iter().position(|of| of.who == actor.who).unwrap_or(0);
            put(actor, reported.actors[of].at(0));
            teller.push(of);
        }
        Ok(Reenacted { state, reported, teller })
    }

    /// Returns the number of physics steps of the k-th step that are reported.
    fn substeps(&self, k: usize) -> usize {
        match self.reported.contact {
            Some(contact) if contact.step == k => contact.substep,
            _ => SUBSTEPS,
        }
    }

    /// Takes road users that leave their recording at the k-th step out of it.
    fn take_over(&mut self, k: usize) {
        for (of, reported) in self.reported.actors.iter().enumerate() {
            let ActorRef::Track(track) = reported.who else { continue };
            if reported.from_step != k || self.teller.contains(&of) {
                continue;
            }
            let mut actor = Actor::new(reported.who, self.state.plant.sizes[track], None, Mind::Coasts);
            put(&mut actor, reported.at(k));
            self.state.world.simulated[track] = true;
            self.state.world.actors.push(actor);
            self.teller.push(of);
        }
    }

    /// Computes everyone's way to the next row, the ego's as a step.
    fn plan(&mut self, k: usize) -> EgoStep {
        let substeps = self.substeps(k);
        for (actor, of) in self.state.world.actors.iter_mut().zip(&self.teller) {
            let next = self.reported.actors[*of].at(k + 1).map(|pose| (pose.sample, pose.axis));
            actor.plan_as_reported(next, substeps);
        }
        let ego = &self.state.ego;
        let now = Pose { sample: ego.sample, axis: ego.axis };
        ego_step(&now, self.reported.ego.get(k + 1).unwrap_or(&now), substeps, &ego.size)
    }

    /// Returns the reported contact in the form that the account takes.
    fn hit(&self, k: usize) -> Option<Hit> {
        let contact = self.reported.contact.filter(|contact| contact.step == k)?;
        let (state, substep, with) = (&self.state, contact.substep, contact.with);
        if let Some((i, actor)) = state.world.actors.iter().enumerate().find(|(_, actor)| actor.who == with) {
            let row = if substep == 0 { k } else { k + 1 };
            let pose = self.reported.actors[self.teller[i]].at(row)?;
            let (place, velocity) = (pose.place(), pose.sample.velocity);
            let adversary = actor.action.is_some();
            let size = boxed(actor.size, contact.boxes.map(|boxes| boxes.other));
            return Some(Hit { substep, with, adversary, replayed: false, size, place, velocity });
        }
        let ActorRef::Track(track) = with else { return None };
        let plant = &*state.plant;
        let (place, sample) = row_during(plant, k, plant.rows.find(k, track)?, substep);
        let size = boxed(plant.sizes[track], contact.boxes.map(|boxes| boxes.other));
        Some(Hit { substep, with, adversary: false, replayed: true, size, place, velocity: sample.velocity })
    }

    /// Goes through the whole motion, and sums up.
    fn account(&mut self, recorder: &mut Recorder) -> Outcome {
        let mut account = Account::new(&self.state);
        account.observe(&self.state, 0, crate::scene::DT_S);
        let within = usize::from(self.reported.contact.is_some_and(|contact| contact.substep > 0));
        let whole = self.reported.ego.len() - 1 - within;
        let mut k = 0;
        let contact = loop {
            self.take_over(k);
            recorder.push(&self.state, k);
            if k == whole && self.reported.contact.is_none() {
                break None;
            }
            let step = self.plan(k);
            let hit = self.hit(k);
            account.sweep(&self.state, k, &step, hit.map_or(SUBSTEPS, |hit| hit.substep));
            if let Some(hit) = hit {
                break Some(self.stop_at(k, &hit, &step, &mut account, recorder));
            }
            self.state.commit(&step);
            account.advance_on_route(&self.state);
            k += 1;
            account.observe(&self.state, k, crate::scene::DT_S);
        };
        account.outcome(&self.state.plant, self.reported.end, k + within, contact)
    }

    /// Stops everyone at the moment of the contact.
    fn stop_at(
        &mut self,
        k: usize,
        hit: &Hit,
        step: &EgoStep,
        account: &mut Account,
        recorder: &mut Recorder,
    ) -> Contact {
        let boxes = self.reported.contact.and_then(|contact| contact.boxes);
        let ego = boxed(self.state.ego.size, boxes.map(|boxes| boxes.ego));
        let contact = self.state.describe_as(k, hit, step, &ego);
        if hit.substep > 0 {
            self.state.stop_at(hit.substep, step);
            for (actor, of) in self.state.world.actors.iter_mut().zip(&self.teller) {
                put(actor, self.reported.actors[*of].at(k + 1));
            }
            account.advance_on_route(&self.state);
            account.observe(&self.state, k + 1, seconds_after(hit.substep));
            recorder.push_during(&self.state, k, hit.substep);
        }
        account.touched(&self.state, hit.adversary);
        contact
    }
}

/// Returns a road user with the box that the simulator collided, where the report holds one.
fn boxed(size: Size, simulated: Option<[f64; 2]>) -> Size {
    simulated.map_or(size, |[length_m, width_m]| Size::new(size.kind, length_m, width_m))
}

/// Puts a road user where it is reported to be.
fn put(actor: &mut Actor, pose: Option<&Pose>) {
    actor.now = pose.map(|pose| pose.sample);
    actor.axis = pose.map_or(actor.axis, |pose| pose.axis);
}

/// Returns the ego's way to its next pose, which it reaches after so many physics steps.
fn ego_step(now: &Pose, next: &Pose, substeps: usize, size: &Size) -> EgoStep {
    let (first, last) = (now.place(), next.place());
    let at = |j: usize| if j < substeps { first.towards(&last, j as f64 / substeps as f64) } else { last };
    let path: Swept = core::array::from_fn(at);
    let car = Car::seen(&next.sample, next.axis, 2.0 * size.half_length_m);
    let samples = core::array::from_fn(|j| {
        if j + 1 < substeps {
            Sample { position: path[j + 1].position, heading_rad: path[j + 1].axis.heading(), ..next.sample }
        } else {
            next.sample
        }
    });
    let (shown, reach_m) = (samples[SUBSTEPS - 1], reach(&path, size.radius_m));
    EgoStep { samples, shown, car, sprung: None, steering_rad: 0.0, reach_m, path }
}

impl<'a> Relived<'a> for Reenacted<'a> {
    fn state(&self) -> &ClosedLoop<'a> {
        &self.state
    }

    fn wake(&mut self, k: usize) {
        self.take_over(k);
    }

    fn fork(&self, k: usize) -> ClosedLoop<'a> {
        let mut fork = self.state.clone();
        fork.world.actors.iter_mut().for_each(|actor| actor.hand_over(&fork.plant, k));
        fork
    }

    fn advance(&mut self, k: usize) -> Result<bool, SimError> {
        let step = self.plan(k);
        // A road user that overlapped the ego from the moment it appeared is no contact for a manoeuvre either.
        self.state.first_contact(k, &step);
        let over = self.reported.contact.is_some_and(|contact| contact.step == k) || k + 2 > self.reported.ego.len();
        if !over {
            self.state.commit(&step);
        }
        Ok(!over)
    }
}
