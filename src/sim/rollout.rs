//! The closed loop: decide, move everyone through five physics steps, check contact, take account, until it ends.

use crate::scene::DT_S;

use super::SimError;
use super::body::{Place, SUBSTEPS};
use super::closed_loop::{ClosedLoop, EgoStep, seconds_after};
use super::contact::{Hit, Mover};
use super::driver::Driver;
use super::driving::DrivingMeter;
use super::gaps::Footprints;
use super::intervention::Intervention;
use super::outcome::{Contact, End, Outcome, Trace};
use super::plant::Plant;
use super::recorder::Recorder;
use super::trace_digest::TraceDigest;
use super::watch::{Nearness, Watched};

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
    pub const ALL: [Part; 6] = [Part::Setup, Part::Traffic, Part::Ego, Part::Motion, Part::Contact, Part::Statistics];

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
    let mut recorder = Recorder::new(plant, &run.state.world, run.state.count);
    let (outcome, _) = run.finish(Some(&mut recorder), |_| ())?;
    Ok((outcome, recorder.finish()))
}

/// A rollout under way.
struct Run<'a> {
    plant: &'a Plant,
    driver: &'a mut dyn Driver,
    state: ClosedLoop<'a>,
    watched: Vec<Watched>,
    ego_footprints: Footprints,
    ego_meter: super::motion::MotionMeter,
    start_s_m: f64,
    completion: f64,
    lateral_m_max: f64,
    nearness: Nearness,
    /// SafeBench's criteria, for a scene of its traffic families.
    driving: Option<DrivingMeter>,
    traced: TraceDigest,
    cost: RolloutCost,
    /// Whether the outcome's sums are wanted.
    keeps_account: bool,
}

