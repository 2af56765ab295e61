//! The closed loop: decide, move everyone through five physics steps, check contact, take account, until it ends.

use crate::kernel::Vec2;
use crate::scene::{DT_S, Sample};

use super::SimError;
use super::actors::{adversaries, set_off};
use super::bicycle::{Car, DEFAULT_LIMITS};
use super::body::{Place, SUBSTEP_S, SUBSTEPS, sample_during};
use super::contact::{self, Hit, Mover, Swept};
use super::driver::{Control, Driver, EgoState, View};
use super::driving::DrivingMeter;
use super::gaps::Footprints;
use super::intervention::Intervention;
use super::others::Others;
use super::outcome::{Contact, End, Outcome, Trace};
use super::plant::Plant;
use super::recorder::Recorder;
use super::skills::EgoForecast;
use super::trace_digest::TraceDigest;
use super::traffic;
use super::watch::{Nearness, Watched};

/// MetaDrive: the ego has left the road this far beside its route, metres.
pub const OFF_ROAD_OFFSET_M: f64 = 4.0;
/// MetaDrive: the ego has arrived with more than this share of its route driven.
pub const ARRIVAL_SHARE: f64 = 0.95;
/// MetaDrive: a route shorter than this is driven from the start, metres.
pub const ROUTE_M_MIN: f64 = 2.0;
/// The ego looks for its place on the route within the way it went and this much, metres.
const ROUTE_WINDOW_M: f64 = 5.0;

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
    let mut recorder = Recorder::new(plant, &run.world, run.count);
    let (outcome, _) = run.finish(Some(&mut recorder), |_| ())?;
    Ok((outcome, recorder.finish()))
}

/// A rollout under way.
struct Run<'a> {
    plant: &'a Plant,
    intervention: &'a Intervention,
    driver: &'a mut dyn Driver,
    world: Others,
    ghosts: Vec<bool>,
    watched: Vec<Watched>,
    /// Number of adversaries: the first of `world.actors`.
    count: usize,
    replays: bool,
    car: Car,
    ego: EgoState,
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
}

/// The ego through one decision step.
struct EgoStep {
    path: Swept,
    /// After each physics step.
    samples: [Sample; SUBSTEPS],
    car: Car,
    steering_rad: f64,
    reach_m: f64,
}

