//! The state of a closed loop and its steps: the ego decides, everyone moves through five physics steps, contacts are
//! found. It keeps no account: [`super::rollout`] sums an outcome up, [`crate::sim::encounters::avoidance`] only needs contacts.

use crate::kernel::Vec2;
use crate::scene::{DT_S, Sample};
use crate::sim::SimError;
use crate::sim::accounts::outcome::Contact;
use crate::sim::encounters::class::Before;
use crate::sim::encounters::contact;
use crate::sim::encounters::fault::Fault;
use crate::sim::encounters::hit::{Hit, Mover, Swept};
use crate::sim::prepared::body::{Place, SUBSTEP_S, SUBSTEPS, Size, sample_during};
use crate::sim::prepared::plant::Plant;
use crate::sim::prepared::plant_options::EgoCar;
use crate::sim::road_users::actors::{Mind, adversaries, set_off};
use crate::sim::road_users::bicycle::Car;
use crate::sim::road_users::driver::{Control, EgoState, View};
use crate::sim::road_users::intervention::{Action, Intervention};
use crate::sim::road_users::observing::Surroundings;
use crate::sim::road_users::others::Others;
use crate::sim::road_users::skills::EgoForecast;
use crate::sim::road_users::sprung::SprungCar;
use crate::sim::road_users::traffic;

use super::held::Held;

/// Margin beyond the way it went within which the ego looks for its place on the route, metres.
const ROUTE_WINDOW_M: f64 = 5.0;

/// Everyone at one decision step.
#[derive(Clone)]
pub(in crate::sim) struct ClosedLoop<'a> {
    pub plant: Held<'a, Plant>,
    pub intervention: Held<'a, Intervention>,
    pub world: Others,
    /// Number of adversaries: the first of `world.actors`.
    pub count: usize,
    /// True if the driver under test repeats the recorded motion.
    pub replays: bool,
    pub ego: EgoState,
    car: Car,
    /// The ego's car where the plant has it on springs; `car` then stands where the sprung car is shown.
    sprung: Option<SprungCar>,
    /// Tracks that overlapped the ego when they appeared and have not left it since.
    ghosts: Vec<bool>,
}

/// The ego through one decision step.
pub(in crate::sim) struct EgoStep {
    pub path: Swept,
    /// After each physics step.
    pub samples: [Sample; SUBSTEPS],
    /// At the end of the step, as everybody sees it.
    pub shown: Sample,
    pub car: Car,
    pub sprung: Option<SprungCar>,
    pub steering_rad: f64,
    pub reach_m: f64,
}