impl<'a> Run<'a> {
    fn new(plant: &'a Plant, intervention: &'a Intervention, driver: &'a mut dyn Driver) -> Result<Run<'a>, SimError> {
        let state = ClosedLoop::new(plant, intervention, driver)?;
        let actors = &state.world.actors;
        Ok(Run {
            watched: actors.iter().map(|a| Watched::new(plant, a, intervention)).collect(),
            ego_footprints: Footprints::with_room(plant.steps() + 2),
            ego_meter: Default::default(),
            start_s_m: state.ego.along.s_m.clamp(0.0, plant.route.length_m()),
            completion: 0.0,
            lateral_m_max: state.ego.along.offset_m.abs(),
            nearness: Nearness::new(),
            driving: plant.course.as_ref().map(|course| DrivingMeter::new(course, actors, plant.steps())),
            cost: RolloutCost::default(),
            traced: TraceDigest::new(plant),
            plant,
            driver,
            state,
            keeps_account: true,
        })
    }

    fn finish(
        mut self,
        recorder: Option<&mut Recorder>,
        mut begins: impl FnMut(Part),
    ) -> Result<(Outcome, RolloutCost), SimError> {
        let (end, steps, contact) = self.drive(recorder, &mut begins)?;
        begins(Part::Setup);
        let outcome = self.outcome(end, steps, contact);
        Ok((outcome, self.cost))
    }

    /// Simulates to the end: how it ends, after how many steps, and whom the ego meets.
    fn drive(
        &mut self,
        mut recorder: Option<&mut Recorder>,
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
                recorder.push(plant, &self.state.world, &self.state.ego.sample, k);
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
                let contact = self.stop_at(k, &hit, &ego_step, recorder.as_deref_mut());
                break (End::Contact, Some(contact));
            }
            begins(Part::Statistics);
            self.state.commit(&ego_step);
            self.advance_on_route();
            steps += 1;
            self.observe(steps, DT_S);
            if let Some(end) = self.is_over() {
                break (end, None);
            }
        };
        if !matches!(end, End::Horizon | End::Contact)
            && let Some(recorder) = recorder
        {
            recorder.push(plant, &self.state.world, &self.state.ego.sample, steps);
        }
        Ok((end, steps, contact))
    }

    /// Whether the ego has left its route or arrived: by MetaDrive's rules, or SafeBench's for its traffic families.
    fn is_over(&mut self) -> Option<End> {
        let (route, ego) = (&self.plant.route, &self.state.ego);
        let (left, arrived) = match &mut self.driving {
            None => {
                let left = ego.along.offset_m.abs() > OFF_ROAD_OFFSET_M;
                (left, self.completion > ARRIVAL_SHARE || route.length_m() < ROUTE_M_MIN)
            }
            Some(driving) => {
                let end = route.points()[route.points().len() - 1];
                let arrived = driving.has_arrived(ego, self.completion, end);
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
        if !self.keeps_account {
            return;
        }
        let (plant, state) = (self.plant, &self.state);
        let ego = &state.ego;
        self.ego_meter.push(&ego.sample, seconds);
        let whole_step = seconds == DT_S;
        if whole_step {
            self.ego_footprints.push(Some(Place { position: ego.sample.position, axis: ego.axis }));
        }
        for (watched, actor) in self.watched.iter_mut().zip(&state.world.actors) {
            watched.observe(plant, actor.now.as_ref(), actor.axis, &actor.size, k, seconds);
            if let Some(now) = &actor.now {
                self.nearness.see(ego, now.position, actor.axis, now.velocity, &actor.size);
            }
            if whole_step {
                watched.compare_with_log(plant, actor.now.as_ref(), k);
                watched.encroach(&self.ego_footprints, &ego.size, actor);
            }
        }
        if let (Some(driving), Some(course)) = (&mut self.driving, &plant.course) {
            driving.observe(plant, course, ego, &state.world.actors, k, seconds);
            let watched = self.watched.iter_mut().enumerate();
            watched.for_each(|(i, watched)| watched.judge(plant, driving.encounter_is_over(i)));
        }
        if state.count == 0 && whole_step {
            let nearness = &mut self.nearness;
            state.world.for_each_within(plant, k, ego.sample.position, f64::INFINITY, |seen| {
                nearness.see(ego, seen.position, seen.axis, seen.velocity, &seen.size);
            });
        }
        self.hash_state();
    }

    /// Streams the bits of every simulated pose; what is replayed stands in the plant's digest.
    fn hash_state(&mut self) {
        self.traced.pose(0, &self.state.ego.sample);
        for (i, actor) in self.state.world.actors.iter().enumerate() {
            if let Some(now) = &actor.now {
                self.traced.pose(1 + i as u64, now);
            }
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
        let ego = Mover { size: &self.plant.ego_size, path: &ego_step.path, reach_m: ego_step.reach_m };
        if !self.keeps_account {
            return hit;
        }
        let (world, until) = (&self.state.world, hit.map_or(SUBSTEPS, |h| h.substep));
        for (own, watched) in self.watched.iter_mut().enumerate() {
            watched.check_start(self.plant, world, own, k, &ego);
            watched.check_way(self.plant, world, own, k, until);
        }
        hit
    }

    /// Stops everyone at the physics step of the contact.
    fn stop_at(&mut self, k: usize, hit: &Hit, ego_step: &EgoStep, recorder: Option<&mut Recorder>) -> Contact {
        let contact = self.state.describe(k, hit, ego_step);
        if hit.substep > 0 {
            self.state.stop_at(hit.substep, ego_step);
            self.advance_on_route();
            self.observe(k + 1, seconds_after(hit.substep));
            if let Some(recorder) = recorder {
                recorder.push_during(self.plant, &self.state.world, &self.state.ego.sample, k, hit.substep);
            }
        }
        if self.state.count == 0 || hit.adversary {
            (self.nearness.distance_m, self.nearness.ttc_s) = (0.0, 0.0);
        }
        contact
    }

    fn advance_on_route(&mut self) {
        let along = &self.state.ego.along;
        self.lateral_m_max = self.lateral_m_max.max(along.offset_m.abs());
        let left = self.plant.route.length_m() - self.start_s_m;
        let driven = if left > 1e-9 { ((along.s_m - self.start_s_m) / left).clamp(0.0, 1.0) } else { 1.0 };
        self.completion = self.completion.max(driven);
    }

    fn outcome(&mut self, end: End, steps: usize, contact: Option<Contact>) -> Outcome {
        self.traced.words([end as u64, steps as u64, contact.map_or(0.0, |c| c.time_s).to_bits()]);
        let finite = |x: f64| x.is_finite().then_some(x);
        let with_adversary = contact.is_some_and(|c| c.adversary);
        let encroachments = self.watched.iter().filter_map(Watched::post_encroachment_s);
        let nearest_in_time = encroachments.fold(f64::INFINITY, f64::min);
        Outcome {
            end,
            steps,
            contact,
            distance_m_min: finite(self.nearness.distance_m),
            ttc_s_min: finite(self.nearness.ttc_s),
            post_encroachment_s_min: if with_adversary { Some(0.0) } else { finite(nearest_in_time) },
            route_completion: self.completion,
            ego_lateral_m_max: self.lateral_m_max,
            ego: self.ego_meter.finish(),
            adversaries: self.watched.iter().map(|watched| watched.report(self.plant)).collect(),
            trace: self.traced.finish(),
            driving: self.driving.as_ref().map(DrivingMeter::finish),
        }
    }
}

impl super::others::Others {
    /// Recorded rows of a step whose road users are simulated instead.
    fn replaced(&self, plant: &Plant, k: usize) -> usize {
        let tracks = self.actors.iter().filter_map(|a| match a.who {
            super::ActorRef::Track(track) => Some(track),
            super::ActorRef::Inserted(_) => None,
        });
        tracks.filter(|&t| plant.rows.find(k, t).is_some()).count()
    }
}
