//! Road users that are simulated rather than replayed: adversaries, and traffic that reacts.

use crate::kernel::{Vec2, num};
use crate::scene::{DT_S, Sample, TrackIx};
use crate::sim::SimError;
use crate::sim::encounters::hit::{Mover, Swept};
use crate::sim::prepared::body::{Place, SUBSTEPS, Size, coasting, sample_during};
use crate::sim::prepared::path::{Along, Path};
use crate::sim::prepared::plant::{Plant, sample_is_sound, size_is_sound};
use crate::sim::prepared::plant_options::FollowerStart;

use super::bicycle::{Car, DEFAULT_LIMITS, advance};
use super::idm;
use super::intervention::{Action, ActorRef, Intervention};
use super::obedience::Obedience;
use super::skills::{self, EgoForecast, SKILL_STEPS, Skill};
use super::triggered::{Moved, Play, standing};

/// Time before the contact, in decision steps (2 s), at which a road user was still outside the ego's path if it has cut in:
/// places are kept so far back.
pub const CUT_IN_STEPS: usize = 20;

/// How a simulated road user finds its next pose.
#[derive(Clone, Debug)]
pub(in crate::sim) enum Mind {
    /// Follows an action's samples (its recording before they begin).
    Script,
    /// Has handed over to skills: the present one and how many of its steps are done.
    Skills { car: Car, skill: Skill, done: usize },
    /// Carries a script out.
    Triggered(Box<Play>),
    /// Follows an action's samples until its law takes over, then the law.
    Law(Box<Obedience>),
    /// Keeps its velocity: its own behaviour is not known.
    Coasts,
    /// Is the ego of another closed loop, with its samples after each physics step of the present step.
    Driven(Box<[Sample; SUBSTEPS]>),
    /// Follows the path of a candidate (step of appearance, place in its list) by IDM.
    Path { born: usize, index: usize, along: Along, speed_mps: f64, throttle: f64 },
}

/// One simulated road user.
#[derive(Clone, Debug)]
pub(in crate::sim) struct Actor {
    pub who: ActorRef,
    pub size: Size,
    /// Index in the intervention's actions, for adversaries.
    pub action: Option<usize>,
    pub mind: Mind,
    /// Sample at the present decision step; `None` while it is not there.
    pub now: Option<Sample>,
    /// Unit heading vector of `now`.
    pub axis: Vec2,
    /// Sample at the next decision step.
    pub next: Option<Sample>,
    next_axis: Vec2,
    /// Places at the present step and after each physics step; meaningful while `now` is `Some`.
    pub places: [Place; SUBSTEPS + 1],
    /// The last physics step of the present step at which it is there.
    pub until: usize,
    /// Radius of the box plus its way in this step, metres.
    pub reach_m: f64,
    /// Last places, without the present one.
    trail: Trail,
}

/// Places at the last decision steps, as a ring.
#[derive(Clone, Debug, Default)]
struct Trail {
    places: [Option<Place>; CUT_IN_STEPS],
    next: usize,
}

/// Returns the adversaries of an intervention, checked, in the order of its actions.
pub(in crate::sim) fn adversaries(
    plant: &Plant,
    intervention: &Intervention,
    actors: &mut Vec<Actor>,
) -> Result<(), SimError> {
    let mut inserted = 0;
    for (i, action) in intervention.actions.iter().enumerate() {
        check(plant, i, action)?;
        let mut mind = Mind::Script;
        let (who, size) = match *action {
            Action::Triggered(ref script) => {
                let reference = intervention.actions.get(script.trigger.reference);
                if !matches!(reference, Some(Action::Triggered(_))) {
                    let rule = "a trigger's reference must be a triggered action";
                    return Err(SimError::Action { action: i, rule, found: script.trigger.reference.to_string() });
                }
                inserted += 1;
                mind = Mind::Triggered(Box::new(Play::new(script)));
                (ActorRef::Inserted(inserted - 1), plant.size_of(script.kind, script.length_m, script.width_m))
            }
            Action::Insert { kind, length_m, width_m, .. } => {
                inserted += 1;
                (ActorRef::Inserted(inserted - 1), plant.size_of(kind, length_m, width_m))
            }
            Action::Follow { track, .. }
            | Action::FollowThenReact { track, .. }
            | Action::FollowThenObey { track, .. } => {
                if let Action::FollowThenObey { from_step, samples, law, .. } = action {
                    let obeys = Obedience::new(law, plant, *from_step, samples);
                    mind = obeys.map_or(Mind::Script, |obeys| Mind::Law(Box::new(obeys)));
                }
                let who = ActorRef::Track(track);
                if let Some(earlier) = actors.iter().position(|a| a.who == who) {
                    return Err(SimError::SameTrack { action: i, track, earlier });
                }
                (who, plant.sizes[track])
            }
        };
        actors.push(Actor::new(who, size, Some(i), mind));
    }
    Ok(())
}

