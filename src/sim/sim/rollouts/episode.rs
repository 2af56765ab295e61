//! A closed loop that is driven from outside, one decision at a time: look, decide, step, until it ends. [`super::rollout`] is
//! this with a [`Driver`](crate::sim::Driver) that decides, so an episode has the same outcome as the rollout, bit for bit. A step
//! allocates nothing.

use crate::scene::DT_S;
use crate::sim::SimError;
use crate::sim::accounts::account::Account;
use crate::sim::accounts::end::End;
use crate::sim::accounts::outcome::{Contact, Outcome, Trace};
use crate::sim::encounters::avoidance::assess_contact;
use crate::sim::encounters::hit::Hit;
use crate::sim::prepared::body::SUBSTEPS;
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::driver::{Control, View};
use crate::sim::road_users::intervention::{ActorRef, Intervention};
use crate::sim::road_users::others::Others;

use super::closed_loop::{ClosedLoop, EgoStep, seconds_after};
use super::held::Held;
use super::part::{Part, RolloutCost};
use super::recorder::{Recorder, Records};
use super::repeated::Repeated;
use super::rules::{ARRIVAL_SHARE, OFF_ROAD_OFFSET_M, ROUTE_M_MIN};

/// An episode under way, or over.
///
/// ```
/// use evodrive_sim::sim::{Control, Episode, Intervention, Plant};
/// # use evodrive_core::scene::Scene;
/// # fn drive(scene: &Scene) -> Result<(), Box<dyn std::error::Error>> {
/// let (plant, nobody_changed) = (Plant::new(scene)?, Intervention::default());
/// let mut episode = Episode::new(&plant, &nobody_changed)?;
/// while episode.end().is_none() {
///     let speed_mps = episode.observe().ego().speed_mps;
///     episode.step(Control::Drive { acceleration_mps2: 10.0 - speed_mps, steering_rad: 0.0 })?;
/// }
/// println!("{:?}", episode.outcome());
/// # Ok(())
/// # }
/// ```
pub struct Episode<'a> {
    pub(super) state: ClosedLoop<'a>,
    account: Account,
    cost: RolloutCost,
    /// True if the outcome's sums are wanted.
    keeps_account: bool,
    /// True if traffic may turn reactive.
    reacts: bool,
    /// Decision steps so far.
    steps: usize,
    end: Option<End>,
    contact: Option<Contact>,
    /// Decisions so far, where they are kept.
    controls: Option<Vec<Control>>,
    /// Everyone's motion, where that is kept.
    motion: Option<Box<Recorder>>,
}

/// Form of an episode, besides its scene and intervention.
#[derive(Clone, Copy)]
pub(super) struct Form {
    /// True if the ego repeats its recording; then nobody turns reactive.
    pub follows_log: bool,
    /// True if the outcome's sums are wanted. Without them a step costs less.
    pub keeps_account: bool,
    /// True if traffic that appears behind the ego turns reactive.
    pub reacts: bool,
}