impl<'a> Run<'a> {
    fn new(plant: &'a Plant, intervention: &'a Intervention, driver: &'a mut dyn Driver) -> Result<Run<'a>, SimError> {
        let mut world = Others::for_plant(plant, intervention.actions.len());
        adversaries(plant, intervention, &mut world.actors)?;
        let watched = world.actors.iter().map(|a| Watched::new(plant, a, intervention)).collect();
        for actor in &mut world.actors {
            actor.place_first(plant, intervention);
            if let super::ActorRef::Track(track) = actor.who {
                world.simulated[track] = true;
            }
        }
        driver.begin(plant);
        let car = Car::new(&plant.ego_start, 2.0 * plant.ego_size.half_length_m);
        let along = plant.route.project(plant.ego_start.position);
        let ego = EgoState {
            sample: plant.ego_start,
            axis: car.axis,
            speed_mps: car.speed_mps,
            steering_rad: 0.0,
            acceleration_mps2: 0.0,
            size: plant.ego_size,
            along,
        };
        Ok(Run {
            replays: driver.follows_log(),
            ghosts: vec![false; plant.tracks()],
            count: world.actors.len(),
            ego_footprints: Footprints::with_room(plant.steps() + 2),
            ego_meter: Default::default(),
            start_s_m: along.s_m.clamp(0.0, plant.route.length_m()),
            completion: 0.0,
            lateral_m_max: along.offset_m.abs(),
            nearness: Nearness::new(),
            driving: plant.course.as_ref().map(|course| DrivingMeter::new(course, &world.actors, plant.steps())),
            cost: RolloutCost::default(),
            plant,
            intervention,
            driver,
            world,
            watched,
            car,
            ego,
            traced: TraceDigest::new(plant),
        })
    }

    fn finish(
        mut self,
        mut recorder: Option<&mut Recorder>,
        mut begins: impl FnMut(Part),
    ) -> Result<(Outcome, RolloutCost), SimError> {
        let plant = self.plant;
        let mut steps = 0;
        self.observe(0, DT_S);
        let (end, contact) = loop {
            let k = steps;
            begins(Part::Traffic);
            traffic::wake(plant, &mut self.world, &self.ego, k, self.replays);
            if let Some(recorder) = recorder.as_deref_mut() {
                recorder.push(plant, &self.world, &self.ego.sample, k);
            }
            if k == plant.steps() {
                break (End::Horizon, None);
            }
            begins(Part::Ego);
            let Some(ego_step) = self.decide(k)? else { break (End::Horizon, None) };
            begins(Part::Traffic);
            traffic::decide(plant, &mut self.world, &self.ego, k);
            begins(Part::Motion);
            self.plan_others(k);
            begins(Part::Contact);
            if let Some(hit) = self.sweep(k, &ego_step) {
                steps += usize::from(hit.substep > 0);
                let contact = self.stop_at(k, &hit, &ego_step, recorder.as_deref_mut());
                break (End::Contact, Some(contact));
            }
            begins(Part::Statistics);
            self.commit(&ego_step);
            steps += 1;
            self.observe(steps, DT_S);
            if let Some(end) = self.is_over() {
                break (end, None);
            }
        };
        if !matches!(end, End::Horizon | End::Contact)
            && let Some(recorder) = recorder
        {
            recorder.push(plant, &self.world, &self.ego.sample, steps);
        }
        begins(Part::Setup);
        let outcome = self.outcome(end, steps, contact);
        Ok((outcome, self.cost))
    }

    /// Whether the ego has left its route or arrived: by MetaDrive's rules, or SafeBench's for its traffic families.
    fn is_over(&mut self) -> Option<End> {
        let route = &self.plant.route;
        let (left, arrived) = match &mut self.driving {
            None => {
                let left = self.ego.along.offset_m.abs() > OFF_ROAD_OFFSET_M;
                (left, self.completion > ARRIVAL_SHARE || route.length_m() < ROUTE_M_MIN)
            }
            Some(driving) => {
                let end = route.points()[route.points().len() - 1];
                let arrived = driving.has_arrived(&self.ego, self.completion, end);
                (driving.has_left_route(&self.ego, route.length_m()), arrived)
            }
        };
        if left {
            return Some(End::OffRoad);
        }
        arrived.then_some(End::Arrived)
    }

    /// Takes the state at simulated step `k` into account, `seconds` after the last.
    fn observe(&mut self, k: usize, seconds: f64) {
        let plant = self.plant;
        self.ego_meter.push(&self.ego.sample, seconds);
        let whole_step = seconds == DT_S;
        if whole_step {
            self.ego_footprints.push(Some(Place { position: self.ego.sample.position, axis: self.ego.axis }));
        }
        for (watched, actor) in self.watched.iter_mut().zip(&self.world.actors) {
            watched.observe(plant, actor.now.as_ref(), actor.axis, &actor.size, k, seconds);
            if let Some(now) = &actor.now {
                self.nearness.see(&self.ego, now.position, actor.axis, now.velocity, &actor.size);
            }
            if whole_step {
                watched.compare_with_log(plant, actor.now.as_ref(), k);
                watched.encroach(&self.ego_footprints, &self.ego.size, actor);
            }
        }
        if let (Some(driving), Some(course)) = (&mut self.driving, &plant.course) {
            driving.observe(plant, course, &self.ego, &self.world.actors, k, seconds);
        }
        if self.count == 0 && whole_step {
            let (nearness, ego) = (&mut self.nearness, &self.ego);
            self.world.for_each_within(plant, k, ego.sample.position, f64::INFINITY, |seen| {
                nearness.see(ego, seen.position, seen.axis, seen.velocity, &seen.size);
            });
        }
        self.hash_state();
    }

    /// Streams the bits of every simulated pose; what is replayed stands in the plant's digest.
    fn hash_state(&mut self) {
        self.traced.pose(0, &self.ego.sample);
        for (i, actor) in self.world.actors.iter().enumerate() {
            if let Some(now) = &actor.now {
                self.traced.pose(1 + i as u64, now);
            }
        }
    }

    /// The ego's motion through the next step; `None` when a replayed recording has ended.
    fn decide(&mut self, k: usize) -> Result<Option<EgoStep>, SimError> {
        let view = View { plant: self.plant, world: &self.world, k, ego: &self.ego };
        match self.driver.decide(&view) {
            Control::Drive { acceleration_mps2, steering_rad } => {
                if !acceleration_mps2.is_finite() || !steering_rad.is_finite() {
                    return Err(SimError::Driver {
                        scene: self.plant.scene_id().to_string(),
                        step: self.plant.first_step() + k,
                        what: if acceleration_mps2.is_finite() { "a steering" } else { "an acceleration" },
                    });
                }
                Ok(Some(self.drive(acceleration_mps2, steering_rad)))
            }
            Control::FollowLog => match self.plant.ego_log(k + 1) {
                Some(next) => Ok(Some(self.follow(next))),
                None if k == 0 => {
                    Err(SimError::NoLog { scene: self.plant.scene_id().to_string(), step: self.plant.first_step() + 1 })
                }
                None => Ok(None),
            },
        }
    }

    fn drive(&self, acceleration_mps2: f64, steering_rad: f64) -> EgoStep {
        let cars = self.car.drive(acceleration_mps2, steering_rad, &DEFAULT_LIMITS);
        let mut path = [self.car.place(); SUBSTEPS + 1];
        for (place, car) in path[1..].iter_mut().zip(&cars) {
            *place = car.place();
        }
        let limit = DEFAULT_LIMITS.steering_rad;
        EgoStep {
            samples: cars.map(|car| car.sample()),
            car: cars[SUBSTEPS - 1],
            steering_rad: steering_rad.clamp(-limit, limit),
            reach_m: reach(&path, self.ego.size.radius_m),
            path,
        }
    }

    fn follow(&self, next: &Sample) -> EgoStep {
        let (first, last) = (Place { position: self.ego.sample.position, axis: self.ego.axis }, Place::of(next));
        let path: Swept = core::array::from_fn(|j| first.towards(&last, j as f64 / SUBSTEPS as f64));
        let now = &self.ego.sample;
        let samples = core::array::from_fn(|j| sample_during(now, Some(next), &path[j + 1], j + 1));
        let car = Car::new(next, 2.0 * self.ego.size.half_length_m);
        EgoStep { samples, car, steering_rad: 0.0, reach_m: reach(&path, self.ego.size.radius_m), path }
    }

    fn plan_others(&mut self, k: usize) {
        let forecast = EgoForecast {
            place: Place { position: self.ego.sample.position, axis: self.ego.axis },
            velocity: self.ego.sample.velocity,
            acceleration_mps2: self.ego.acceleration_mps2,
            size: self.ego.size,
        };
        set_off(&mut self.world.actors[..self.count], self.intervention, &forecast);
        for actor in &mut self.world.actors {
            actor.plan(self.plant, self.intervention, k, &forecast);
        }
        let present = self.world.actors.iter().filter(|a| a.now.is_some()).count();
        let replayed = self.plant.rows.of_step(k).len() - self.world.replaced(self.plant, k);
        self.cost.steps += 1;
        self.cost.agent_steps += (1 + present + replayed) as u64;
    }

    /// The ego's first contact in the step, and the adversaries' contacts with others up to it.
    fn sweep(&mut self, k: usize, ego_step: &EgoStep) -> Option<Hit> {
        let ego = Mover { size: &self.plant.ego_size, path: &ego_step.path, reach_m: ego_step.reach_m };
        let hit = contact::first_contact(self.plant, &self.world, &mut self.ghosts, k, &ego, !self.replays);
        let until = hit.map_or(SUBSTEPS, |h| h.substep);
        for (own, watched) in self.watched.iter_mut().enumerate() {
            watched.check_start(self.plant, &self.world, own, k, &ego);
            if watched.acts_at(k) && !watched.struck_bystander && self.world.actors[own].now.is_some() {
                watched.struck_bystander = contact::touches_bystander(self.plant, &self.world, k, own, until);
            }
        }
        hit
    }

    /// Stops everyone at the physics step of the contact.
    fn stop_at(&mut self, k: usize, hit: &Hit, ego_step: &EgoStep, recorder: Option<&mut Recorder>) -> Contact {
        let (substep, place) = (hit.substep, ego_step.path[hit.substep]);
        if substep > 0 {
            let seconds = seconds_after(substep);
            self.move_ego(ego_step.samples[substep - 1], place.axis, ego_step.steering_rad, seconds);
            for actor in &mut self.world.actors {
                actor.now = actor.during(substep);
                actor.axis = actor.places[substep].axis;
            }
            self.observe(k + 1, seconds);
            if let Some(recorder) = recorder {
                recorder.push_during(self.plant, &self.world, &self.ego.sample, k, substep);
            }
        }
        if self.count == 0 || hit.adversary {
            (self.nearness.distance_m, self.nearness.ttc_s) = (0.0, 0.0);
        }
        contact::describe(hit, k, &self.ego.size.at(place), self.ego.sample.velocity)
    }

    fn commit(&mut self, ego_step: &EgoStep) {
        self.car = ego_step.car;
        self.move_ego(ego_step.samples[SUBSTEPS - 1], ego_step.car.axis, ego_step.steering_rad, DT_S);
        for actor in &mut self.world.actors {
            actor.commit();
        }
    }

    fn move_ego(&mut self, sample: Sample, axis: Vec2, steering_rad: f64, seconds: f64) {
        let ego = &mut self.ego;
        let window = ROUTE_WINDOW_M + sample.position.distance(ego.sample.position);
        let speed = sample.speed_mps();
        ego.acceleration_mps2 = (speed - ego.speed_mps) / seconds;
        ego.along = self.plant.route.project_near(sample.position, &ego.along, window, window);
        (ego.sample, ego.axis, ego.speed_mps, ego.steering_rad) = (sample, axis, speed, steering_rad);
        self.lateral_m_max = self.lateral_m_max.max(ego.along.offset_m.abs());
        let left = self.plant.route.length_m() - self.start_s_m;
        let driven = if left > 1e-9 { ((ego.along.s_m - self.start_s_m) / left).clamp(0.0, 1.0) } else { 1.0 };
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
            adversaries: self.watched.iter().map(Watched::report).collect(),
            trace: self.traced.finish(),
            driving: self.driving.as_ref().map(DrivingMeter::finish),
        }
    }
}

/// Seconds from the beginning of a decision step to the end of one of its physics steps.
fn seconds_after(substep: usize) -> f64 {
    if substep == SUBSTEPS { DT_S } else { substep as f64 * SUBSTEP_S }
}

fn reach(path: &Swept, radius_m: f64) -> f64 {
    let start = path[0].position;
    radius_m + path.iter().map(|p| (p.position - start).norm_squared()).fold(0.0, f64::max).sqrt()
}

impl Others {
    fn for_plant(plant: &Plant, adversaries: usize) -> Others {
        let candidates: usize = plant.candidates.iter().map(Vec::len).sum();
        Others { actors: Vec::with_capacity(adversaries + candidates), simulated: vec![false; plant.tracks()] }
    }

    /// Recorded rows of a step whose road users are simulated instead.
    fn replaced(&self, plant: &Plant, k: usize) -> usize {
        let tracks = self.actors.iter().filter_map(|a| match a.who {
            super::ActorRef::Track(track) => Some(track),
            super::ActorRef::Inserted(_) => None,
        });
        tracks.filter(|&t| plant.rows.find(k, t).is_some()).count()
    }
}