fn check(plant: &Plant, i: usize, action: &Action) -> Result<(), SimError> {
    let refuse = |rule, found: String| Err(SimError::Action { action: i, rule, found });
    let (from_step, samples) = match action {
        Action::Follow { from_step, samples, .. }
        | Action::Insert { from_step, samples, .. }
        | Action::FollowThenReact { from_step, samples, .. }
        | Action::FollowThenObey { from_step, samples, .. } => (from_step, samples),
        Action::Triggered(script) if !size_is_sound(script.length_m, script.width_m) => {
            let found = format!("{} x {}", script.length_m, script.width_m);
            return refuse("length and width must be above 0 and at most 100 m", found);
        }
        Action::Triggered(script) => {
            let standing = Sample { position: script.spawn.position, ..Sample::default() };
            let far = (!sample_is_sound(&standing))
                .then(|| ("the spawn must lie within 1e7 m", format!("{:?}", script.spawn)));
            return script.fault().or(far).map_or(Ok(()), |(rule, found)| refuse(rule, found));
        }
    };
    let last = plant.first_step() + plant.steps();
    if *from_step > last {
        return refuse("from_step must be a step of the scene", format!("{from_step} of {}", last + 1));
    }
    if samples.is_empty() {
        return refuse("needs at least one sample", "none".into());
    }
    if let Some(bad) = samples.iter().position(|s| !sample_is_sound(s)) {
        let rule = "samples must be finite, positions within 1e7 m, speeds within 1000 m/s";
        return refuse(rule, format!("{:?} at sample {bad}", samples[bad]));
    }
    match *action {
        Action::Insert { length_m, width_m, .. } if !size_is_sound(length_m, width_m) => {
            refuse("length and width must be above 0 and at most 100 m", format!("{length_m} x {width_m}"))
        }
        Action::Follow { track, .. } | Action::FollowThenReact { track, .. } | Action::FollowThenObey { track, .. }
            if track >= plant.tracks() =>
        {
            refuse("the track must be one of the scene's", format!("{track} of {}", plant.tracks()))
        }
        Action::FollowThenObey { ref law, .. } => law.fault().map_or(Ok(()), |(rule, found)| refuse(rule, found)),
        Action::FollowThenReact { handover_step, from_step, .. }
            if handover_step < from_step || handover_step > last =>
        {
            refuse("handover_step must lie between from_step and the scene's last step", format!("{handover_step}"))
        }
        _ => Ok(()),
    }
}

/// Returns the first step at which an action changes something.
pub(in crate::sim) fn first_change(action: &Action) -> usize {
    match *action {
        Action::Follow { from_step, .. }
        | Action::Insert { from_step, .. }
        | Action::FollowThenReact { from_step, .. }
        | Action::FollowThenObey { from_step, .. } => from_step,
        // It stands there from the first step on.
        Action::Triggered(_) => 0,
    }
}