impl<'a> Episode<'a> {
    /// Starts at the first state of a scene, in which others do what the intervention says; an empty one leaves the scene as it is.
    /// Both are borrowed, or shared as an [`Arc`](std::sync::Arc). Errors are those of an intervention that cannot be carried
    /// out in the scene.
    pub fn new(
        plant: impl Into<Held<'a, Plant>>,
        intervention: impl Into<Held<'a, Intervention>>,
    ) -> Result<Episode<'a>, SimError> {
        let form = Form { follows_log: false, keeps_account: true, reacts: true };
        Episode::of(plant.into(), intervention.into(), form, &mut |_| ())
    }

    /// Does the same as [`Episode::new`] without sums, so that a step costs less: end, contact and way are the same, but there is no
    /// [`Episode::outcome`].
    pub fn without_account(
        plant: impl Into<Held<'a, Plant>>,
        intervention: impl Into<Held<'a, Intervention>>,
    ) -> Result<Episode<'a>, SimError> {
        let form = Form { follows_log: false, keeps_account: false, reacts: true };
        Episode::of(plant.into(), intervention.into(), form, &mut |_| ())
    }

    pub(super) fn of(
        plant: Held<'a, Plant>,
        intervention: Held<'a, Intervention>,
        form: Form,
        begins: &mut impl FnMut(Part),
    ) -> Result<Episode<'a>, SimError> {
        let state = ClosedLoop::without_driver(plant, intervention, form.follows_log)?;
        let account = Account::new(&state);
        // SafeBench's account decides when the ego has arrived, so there it is kept.
        let keeps_account = form.keeps_account || state.plant.course.is_some();
        let cost = RolloutCost::default();
        let mut episode = Episode {
            state,
            account,
            cost,
            keeps_account,
            reacts: form.reacts,
            steps: 0,
            end: None,
            contact: None,
            controls: None,
            motion: None,
        };
        episode.account_for(0, DT_S);
        episode.begin_step(begins, None);
        Ok(episode)
    }

    /// Makes the episode keep its decisions: [`Episode::controls`], [`Episode::assessed`].
    pub fn keeping_controls(mut self) -> Episode<'a> {
        self.controls = Some(Vec::with_capacity(self.state.plant.steps()));
        self
    }

    /// Makes the episode keep everyone's motion from here on: [`Episode::motion`]. To be called before the
    /// first step.
    pub fn keeping_motion(mut self) -> Episode<'a> {
        let mut recorder = Recorder::new(&self.state.plant, &self.state);
        recorder.push(&self.state, self.steps);
        self.motion = Some(Box::new(recorder));
        self
    }

    /// Returns the world as a driver sees it now: at the beginning of a decision step, or, when the episode is over, where everyone
    /// stopped.
    pub fn observe(&self) -> View<'_> {
        self.state.view(self.steps)
    }

    /// Carries one decision out for 0.1 s, and returns the end if the episode ended with it. An episode that is over stays
    /// as it is. A control that is not finite is refused, and nothing moves.
    pub fn step(&mut self, control: Control) -> Result<Option<End>, SimError> {
        self.recorded(|episode, recorder| episode.advance(control, &mut |_| (), recorder))
    }

    /// Does something with whoever keeps the motion.
    pub(super) fn recorded<R>(&mut self, work: impl FnOnce(&mut Episode<'a>, Option<&mut dyn Records>) -> R) -> R {
        let mut motion = self.motion.take();
        let done = work(self, motion.as_mut().map(|recorder| &mut **recorder as _));
        self.motion = motion;
        done
    }

    pub(super) fn advance(
        &mut self,
        control: Control,
        begins: &mut impl FnMut(Part),
        recorder: Option<&mut dyn Records>,
    ) -> Result<Option<End>, SimError> {
        let Some(ego_step) = self.ego_step(control)? else { return Ok(self.end) };
        self.move_others(begins);
        begins(Part::Contact);
        let hit = self.sweep(&ego_step);
        Ok(self.conclude(&ego_step, hit, begins, recorder))
    }

    /// Returns the ego's motion through the next step by a decision, and moves nobody; `None` if the episode is over, or ends because a
    /// replayed recording has.
    pub(super) fn ego_step(&mut self, control: Control) -> Result<Option<EgoStep>, SimError> {
        if self.end.is_some() {
            return Ok(None);
        }
        let ego_step = self.state.carry_out(control, self.steps)?;
        if let Some(controls) = &mut self.controls {
            controls.push(control);
        }
        if ego_step.is_none() {
            self.end = Some(End::Horizon);
        }
        Ok(ego_step)
    }

    /// Computes the motion of everyone else through the next step.
    pub(super) fn move_others(&mut self, begins: &mut impl FnMut(Part)) {
        begins(Part::Traffic);
        self.state.decide_traffic(self.steps);
        begins(Part::Motion);
        self.state.plan_others(self.steps);
        self.count_step(self.steps);
    }

    /// Ends the step with the ego's first contact in it, or moves everyone to its end.
    pub(super) fn conclude(
        &mut self,
        ego_step: &EgoStep,
        hit: Option<Hit>,
        begins: &mut impl FnMut(Part),
        recorder: Option<&mut dyn Records>,
    ) -> Option<End> {
        if let Some(hit) = hit {
            let k = self.steps;
            self.steps += usize::from(hit.substep > 0);
            self.contact = Some(self.stop_at(k, &hit, ego_step, recorder));
            self.end = Some(End::Contact);
            return self.end;
        }
        begins(Part::Statistics);
        self.state.commit(ego_step);
        self.account.advance_on_route(&self.state);
        self.steps += 1;
        self.account_for(self.steps, DT_S);
        self.end = self.is_over();
        match (self.end, recorder) {
            (None, recorder) => self.begin_step(begins, recorder),
            (Some(_), Some(recorder)) => recorder.push(&self.state, self.steps),
            (Some(_), None) => {}
        }
        self.end
    }

    /// Turns traffic reactive at this step; at the last step the episode is over.
    fn begin_step(&mut self, begins: &mut impl FnMut(Part), recorder: Option<&mut dyn Records>) {
        begins(Part::Traffic);
        if self.reacts {
            self.state.wake(self.steps);
        }
        if let Some(recorder) = recorder {
            recorder.push(&self.state, self.steps);
        }
        if self.steps == self.state.plant.steps() {
            self.end = Some(End::Horizon);
        }
    }

    /// Returns how it ended; `None` while it goes on.
    pub fn end(&self) -> Option<End> {
        self.end
    }

    /// Returns the number of decision steps so far.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Returns the ego's contact.
    pub fn contact(&self) -> Option<&Contact> {
        self.contact.as_ref()
    }

    /// Returns the share of the route driven so far, 0 to 1.
    pub fn route_completion(&self) -> f64 {
        self.account.completion
    }

    /// Returns the number of steps and road users that were simulated so far.
    pub fn cost(&self) -> RolloutCost {
        self.cost
    }

    /// Returns the decisions so far, one a step; empty unless they are kept.
    pub fn controls(&self) -> &[Control] {
        self.controls.as_deref().unwrap_or_default()
    }

    /// Returns everyone's motion so far; `None` unless it is kept.
    pub fn motion(&self) -> Option<&Trace> {
        self.motion.as_ref().map(|recorder| recorder.so_far())
    }

    /// Returns the outcome, the same as [`rollout`](crate::sim::rollout()) has for these decisions; `None` while it goes on, and
    /// without sums.
    pub fn outcome(&self) -> Option<Outcome> {
        let end = self.end.filter(|_| self.keeps_account)?;
        Some(self.summed_up(end))
    }

    pub(super) fn summed_up(&self, end: End) -> Outcome {
        self.account.outcome(&self.state.plant, end, self.steps, self.contact)
    }

    /// Returns [`Episode::outcome`] with its contact [`assess`](crate::sim::assess)ed, for which the kept decisions are driven again:
    /// since when the ego could see an adversary coming, and if it could have avoided it. Labels are read from this.
    /// `None` also where decisions are not kept.
    pub fn assessed(&self) -> Result<Option<Outcome>, SimError> {
        let (Some(outcome), true) = (self.outcome(), self.controls.is_some()) else { return Ok(None) };
        Ok(Some(Outcome { contact: self.assessed_contact()?, ..outcome }))
    }

    /// Returns the contact alone, assessed likewise; as it is if decisions are not kept.
    pub fn assessed_contact(&self) -> Result<Option<Contact>, SimError> {
        let (Some(mut contact), Some(controls)) = (self.contact, &self.controls) else { return Ok(self.contact) };
        let mut again = Repeated::new(controls, self.state.replays);
        assess_contact(&self.state.plant, &self.state.intervention, &mut again, &mut contact)?;
        Ok(Some(contact))
    }

    /// Returns an end if the ego has left its route or arrived: by MetaDrive's rules, or SafeBench's for its traffic families.
    fn is_over(&mut self) -> Option<End> {
        let (route, ego) = (&self.state.plant.route, &self.state.ego);
        let completion = self.account.completion;
        let (left, arrived) = match &mut self.account.driving {
            None => {
                let left = ego.along.offset_m.abs() > OFF_ROAD_OFFSET_M;
                (left, completion > ARRIVAL_SHARE || route.length_m() < ROUTE_M_MIN)
            }
            Some(driving) => {
                let end = route.points()[route.points().len() - 1];
                let arrived = driving.has_arrived(ego, completion, end);
                (driving.has_left_route(ego, route.length_m()), arrived)
            }
        };
        if left {
            return Some(End::OffRoad);
        }
        arrived.then_some(End::Arrived)
    }

    /// Takes the state at simulated step `k` into account, `seconds` after the last.
    fn account_for(&mut self, k: usize, seconds: f64) {
        if self.keeps_account {
            self.account.observe(&self.state, k, seconds);
        }
    }

    fn count_step(&mut self, k: usize) {
        let (plant, world) = (&*self.state.plant, &self.state.world);
        let present = world.actors.iter().filter(|a| a.now.is_some()).count();
        let replayed = plant.rows.of_step(k).len() - world.replaced(plant, k);
        self.cost.steps += 1;
        self.cost.agent_steps += (1 + present + replayed) as u64;
    }

    /// Returns the ego's first contact in the step, and records the adversaries' contacts with others up to it.
    pub(super) fn sweep(&mut self, ego_step: &EgoStep) -> Option<Hit> {
        let hit = self.state.first_contact(self.steps, ego_step);
        if self.keeps_account {
            self.account.sweep(&self.state, self.steps, ego_step, hit.map_or(SUBSTEPS, |h| h.substep));
        }
        hit
    }

    /// Stops everyone at the physics step of the contact.
    fn stop_at(&mut self, k: usize, hit: &Hit, ego_step: &EgoStep, recorder: Option<&mut dyn Records>) -> Contact {
        let contact = self.state.describe(k, hit, ego_step);
        if hit.substep > 0 {
            self.state.stop_at(hit.substep, ego_step);
            self.account.advance_on_route(&self.state);
            self.account_for(k + 1, seconds_after(hit.substep));
            if let Some(recorder) = recorder {
                recorder.push_during(&self.state, k, hit.substep);
            }
        }
        self.account.touched(&self.state, hit.adversary);
        contact
    }
}

impl Others {
    /// Returns the number of recorded rows of a step whose road users are simulated instead.
    fn replaced(&self, plant: &Plant, k: usize) -> usize {
        let tracks = self.actors.iter().filter_map(|a| match a.who {
            ActorRef::Track(track) => Some(track),
            ActorRef::Inserted(_) => None,
        });
        tracks.filter(|&t| plant.rows.find(k, t).is_some()).count()
    }
}
