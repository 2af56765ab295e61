//! The closed loop: decide, move everyone through five physics steps, check contact, take account, until it ends.

use crate::scene::DT_S;
use crate::sim::SimError;
use crate::sim::accounts::account::Account;
use crate::sim::accounts::end::End;
use crate::sim::accounts::outcome::{Contact, Outcome, Trace};
use crate::sim::encounters::hit::Hit;
use crate::sim::prepared::body::SUBSTEPS;
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::driver::Driver;
use crate::sim::road_users::intervention::Intervention;

use super::closed_loop::{ClosedLoop, EgoStep, seconds_after};
use super::recorder::{Recorder, Records};

/// MetaDrive: the ego has left the road this far beside its route, metres.
pub const OFF_ROAD_OFFSET_M: f64 = 4.0;
/// MetaDrive: the ego has arrived with more than this share of its route driven.
pub const ARRIVAL_SHARE: f64 = 0.95;
/// MetaDrive: a route shorter than this is driven from the start, metres.
pub const ROUTE_M_MIN: f64 = 2.0;

/// What a rollout cost, for throughput figures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RolloutCost {
    /// Decision steps.
    pub steps: u64,
    /// Road users present, ego included, summed over the decision steps.
    pub agent_steps: u64,
}

/// What a rollout spends its time on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// Buffers, checks of the intervention, the first state; the outcome at the end.
    Setup,
    /// Who turns reactive, and what reactive vehicles decide by IDM.
    Traffic,
    /// The ego's decision and its motion.
    Ego,
    /// Motion of adversaries and reactive vehicles.
    Motion,
    /// Contacts at the physics steps: the ego's, and adversaries' with others.
    Contact,
    /// Everything of the outcome that is summed up: distances, times to collision, road, log, route, trace digest.
    Statistics,
}

impl Part {
    /// Every part, in the order in which a step comes to them.
    pub const ALL: [Part; 6] = [Part::Setup, Part::Traffic, Part::Ego, Part::Motion, Part::Contact, Part::Statistics];

    /// As in the tables of `bench sim`.
    pub fn name(self) -> &'static str {
        match self {
            Part::Setup => "setup",
            Part::Traffic => "traffic",
            Part::Ego => "ego",
            Part::Motion => "motion",
            Part::Contact => "contact",
            Part::Statistics => "statistics",
        }
    }
}

/// One closed-loop rollout.
pub fn rollout(plant: &Plant, intervention: &Intervention, driver: &mut dyn Driver) -> Result<Outcome, SimError> {
    Run::new(plant, intervention, driver)?.finish(None, |_| ()).map(|(outcome, _)| outcome)
}

/// How [`rollout`] ends and whom the ego touches, bit for bit, without what an outcome sums up: for searches that simulate
/// the ego again and again.
pub fn ending(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
) -> Result<(End, Option<Contact>), SimError> {
    let mut run = Run::new(plant, intervention, driver)?;
    // SafeBench's account says when the ego has arrived, so there it is kept.
    run.keeps_account = plant.course.is_some();
    run.drive(None, &mut |_| ()).map(|(end, _, contact)| (end, contact))
}

/// [`rollout`] with the number of agent-steps it simulated.
pub fn rollout_counted(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
) -> Result<(Outcome, RolloutCost), SimError> {
    Run::new(plant, intervention, driver)?.finish(None, |_| ())
}

/// [`rollout_counted`] that says at every border which part begins; who listens may hold a clock. The outcome is the same.
pub fn rollout_in_parts(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
    mut begins: impl FnMut(Part),
) -> Result<(Outcome, RolloutCost), SimError> {
    begins(Part::Setup);
    Run::new(plant, intervention, driver)?.finish(None, begins)
}

/// [`rollout`] with the motion behind it; the outcome is the same bit for bit.
pub fn rollout_traced(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
) -> Result<(Outcome, Trace), SimError> {
    let run = Run::new(plant, intervention, driver)?;
    let mut recorder = Recorder::new(plant, &run.state);
    let (outcome, _) = run.finish(Some(&mut recorder), |_| ())?;
    Ok((outcome, recorder.finish()))
}

/// How [`rollout`] ends, with everything about it written down by whoever records.
pub(super) fn rollout_recorded(
    plant: &Plant,
    intervention: &Intervention,
    driver: &mut dyn Driver,
    recorder: &mut dyn Records,
) -> Result<(End, usize, Option<Contact>), SimError> {
    let mut run = Run::new(plant, intervention, driver)?;
    run.keeps_account = plant.course.is_some();
    run.drive(Some(recorder), &mut |_| ())
}

/// A rollout under way.
struct Run<'a> {
    plant: &'a Plant,
    driver: &'a mut dyn Driver,
    state: ClosedLoop<'a>,
    account: Account,
    cost: RolloutCost,
    /// Whether the outcome's sums are wanted.
    keeps_account: bool,
}