/// Returns the sample of an action's script at the k-th simulated step; `None` while the road user is not there.
pub(in crate::sim) fn scripted(plant: &Plant, action: &Action, k: usize) -> Option<Sample> {
    let step = plant.first_step() + k;
    let held = |samples: &[Sample], from: usize| {
        let last = samples.len() - 1;
        let at = step - from;
        if at <= last { samples[at] } else { coasting(&samples[last], (at - last) as f64 * DT_S) }
    };
    match action {
        Action::Insert { from_step, samples, .. } => {
            step.checked_sub(*from_step).and_then(|at| samples.get(at).copied())
        }
        Action::Follow { track, from_step, samples }
        | Action::FollowThenReact { track, from_step, samples, .. }
        | Action::FollowThenObey { track, from_step, samples, .. } => {
            if step < *from_step {
                plant.rows.find(k, *track).map(|row| *plant.rows.sample(k, row))
            } else {
                Some(held(samples, *from_step))
            }
        }
        Action::Triggered(script) => Some(standing(script)),
    }
}

/// Sets off the scripts whose trigger holds at the present step.
pub(in crate::sim) fn set_off(actors: &mut [Actor], intervention: &Intervention, ego: &EgoForecast) {
    for own in 0..actors.len() {
        let Some(Action::Triggered(script)) = actors[own].action.map(|a| &intervention.actions[a]) else { continue };
        // Adversaries come first, in the order of the actions.
        let reference = actors.get(script.trigger.reference).and_then(|r| r.now.as_ref()).map(|now| now.position);
        if let (Mind::Triggered(play), Some(reference)) = (&mut actors[own].mind, reference) {
            play.awake = play.awake || Play::is_set_off(script, reference, ego);
        }
    }
}

impl Actor {
    pub fn new(who: ActorRef, size: Size, action: Option<usize>, mind: Mind) -> Actor {
        let places = [Place::default(); SUBSTEPS + 1];
        let axis = Vec2::new(1.0, 0.0);
        Actor {
            who,
            size,
            action,
            mind,
            now: None,
            axis,
            next: None,
            next_axis: axis,
            places,
            until: SUBSTEPS,
            reach_m: 0.0,
            trail: Trail::default(),
        }
    }

    /// Makes the ego of another closed loop, there from the first simulated step on.
    pub fn driven(who: ActorRef, size: Size, now: Sample, axis: Vec2) -> Actor {
        let mut actor = Actor::new(who, size, None, Mind::Driven(Box::default()));
        (actor.now, actor.axis) = (Some(now), axis);
        actor
    }

    /// Makes traffic that turns reactive: a candidate at its first row.
    pub fn reacting(plant: &Plant, born: usize, index: usize) -> Actor {
        let candidate = &plant.candidates[born][index];
        let row = candidate.row as usize;
        let track: TrackIx = plant.rows.track[row] as usize;
        let mut sample = *plant.rows.sample(born, row);
        if plant.options().plant.follower_start == FollowerStart::Standing {
            sample.velocity = Vec2::ZERO;
        }
        let along = candidate.path.project(sample.position);
        let mind = Mind::Path { born, index, along, speed_mps: sample.speed_mps(), throttle: 0.0 };
        let mut actor = Actor::new(ActorRef::Track(track), plant.sizes[track], None, mind);
        actor.now = Some(sample);
        actor.axis = plant.rows.axis[row];
        actor
    }

    /// Sets the pose at the first simulated step.
    pub fn place_first(&mut self, plant: &Plant, intervention: &Intervention) {
        if let (Mind::Script | Mind::Triggered(_) | Mind::Law(_), Some(action)) = (&self.mind, self.action) {
            self.now = scripted(plant, &intervention.actions[action], 0);
            self.axis = self.now.as_ref().map_or(self.axis, |s| Vec2::from_heading(s.heading_rad));
        }
    }

