//! Simulated road users of the plain rollout: each moves by its action, its script, its law or its path.

use crate::kernel::{Vec2, num};
use crate::scene::{DT_S, Sample};
use crate::sim::prepared::body::{Place, SUBSTEPS, Size, coasting};
use crate::sim::prepared::path::{Along, Path};
use crate::sim::prepared::plant_options::FollowerStart;
use crate::sim::road_users::bicycle::{Car, DEFAULT_LIMITS, advance};
use crate::sim::road_users::idm;
use crate::sim::road_users::skills::{self, EgoForecast, SKILL_STEPS, Skill};
use crate::sim::{Action, ActorRef, Intervention, Plant};

use super::laws::Obeying;
use super::scripts::Acting;

/// Source of a simulated road user's motion.
#[expect(clippy::large_enum_variant, reason = "one is made for a road user, in tests alone")]
pub(super) enum Mind<'a> {
    /// The samples of an action, or the recording before they begin.
    Samples,
    Skills {
        car: Car,
        skill: Skill,
        done: usize,
    },
    Script(Acting<'a>),
    Law(Obeying<'a>),
    /// IDM along the path of a recording.
    Path {
        born: usize,
        path: &'a Path,
        along: Along,
        speed_mps: f64,
        throttle: f64,
    },
}

/// One simulated road user.
pub(super) struct Body<'a> {
    pub who: ActorRef,
    pub size: Size,
    pub action: Option<usize>,
    pub mind: Mind<'a>,
    pub now: Option<Sample>,
    pub axis: Vec2,
    pub next: Option<Sample>,
    next_axis: Vec2,
    pub places: [Place; SUBSTEPS + 1],
}

/// Returns the first step at which an action changes something; a script stands there from the beginning.
pub(super) fn begins(action: &Action) -> usize {
    match action {
        Action::Follow { from_step, .. }
        | Action::Insert { from_step, .. }
        | Action::FollowThenReact { from_step, .. }
        | Action::FollowThenObey { from_step, .. } => *from_step,
        Action::Triggered(_) => 0,
    }
}

/// Returns the sample at which an action puts its road user at a step of the scene, as long as only its samples move it.
fn sample_at(plant: &Plant, action: &Action, step: usize) -> Option<Sample> {
    match action {
        Action::Triggered(script) => Some(Sample {
            position: script.spawn.position,
            heading_rad: num::wrap_angle(script.spawn.heading_rad),
            velocity: Vec2::ZERO,
        }),
        Action::Insert { from_step, samples, .. } => {
            if step < *from_step {
                None
            } else {
                samples.get(step - from_step).copied()
            }
        }
        Action::Follow { track, from_step, samples }
        | Action::FollowThenReact { track, from_step, samples, .. }
        | Action::FollowThenObey { track, from_step, samples, .. } => {
            if step < *from_step {
                return plant.scene().tracks[*track].at(step).copied();
            }
            let (at, last) = (step - from_step, samples.len() - 1);
            Some(if at > last { coasting(&samples[last], (at - last) as f64 * DT_S) } else { samples[at] })
        }
    }
}

impl<'a> Body<'a> {
    fn new(who: ActorRef, size: Size, action: Option<usize>, mind: Mind<'a>, now: Option<Sample>) -> Body<'a> {
        let axis = now.map_or(Vec2::new(1.0, 0.0), |now| Vec2::from_heading(now.heading_rad));
        let places = [Place::default(); SUBSTEPS + 1];
        Body { who, size, action, mind, now, axis, next: None, next_axis: axis, places }
    }

    /// Returns the adversaries at the first step, in the order of the actions.
    pub fn adversaries(plant: &'a Plant, act: &'a Intervention) -> Vec<Body<'a>> {
        let (mut bodies, mut inserted) = (Vec::new(), 0);
        for (i, action) in act.actions.iter().enumerate() {
            let mind = match action {
                Action::Triggered(script) => Mind::Script(Acting::new(script)),
                Action::FollowThenObey { law, from_step, samples, .. } => {
                    Obeying::new(law, *from_step, samples).map_or(Mind::Samples, Mind::Law)
                }
                _ => Mind::Samples,
            };
            let (who, size) = match action {
                Action::Triggered(script) => {
                    (ActorRef::Inserted(inserted), plant.size_of(script.kind, script.length_m, script.width_m))
                }
                Action::Insert { kind, length_m, width_m, .. } => {
                    (ActorRef::Inserted(inserted), plant.size_of(*kind, *length_m, *width_m))
                }
                Action::Follow { track, .. }
                | Action::FollowThenReact { track, .. }
                | Action::FollowThenObey { track, .. } => {
                    let of = &plant.scene().tracks[*track];
                    (ActorRef::Track(*track), plant.size_of(of.kind, of.length_m, of.width_m))
                }
            };
            inserted += usize::from(matches!(who, ActorRef::Inserted(_)));
            bodies.push(Body::new(who, size, Some(i), mind, sample_at(plant, action, plant.first_step())));
        }
        bodies
    }