impl<'a> Run<'a> {
    fn new(plant: &'a Plant, intervention: &'a Intervention, driver: &'a mut dyn Driver) -> Result<Run<'a>, SimError> {
        let state = ClosedLoop::new(plant, intervention, driver)?;
        let account = Account::new(&state);
        Ok(Run { account, cost: RolloutCost::default(), plant, driver, state, keeps_account: true })
    }

    fn finish(
        mut self,
        recorder: Option<&mut dyn Records>,
        mut begins: impl FnMut(Part),
    ) -> Result<(Outcome, RolloutCost), SimError> {
        let (end, steps, contact) = self.drive(recorder, &mut begins)?;
        begins(Part::Setup);
        let outcome = self.account.outcome(self.plant, end, steps, contact);
        Ok((outcome, self.cost))
    }

    /// Simulates to the end: how it ends, after how many steps, and whom the ego meets.
    fn drive(
        &mut self,
        mut recorder: Option<&mut dyn Records>,
        begins: &mut impl FnMut(Part),
    ) -> Result<(End, usize, Option<Contact>), SimError> {
        let plant = self.plant;
        let mut steps = 0;
        self.observe(0, DT_S);
        let (end, contact) = loop {
            let k = steps;
            begins(Part::Traffic);
            self.state.wake(k);
            if let Some(recorder) = recorder.as_deref_mut() {
                recorder.push(&self.state, k);
            }
            if k == plant.steps() {
                break (End::Horizon, None);
            }
            begins(Part::Ego);
            let Some(ego_step) = self.state.decide(self.driver, k)? else { break (End::Horizon, None) };
            begins(Part::Traffic);
            self.state.decide_traffic(k);
            begins(Part::Motion);
            self.state.plan_others(k);
            self.count_step(k);
            begins(Part::Contact);
            if let Some(hit) = self.sweep(k, &ego_step) {
                steps += usize::from(hit.substep > 0);
                let contact = self.stop_at(k, &hit, &ego_step, recorder.as_mut().map(|r| &mut **r as _));
                break (End::Contact, Some(contact));
            }
            begins(Part::Statistics);
            self.state.commit(&ego_step);
            self.account.advance_on_route(&self.state);
            steps += 1;
            self.observe(steps, DT_S);
            if let Some(end) = self.is_over() {
                break (end, None);
            }
        };
        if !matches!(end, End::Horizon | End::Contact)
            && let Some(recorder) = recorder
        {
            recorder.push(&self.state, steps);
        }
        self.state.finish(self.driver, steps, end);
        Ok((end, steps, contact))
    }

    /// Whether the ego has left its route or arrived: by MetaDrive's rules, or SafeBench's for its traffic families.
    fn is_over(&mut self) -> Option<End> {
        let (route, ego) = (&self.plant.route, &self.state.ego);
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
    fn observe(&mut self, k: usize, seconds: f64) {
        if self.keeps_account {
            self.account.observe(&self.state, k, seconds);
        }
    }

    fn count_step(&mut self, k: usize) {
        let world = &self.state.world;
        let present = world.actors.iter().filter(|a| a.now.is_some()).count();
        let replayed = self.plant.rows.of_step(k).len() - world.replaced(self.plant, k);
        self.cost.steps += 1;
        self.cost.agent_steps += (1 + present + replayed) as u64;
    }

    /// The ego's first contact in the step, and the adversaries' contacts with others up to it.
    fn sweep(&mut self, k: usize, ego_step: &EgoStep) -> Option<Hit> {
        let hit = self.state.first_contact(k, ego_step);
        if self.keeps_account {
            self.account.sweep(&self.state, k, ego_step, hit.map_or(SUBSTEPS, |h| h.substep));
        }
        hit
    }

    /// Stops everyone at the physics step of the contact.
    fn stop_at(&mut self, k: usize, hit: &Hit, ego_step: &EgoStep, recorder: Option<&mut dyn Records>) -> Contact {
        let contact = self.state.describe(k, hit, ego_step);
        if hit.substep > 0 {
            self.state.stop_at(hit.substep, ego_step);
            self.account.advance_on_route(&self.state);
            self.observe(k + 1, seconds_after(hit.substep));
            if let Some(recorder) = recorder {
                recorder.push_during(&self.state, k, hit.substep);
            }
        }
        self.account.touched(&self.state, hit.adversary);
        contact
    }
}

impl crate::sim::road_users::others::Others {
    /// Recorded rows of a step whose road users are simulated instead.
    fn replaced(&self, plant: &Plant, k: usize) -> usize {
        let tracks = self.actors.iter().filter_map(|a| match a.who {
            crate::sim::ActorRef::Track(track) => Some(track),
            crate::sim::ActorRef::Inserted(_) => None,
        });
        tracks.filter(|&t| plant.rows.find(k, t).is_some()).count()
    }
}