impl<'a> ClosedLoop<'a> {
    /// Makes the first state; `replays` is true if the ego is driven as it was recorded. Refuses interventions that cannot be
    /// carried out.
    pub fn without_driver(
        plant: Held<'a, Plant>,
        intervention: Held<'a, Intervention>,
        replays: bool,
    ) -> Result<ClosedLoop<'a>, SimError> {
        let mut world = Others::for_plant(&plant, intervention.actions.len());
        adversaries(&plant, &intervention, &mut world.actors)?;
        for actor in &mut world.actors {
            actor.place_first(&plant, &intervention);
            if let crate::sim::ActorRef::Track(track) = actor.who {
                world.simulated[track] = true;
            }
        }
        let car = Car::new(&plant.ego_start, 2.0 * plant.ego_size.half_length_m);
        let ego = EgoState {
            sample: plant.ego_start,
            axis: car.axis,
            speed_mps: car.speed_mps,
            steering_rad: 0.0,
            acceleration_mps2: 0.0,
            size: plant.ego_size,
            along: plant.route.project(plant.ego_start.position),
        };
        let sprung = plant.options().plant.ego_car == EgoCar::Sprung;
        Ok(ClosedLoop {
            sprung: sprung.then(|| SprungCar::new(&plant.ego_start)),
            replays,
            ghosts: vec![false; plant.tracks()],
            count: world.actors.len(),
            plant,
            intervention,
            world,
            ego,
            car,
        })
    }

    /// Makes traffic that appears behind the ego at the k-th step reactive.
    pub fn wake(&mut self, k: usize) {
        traffic::wake(&self.plant, &mut self.world, &self.ego, k, self.replays);
    }

    /// Returns the world as a driver sees it at the k-th step.
    pub fn view(&self, k: usize) -> View<'_> {
        View { plant: &self.plant, world: &self.world, k, ego: &self.ego }
    }

    /// Returns the ego's motion through the next step by a decision; `None` when a replayed recording has ended.
    pub fn carry_out(&self, control: Control, k: usize) -> Result<Option<EgoStep>, SimError> {
        match control {
            Control::Drive { acceleration_mps2, steering_rad } => {
                if !acceleration_mps2.is_finite() || !steering_rad.is_finite() {
                    return Err(SimError::Driver {
                        scene: self.plant.scene_id().to_string(),
                        step: self.plant.first_step() + k,
                        what: if acceleration_mps2.is_finite() { "a steering" } else { "an acceleration" },
                    });
                }
                Ok(Some(self.drive(acceleration_mps2, steering_rad, k)))
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

    /// Returns the ego's motion through the k-th step under constant controls.
    pub fn drive(&self, acceleration_mps2: f64, steering_rad: f64, k: usize) -> EgoStep {
        let limits = self.plant.limits().at_step(k);
        let (samples, shown, car, sprung, path) = match &self.sprung {
            Some(sprung) => {
                let cars = sprung.drive(acceleration_mps2, steering_rad, &limits);
                let last = cars[SUBSTEPS - 1];
                let shown = last.shown();
                let axis = Vec2::from_heading(shown.heading_rad);
                let car = Car::seen(&shown, axis, 2.0 * self.ego.size.half_length_m);
                (
                    cars.map(|car| car.sample()),
                    shown,
                    car,
                    Some(last),
                    swept(sprung.place(), cars.map(|car| car.place())),
                )
            }
            None => {
                let cars = self.car.drive(acceleration_mps2, steering_rad, &limits);
                let last = cars[SUBSTEPS - 1];
                (
                    cars.map(|car| car.sample()),
                    last.sample(),
                    last,
                    None,
                    swept(self.car.place(), cars.map(|car| car.place())),
                )
            }
        };
        EgoStep {
            samples,
            shown,
            car,
            sprung,
            steering_rad: steering_rad.clamp(-limits.steering_rad, limits.steering_rad),
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
        let sprung = self.sprung.is_some().then(|| SprungCar::new(next));
        let reach_m = reach(&path, self.ego.size.radius_m);
        EgoStep { shown: samples[SUBSTEPS - 1], samples, car, sprung, steering_rad: 0.0, reach_m, path }
    }

    /// Gives the ego a careful driver's single-track car, where it is seen: springs do not decide what such a driver can avoid.
    pub fn without_springs(mut self) -> ClosedLoop<'a> {
        self.sprung = None;
        self
    }

    /// Lets reactive traffic decide at the k-th step.
    pub fn decide_traffic(&mut self, k: usize) {
        traffic::decide(&self.plant, &mut self.world, &self.ego, k);
    }

    /// Computes the next pose of everyone simulated but the ego.
    pub fn plan_others(&mut self, k: usize) {
        let forecast = EgoForecast {
            place: Place { position: self.ego.sample.position, axis: self.ego.axis },
            velocity: self.ego.sample.velocity,
            acceleration_mps2: self.ego.acceleration_mps2,
            size: self.ego.size,
        };
        set_off(&mut self.world.actors[..self.count], &self.intervention, &forecast);
        self.let_observe(k, &forecast);
        for actor in &mut self.world.actors {
            actor.plan(&self.plant, &self.intervention, k, &forecast);
        }
    }

    /// Shows the present state to adversaries under a law, before anybody moves.
    fn let_observe(&mut self, k: usize, ego: &EgoForecast) {
        for own in 0..self.count {
            let around = Surroundings {
                plant: &self.plant,
                world: &self.world,
                k,
                ego,
                ego_along: &self.ego.along,
                count: self.count,
                own,
            };
            let Mind::Law(obeys) = &self.world.actors[own].mind else { continue };
            let Some(sight) = obeys.observe(&around) else { continue };
            let actor = &mut self.world.actors[own];
            let action = actor.action.map(|a| &self.intervention.actions[a]);
            if let (Mind::Law(obeys), Some(Action::FollowThenObey { law, .. }), Some(now)) =
                (&mut actor.mind, action, &actor.now)
            {
                obeys.see(law, sight, now, 2.0 * actor.size.half_length_m);
            }
        }
    }

    /// Returns the ego's first contact in the k-th step.
    pub fn first_contact(&mut self, k: usize, step: &EgoStep) -> Option<Hit> {
        let ego = Mover { size: &self.plant.ego_size, path: &step.path, reach_m: step.reach_m };
        contact::first_contact(&self.plant, &self.world, &mut self.ghosts, k, &ego, !self.replays)
    }

    /// Takes a recorded road user out of the world.
    pub fn take_out(&mut self, track: usize) {
        self.world.simulated[track] = true;
    }

    /// Returns the ego's car.
    pub fn car(&self) -> &Car {
        &self.car
    }

    /// Describes a contact in the k-th step.
    pub fn describe(&self, k: usize, hit: &Hit, step: &EgoStep) -> Contact {
        self.describe_as(k, hit, step, &self.ego.size)
    }

    /// Does the same for an ego with this box.
    pub fn describe_as(&self, k: usize, hit: &Hit, step: &EgoStep, size: &Size) -> Contact {
        let velocity = match hit.substep {
            0 => self.ego.sample.velocity,
            j => step.samples[j - 1].velocity,
        };
        let before = Before::of(&self.plant, &self.world, k, hit, &self.ego.along);
        let own = size.at(step.path[hit.substep]);
        let contact = contact::describe(hit, k, &own, velocity, &before);
        let fault = self
            .plant
            .options()
            .at_fault
            .then(|| Fault::of(&self.plant, &own, velocity, &hit.size.at(hit.place), hit.velocity, hit.size.kind));
        Contact { fault, ..contact }
    }

    /// Makes the next pose of everyone the present one.
    pub fn commit(&mut self, step: &EgoStep) {
        (self.car, self.sprung) = (step.car, step.sprung);
        self.move_ego(step.shown, step.car.axis, step.steering_rad, DT_S);
        for actor in &mut self.world.actors {
            actor.commit();
        }
    }

    /// Stops everyone at a physics step after the first of the present step.
    pub fn stop_at(&mut self, substep: usize, step: &EgoStep) {
        let axis = step.path[substep].axis;
        self.move_ego(step.samples[substep - 1], axis, step.steering_rad, seconds_after(substep));
        for actor in &mut self.world.actors {
            actor.now = actor.during(substep);
            actor.axis = actor.places[substep].axis;
        }
    }

    fn move_ego(&mut self, sample: Sample, axis: Vec2, steering_rad: f64, seconds: f64) {
        let ego = &mut self.ego;
        let window = ROUTE_WINDOW_M + sample.position.distance(ego.sample.position);
        let speed = sample.speed_mps();
        ego.acceleration_mps2 = (speed - ego.speed_mps) / seconds;
        ego.along = self.plant.route.project_near(sample.position, &ego.along, window, window);
        (ego.sample, ego.axis, ego.speed_mps, ego.steering_rad) = (sample, axis, speed, steering_rad);
    }
}

/// Returns the seconds from the beginning of a decision step to the end of one of its physics steps.
pub(super) fn seconds_after(substep: usize) -> f64 {
    if substep == SUBSTEPS { DT_S } else { substep as f64 * SUBSTEP_S }
}

/// Returns the places of a step: its beginning, and after each physics step.
fn swept(first: Place, after: [Place; SUBSTEPS]) -> Swept {
    core::array::from_fn(|j| if j == 0 { first } else { after[j - 1] })
}

pub(in crate::sim) fn reach(path: &Swept, radius_m: f64) -> f64 {
    let start = path[0].position;
    radius_m + path.iter().map(|p| (p.position - start).norm_squared()).fold(0.0, f64::max).sqrt()
}

impl Others {
    fn for_plant(plant: &Plant, adversaries: usize) -> Others {
        let candidates: usize = plant.candidates.iter().map(Vec::len).sum();
        Others { actors: Vec::with_capacity(adversaries + candidates), simulated: vec![false; plant.tracks()] }
    }
}