    /// Computes the next pose and the places in between. `k` is the present simulated step.
    pub fn plan(&mut self, plant: &Plant, intervention: &Intervention, k: usize, ego: &EgoForecast) {
        let action = self.action.map(|a| &intervention.actions[a]);
        if let (Some(Action::FollowThenReact { handover_step, .. }), Mind::Script, Some(now)) =
            (action, &self.mind, &self.now)
            && plant.first_step() + k >= *handover_step
        {
            let car = Car::new(now, 2.0 * self.size.half_length_m);
            self.mind = Mind::Skills { car, skill: Skill::Hold, done: SKILL_STEPS };
        }
        match &mut self.mind {
            Mind::Script | Mind::Driven(_) => {
                self.next = action.and_then(|a| scripted(plant, a, k + 1));
                self.interpolate();
            }
            Mind::Coasts => {
                self.next = self.now.as_ref().map(|now| coasting(now, DT_S));
                self.interpolate();
            }
            Mind::Skills { car, skill, done } => {
                if *done == SKILL_STEPS {
                    (*skill, *done) = (skills::choose(car, &self.size, ego, &plant.drivable), 0);
                }
                let (acceleration, steering) = skill.control(*done);
                *done += 1;
                let cars = car.drive(acceleration, steering, &DEFAULT_LIMITS);
                let from = car.place();
                *car = cars[SUBSTEPS - 1];
                self.move_as(from, &cars);
            }
            Mind::Law(obeys) => {
                let driven = match action {
                    Some(Action::FollowThenObey { law, .. }) => obeys.step(law),
                    _ => None,
                };
                match driven {
                    Some((cars, from)) => self.move_as(from, &cars),
                    None => {
                        self.next = action.and_then(|a| scripted(plant, a, k + 1));
                        self.interpolate();
                    }
                }
            }
            Mind::Triggered(play) => {
                let Some(Action::Triggered(script)) = action else { return };
                match play.step(script, ego, &plant.route) {
                    Moved::Cars(cars) => {
                        let position = self.now.map_or(cars[0].position, |n| n.position);
                        self.move_as(Place { position, axis: self.axis }, &cars);
                    }
                    Moved::Walked(sample) => {
                        self.next = Some(sample);
                        self.interpolate();
                    }
                }
            }
            Mind::Path { born, index, along, speed_mps, throttle } => {
                let path = &plant.candidates[*born][*index].path;
                let limits = plant.limits();
                let (speed, distance) =
                    advance(*speed_mps, idm::acceleration_mps2(*throttle, limits), limits.speed_mps, DT_S);
                along.s_m += distance;
                along.segment = path.segment_near(along.s_m, along.segment);
                *speed_mps = speed;
                let arrived = path.length_m() - along.s_m < idm::DESTINATION_M;
                self.next = (!arrived).then(|| on_path(path, along, speed, self.size.half_length_m));
                self.interpolate();
            }
        }
        self.measure_reach();
    }

    /// Moves through the physics steps of a car.
    fn move_as(&mut self, from: Place, cars: &[Car; SUBSTEPS]) {
        self.places[0] = from;
        for (place, moved) in self.places[1..].iter_mut().zip(cars) {
            *place = moved.place();
        }
        let last = &cars[SUBSTEPS - 1];
        (self.next, self.next_axis) = (Some(last.sample()), last.axis);
    }

    fn measure_reach(&mut self) {
        let start = self.places[0].position;
        let way = self.places.iter().map(|p| (p.position - start).norm_squared()).fold(0.0, f64::max);
        self.reach_m = self.size.radius_m + way.sqrt();
    }

    /// Takes the motion of the ego of another closed loop through the present step: its places, its samples after each physics step, and
    /// how everybody sees it at the end.
    pub fn plan_as_driven(&mut self, places: &Swept, samples: &[Sample; SUBSTEPS], shown: Sample, axis: Vec2) {
        if let Mind::Driven(during) = &mut self.mind {
            **during = *samples;
        }
        (self.places, self.until, self.next, self.next_axis) = (*places, SUBSTEPS, Some(shown), axis);
        self.measure_reach();
    }

    /// Takes the pose after `substeps` physics steps from a report; coasts where the report has none.
    pub fn plan_as_reported(&mut self, next: Option<(Sample, Vec2)>, substeps: usize) {
        self.next = next.map(|(sample, _)| sample);
        self.next_axis = next.map_or(self.axis, |(_, axis)| axis);
        let Some(now) = &self.now else { return };
        let first = Place { position: now.position, axis: self.axis };
        let at = next.map_or_else(|| coasting(now, DT_S).position, |(sample, _)| sample.position);
        let last = Place { position: at, axis: self.next_axis };
        for (j, place) in self.places.iter_mut().enumerate() {
            *place = if j < substeps { first.towards(&last, j as f64 / substeps as f64) } else { last };
        }
        self.measure_reach();
    }