    /// Makes traffic that turns reactive at the k-th step along a path that the scene was prepared with.
    pub fn reacting(plant: &Plant, track: usize, k: usize, path: &'a Path) -> Body<'a> {
        let of = &plant.scene().tracks[track];
        let mut now = *of.at(plant.first_step() + k).unwrap();
        if plant.options().plant.follower_start == FollowerStart::Standing {
            now.velocity = Vec2::ZERO;
        }
        let along = path.project(now.position);
        let mind = Mind::Path { born: k, path, along, speed_mps: now.speed_mps(), throttle: 0.0 };
        Body::new(ActorRef::Track(track), plant.size_of(of.kind, of.length_m, of.width_m), None, mind, Some(now))
    }

    /// Returns the step at which reactive traffic appeared.
    pub fn born(&self) -> Option<usize> {
        if let Mind::Path { born, .. } = self.mind { Some(born) } else { None }
    }

    /// Computes the next pose and the places in between; `k` is the present simulated step.
    pub fn plan(&mut self, plant: &Plant, act: &Intervention, k: usize, ego: &EgoForecast) {
        let action = self.action.map(|i| &act.actions[i]);
        let step = plant.first_step() + k;
        if let (Some(Action::FollowThenReact { handover_step, .. }), Mind::Samples, Some(now)) =
            (action, &self.mind, &self.now)
            && step >= *handover_step
        {
            let car = Car::new(now, 2.0 * self.size.half_length_m);
            self.mind = Mind::Skills { car, skill: Skill::Hold, done: SKILL_STEPS };
        }
        let cars = match &mut self.mind {
            Mind::Samples => None,
            Mind::Skills { car, skill, done } => {
                if *done == SKILL_STEPS {
                    (*skill, *done) = (skills::choose(car, &self.size, ego, &plant.drivable), 0);
                }
                let (acceleration, steering) = skill.control(*done);
                *done += 1;
                let cars = car.drive(acceleration, steering, &DEFAULT_LIMITS);
                *car = cars[SUBSTEPS - 1];
                Some(cars)
            }
            Mind::Script(acting) if acting.walks() => {
                self.next = Some(acting.walk(ego, &plant.route));
                return self.go_straight();
            }
            Mind::Script(acting) => Some(acting.drive(ego, &plant.route)),
            Mind::Law(obeying) => obeying.drive(),
            Mind::Path { path, along, speed_mps, throttle, .. } => {
                let limits = plant.limits();
                let wanted = idm::acceleration_mps2(*throttle, limits);
                let (speed, way_m) = advance(*speed_mps, wanted, limits.speed_mps, DT_S);
                *speed_mps = speed;
                along.s_m += way_m;
                along.segment = path.segment_near(along.s_m, 0);
                let wheel_m = 0.5 * self.size.half_length_m;
                let at = |s_m: f64| path.at(s_m, along.segment);
                let heading_rad = num::wrap_angle((at(along.s_m + wheel_m) - at(along.s_m - wheel_m)).heading());
                let velocity = path.direction(along.segment) * speed;
                let arrived = path.length_m() - along.s_m < 2.0;
                self.next = (!arrived).then(|| Sample { position: at(along.s_m), heading_rad, velocity });
                return self.go_straight();
            }
        };
        let Some(cars) = cars else {
            self.next = action.and_then(|action| sample_at(plant, action, step + 1));
            return self.go_straight();
        };
        self.places[0] = Place { position: self.now.map_or(Vec2::ZERO, |now| now.position), axis: self.axis };
        for (j, car) in cars.iter().enumerate() {
            self.places[j + 1] = car.place();
        }
        (self.next, self.next_axis) = (Some(cars[SUBSTEPS - 1].sample()), cars[SUBSTEPS - 1].axis);
    }

    /// Goes straight from the present pose to the next; a road user that leaves coasts until then.
    fn go_straight(&mut self) {
        self.next_axis = self.next.map_or(self.axis, |next| Vec2::from_heading(next.heading_rad));
        let Some(now) = self.now else { return };
        let position = self.next.map_or_else(|| coasting(&now, DT_S).position, |next| next.position);
        let first = Place { position: now.position, axis: self.axis };
        let last = Place { position, axis: self.next_axis };
        self.places = core::array::from_fn(|j| first.towards(&last, j as f64 / SUBSTEPS as f64));
    }

    pub fn commit(&mut self) {
        (self.now, self.axis) = (self.next.take(), self.next_axis);
    }
}