    /// Lets our own rules move it on from its reported place: by its script, by IDM along a path of its recording, or
    /// straight on where there is neither.
    pub fn hand_over(&mut self, plant: &Plant, k: usize) {
        let (ActorRef::Track(track), None, Some(now)) = (self.who, self.action, &self.now) else { return };
        let paths = plant.candidates.iter().enumerate().take(k + 1).rev();
        let own = |list: &Vec<crate::sim::prepared::plant::Candidate>| {
            list.iter().position(|candidate| plant.rows.track[candidate.row as usize] as usize == track)
        };
        let path = paths.filter_map(|(born, list)| Some((born, own(list)?))).next();
        self.mind = path.map_or(Mind::Coasts, |(born, index)| Mind::Path {
            born,
            index,
            along: plant.candidates[born][index].path.project(now.position),
            speed_mps: now.speed_mps(),
            throttle: 0.0,
        });
    }

    /// Interpolates between the present sample and the next; a road user that leaves coasts until then.
    fn interpolate(&mut self) {
        self.next_axis = self.next.as_ref().map_or(self.axis, |s| Vec2::from_heading(s.heading_rad));
        let Some(now) = &self.now else { return };
        let first = Place { position: now.position, axis: self.axis };
        let last = match &self.next {
            Some(next) => Place { position: next.position, axis: self.next_axis },
            None => Place { position: coasting(now, DT_S).position, axis: self.axis },
        };
        for (j, place) in self.places.iter_mut().enumerate() {
            *place = first.towards(&last, j as f64 / SUBSTEPS as f64);
        }
    }

    /// Returns the sample after a physics step of the present step.
    pub fn during(&self, substep: usize) -> Option<Sample> {
        self.now.as_ref().map(|now| match &self.mind {
            Mind::Driven(samples) if substep > 0 && self.next.is_some() => samples[substep - 1],
            _ => sample_during(now, self.next.as_ref(), &self.places[substep], substep),
        })
    }

    /// Returns the step at which reactive traffic, or the ego of another closed loop, appeared.
    pub fn born(&self) -> Option<usize> {
        match self.mind {
            Mind::Path { born, .. } => Some(born),
            Mind::Driven(_) => Some(0),
            _ => None,
        }
    }

    pub fn mover(&self) -> Mover<'_> {
        Mover { size: &self.size, path: &self.places, reach_m: self.reach_m }
    }

    fn place(&self) -> Option<Place> {
        self.now.as_ref().map(|now| Place { position: now.position, axis: self.axis })
    }

    /// Returns its place some steps ago, at most [`CUT_IN_STEPS`]; `None` if it was not there.
    pub fn place_before(&self, steps: usize) -> Option<Place> {
        match steps {
            0 => self.place(),
            _ => self.trail.places[(self.trail.next + CUT_IN_STEPS - steps) % CUT_IN_STEPS],
        }
    }

    /// Makes the next pose the present one.
    pub fn commit(&mut self) {
        self.trail.places[self.trail.next] = self.place();
        self.trail.next = (self.trail.next + 1) % CUT_IN_STEPS;
        self.now = self.next.take();
        self.axis = self.next_axis;
    }
}

/// Returns the pose on a path: the heading is that of the chord under the wheels, so it turns smoothly.
fn on_path(path: &Path, along: &Along, speed_mps: f64, half_length_m: f64) -> Sample {
    let wheel_m = 0.5 * half_length_m;
    let chord = path.at(along.s_m + wheel_m, along.segment) - path.at(along.s_m - wheel_m, along.segment);
    let heading_rad = chord.heading();
    let velocity: Vec2 = path.direction(along.segment) * speed_mps;
    Sample { position: path.at(along.s_m, along.segment), heading_rad: num::wrap_angle(heading_rad), velocity }
}
