//! The rollout in its plainest form: everyone against everyone at every physics step, straight from the scene, no
//! circles, no grids, no early outs. It is the oracle of the fast one, with actions of every kind (samples, skills, scripts
//! and their triggers, laws), and must agree bit for bit.
//!
//! Shared are the laws of motion: the bicycle, IDM, the skills, the value of a formula. Scripts (`scripts.rs`), laws
//! (`laws.rs`) and everybody's bookkeeping (`bodies.rs`) are written here a second time, constants and all.
//!
//! Not covered, because both sides use the same code:
//! - the geometry below a rollout (boxes, paths, time to collision, the nearest lane), which has tests of its own;
//! - the class and the sides of a contact (`encounters/class.rs`, `contact::describe`) once it is known who touches whom;
//! - the meters of accelerations and of windows (`accounts/motion.rs`, `accounts/feasibility.rs`);
//! - which recorded road users may turn reactive, and their paths (`prepared/plant.rs`).
//!
//! The ego's controls are those that the driver of the fast rollout decided, and the digest of the trace is taken over. Only the
//! fast rollout refuses what the simulator cannot run.

mod bodies;
mod laws;
mod scripts;
mod tests;

use crate::kernel::Vec2;
use crate::scene::{DT_S, Sample, Scene};
use crate::sim::EgoCar;
use crate::sim::accounts::feasibility::{DRIVABLE_TOLERANCE_M, StepMeter};
use crate::sim::accounts::motion::MotionMeter;
use crate::sim::accounts::outcome::ACTED_M;
use crate::sim::encounters::bystanders::{PARKED_M, Touched};
use crate::sim::encounters::class::{Before, STANDING_STEPS};
use crate::sim::encounters::contact::describe;
use crate::sim::encounters::gaps::{ENCROACHMENT_STEPS, time_to_collision_s};
use crate::sim::encounters::hit::Hit;
use crate::sim::prepared::body::{Place, SUBSTEP_S, SUBSTEPS, Size, coasting, sample_during};
use crate::sim::prepared::path::Along;
use crate::sim::road_users::actors::CUT_IN_STEPS;
use crate::sim::road_users::bicycle::Car;
use crate::sim::road_users::driver::Control;
use crate::sim::road_users::idm::{self, Front, SIGHT_M};
use crate::sim::road_users::skills::EgoForecast;
use crate::sim::road_users::sprung::SprungCar;
use crate::sim::{Action, ActorRef, AdversaryReport, End, Feasibility, Intervention, Outcome, Plant};

use self::bodies::{Body, Mind, begins};
use self::laws::{Around, Own};
use self::scripts::set_off;
use super::rules::{ARRIVAL_SHARE, OFF_ROAD_OFFSET_M, ROUTE_M_MIN};

/// Someone but the ego during one decision step.
#[derive(Clone)]
struct Other {
    who: ActorRef,
    adversary: Option<usize>,
    appears: bool,
    size: Size,
    /// Unit heading vector at the beginning.
    axis: Vec2,
    /// Samples at the beginning and after each physics step.
    samples: [Sample; SUBSTEPS + 1],
    places: [Place; SUBSTEPS + 1],
}

/// The ego, likewise, and its place as seen at the end.
struct Ego {
    shown: Sample,
    samples: [Sample; SUBSTEPS + 1],
    places: [Place; SUBSTEPS + 1],
}

pub(in crate::sim) struct Plain<'a> {
    pub scene: &'a Scene,
    pub plant: &'a Plant,
    pub act: &'a Intervention,
    /// Decisions of the driver in the fast rollout.
    pub controls: &'a [Control],
    pub replays: bool,
}

fn between(now: &Sample, next: Option<&Sample>, places: &[Place; SUBSTEPS + 1]) -> [Sample; SUBSTEPS + 1] {
    core::array::from_fn(|j| sample_during(now, next, &places[j], j))
}

fn places_between(now: &Sample, next: Option<&Sample>) -> [Place; SUBSTEPS + 1] {
    let first = Place::of(now);
    let last = match next {
        Some(next) => Place::of(next),
        None => Place { position: coasting(now, DT_S).position, axis: first.axis },
    };
    core::array::from_fn(|j| first.towards(&last, j as f64 / SUBSTEPS as f64))
}

impl Plain<'_> {
    fn track_at(&self, track: usize, k: usize) -> Option<Sample> {
        self.scene.tracks[track].at(self.plant.first_step() + k).copied()
    }

    /// Returns everyone present during the k-th step, tracks in order, then simulated ones.
    fn others(&self, actors: &[Body<'_>], simulated: &[bool], k: usize) -> Vec<Other> {
        let mut others = Vec::new();
        for (i, track) in self.scene.tracks.iter().enumerate().filter(|(i, _)| !simulated[*i]) {
            let Some(now) = self.track_at(i, k) else { continue };
            let next = self.track_at(i, k + 1);
            let places = places_between(&now, next.as_ref());
            others.push(Other {
                who: ActorRef::Track(i),
                adversary: None,
                appears: k == 0 || self.track_at(i, k - 1).is_none(),
                size: self.plant.size_of(track.kind, track.length_m, track.width_m),
                axis: places[0].axis,
                samples: between(&now, next.as_ref(), &places),
                places,
            });
        }
        for actor in actors {
            let Some(now) = &actor.now else { continue };
            others.push(Other {
                who: actor.who,
                adversary: actor.action,
                appears: actor.born() == Some(k),
                size: actor.size,
                axis: actor.axis,
                samples: between(now, actor.next.as_ref(), &actor.places),
                places: actor.places,
            });
        }
        others
    }

    fn throttles(&self, actors: &mut [Body<'_>], others: &[Other], ego: &Sample) {
        for actor in actors {
            let (Mind::Path { path, along, speed_mps, throttle, .. }, Some(now)) = (&mut actor.mind, &actor.now) else {
                continue;
            };
            let mut seen: Vec<(Sample, Size)> =
                others.iter().filter(|o| o.who != actor.who).map(|o| (o.samples[0], o.size)).collect();
            seen.push((*ego, self.plant.ego_size));
            let mut front: Option<Front> = None;
            for (at, size) in seen.iter().filter(|(at, _)| at.position.distance(now.position) <= SIGHT_M) {
                let (axis, obstacle) = (Vec2::from_heading(at.heading_rad), self.plant.options().plant.obstacle);
                let gap = idm::gap_on_path(path, along, at.position, axis, size, obstacle);
                if let Some(gap_m) = gap.filter(|&g| front.is_none_or(|f| g < f.gap_m)) {
                    front = Some(Front { gap_m, velocity: at.velocity });
                }
            }
            let axis = Vec2::from_heading(now.heading_rad);
            *throttle = idm::throttle(*speed_mps, now.velocity, axis, idm::NORMAL_SPEED_KMPH, front.as_ref());
        }
    }

    /// Shows its surroundings to everyone who obeys a law, before anybody moves.
    fn look(&self, actors: &mut [Body<'_>], others: &[Other], ego: &EgoForecast, ego_s_m: f64, k: usize) {
        let count = self.act.actions.len();
        let around = Around { plant: self.plant, others, k, ego, ego_s_m, count };
        for (index, actor) in actors.iter_mut().enumerate() {
            if let (Mind::Law(obeying), Some(now)) = (&mut actor.mind, actor.now) {
                obeying.look(&around, &Own { index, who: actor.who, size: actor.size, now, axis: actor.axis });
            }
        }
    }

    fn ego_step(&self, car: &Car, sprung: &mut Option<SprungCar>, now: &Sample, k: usize) -> Option<(Ego, Car)> {
        match self.controls.get(k)? {
            Control::Drive { acceleration_mps2, steering_rad } if let Some(on_springs) = sprung => {
                let cars = on_springs.drive(*acceleration_mps2, *steering_rad, &self.plant.limits().at_step(k));
                let shown = cars[SUBSTEPS - 1].shown();
                let mut ego = Ego { shown, samples: [*now; SUBSTEPS + 1], places: [on_springs.place(); SUBSTEPS + 1] };
                for (j, moved) in cars.iter().enumerate() {
                    (ego.samples[j + 1], ego.places[j + 1]) = (moved.sample(), moved.place());
                }
                *on_springs = cars[SUBSTEPS - 1];
                Some((ego, Car::new(&shown, 2.0 * self.plant.ego_size.half_length_m)))
            }
            Control::Drive { acceleration_mps2, steering_rad } => {
                let cars = car.drive(*acceleration_mps2, *steering_rad, &self.plant.limits().at_step(k));
                let shown = cars[SUBSTEPS - 1].sample();
                let mut ego = Ego { shown, samples: [*now; SUBSTEPS + 1], places: [car.place(); SUBSTEPS + 1] };
                for (j, moved) in cars.iter().enumerate() {
                    (ego.samples[j + 1], ego.places[j + 1]) = (moved.sample(), moved.place());
                }
                Some((ego, cars[SUBSTEPS - 1]))
            }
            Control::FollowLog => {
                let next = self.scene.ego.track.at(self.plant.first_step() + k + 1)?;
                let places = places_between(now, Some(next));
                *sprung = sprung.map(|_| SprungCar::new(next));
                let samples = between(now, Some(next), &places);
                let ego = Ego { shown: samples[SUBSTEPS], samples, places };
                Some((ego, Car::new(next, 2.0 * self.plant.ego_size.half_length_m)))
            }
        }
    }

    /// Returns the distance beyond every lane piece, all of them looked at.
    fn off_road_m(&self, point: Vec2) -> f64 {
        self.plant.drivable.distance_by_walk_m(point)
    }

    /// Returns the outcome, with its trace digest taken over, and everyone at every step.
    fn rollout(&self, trace: crate::kernel::Digest) -> (Outcome, Vec<Vec<Other>>) {
        let (plant, size) = (self.plant, self.plant.ego_size);
        let mut actors = Body::adversaries(plant, self.act);
        let count = actors.len();
        let mut simulated = vec![false; self.scene.tracks.len()];
        for actor in &actors {
            if let ActorRef::Track(track) = actor.who {
                simulated[track] = true;
            }
        }
        let mut car = Car::new(&plant.ego_start, 2.0 * size.half_length_m);
        let on_springs = plant.options().plant.ego_car == EgoCar::Sprung;
        let mut sprung = on_springs.then(|| SprungCar::new(&plant.ego_start));
        let mut now = plant.ego_start;
        let mut along = plant.route.project(now.position);
        let start_s_m = along.s_m.clamp(0.0, plant.route.length_m());
        let (mut completion, mut lateral, mut acceleration) = (0.0f64, along.offset_m.abs(), 0.0);
        let mut ghosts: Vec<ActorRef> = Vec::new();
        let (mut egos, mut rows) = (vec![(now, DT_S, Place::of(&now))], Vec::new());
        let mut tails: Vec<Option<(Sample, Place)>> = Vec::new();
        let (mut initial, mut struck) = (vec![false; count], vec![Touched::default(); count]);
        let mut acted = vec![false; count];
        let (mut end, mut contact, mut steps) = (End::Horizon, None, 0);
        for k in 0..=plant.steps() {
            let axis = Vec2::from_heading(now.heading_rad);
            self.wake(&mut actors, &mut simulated, &now, axis, k);
            let bare = self.others(&actors, &simulated, k);
            rows.push(bare.clone());
            if k == plant.steps() {
                break;
            }
            let Some((ego, moved)) = self.ego_step(&car, &mut sprung, &now, k) else { break };
            let place = Place { position: now.position, axis };
            let forecast = EgoForecast { place, velocity: now.velocity, acceleration_mps2: acceleration, size };
            self.throttles(&mut actors, &bare, &now);
            set_off(&mut actors, self.act, &forecast);
            self.look(&mut actors, &bare, &forecast, along.s_m, k);
            for actor in &mut actors {
                actor.plan(plant, self.act, k, &forecast);
            }
            let others = self.others(&actors, &simulated, k);
            let hit = self.first_hit(&ego, &others, &mut ghosts);
            let until = hit.map_or(SUBSTEPS, |h: Hit| h.substep);
            for own in others.iter().filter(|o| o.adversary.is_some()) {
                let i = own.adversary.unwrap();
                let from = begins(&self.act.actions[i]).saturating_sub(plant.first_step());
                let touches = |b: &Other, j: usize| own.size.at(own.places[j]).overlaps(&b.size.at(b.places[j]));
                let rest = || others.iter().filter(|b| b.who != own.who && !self.overlapped(own.who, b.who));
                acted[i] |= k >= from && self.differs(own.who, &own.samples[0], k);
                if k == from && acted[i] {
                    initial[i] =
                        own.size.at(own.places[0]).overlaps(&size.at(ego.places[0])) || rest().any(|b| touches(b, 0));
                }
                for b in rest().filter(|b| acted[i] && (0..=until).any(|j| touches(b, j))) {
                    let parked = b.adversary.is_none() && self.is_parked(b.who);
                    (struck[i].parked, struck[i].moving) = (struck[i].parked | parked, struck[i].moving | !parked);
                }
            }
            let j = until;
            let before = hit.map(|hit| self.before(&rows, k, &hit, &along));
            steps += usize::from(j > 0);
            if j > 0 {
                let seconds = if j == SUBSTEPS { DT_S } else { j as f64 * SUBSTEP_S };
                let before = now;
                (now, car) = (if hit.is_some() { ego.samples[j] } else { ego.shown }, moved);
                acceleration = (now.speed_mps() - before.speed_mps()) / seconds;
                let window = 5.0 + now.position.distance(before.position);
                along = plant.route.project_near(now.position, &along, window, window);
                lateral = lateral.max(along.offset_m.abs());
                let left = plant.route.length_m() - start_s_m;
                let driven = if left > 1e-9 { ((along.s_m - start_s_m) / left).clamp(0.0, 1.0) } else { 1.0 };
                completion = completion.max(driven);
                egos.push((now, seconds, if j == SUBSTEPS { Place::of(&now) } else { ego.places[j] }));
            }
            if let (Some(hit), Some(before)) = (hit, before) {
                end = End::Contact;
                contact = Some(describe(&hit, k, &size.at(ego.places[j]), now.velocity, &before));
                if j > 0 {
                    tails = (0..count)
                        .map(|i| others.iter().find(|o| o.adversary == Some(i)).map(|o| (o.samples[j], o.places[j])))
                        .collect();
                }
                break;
            }
            for actor in &mut actors {
                actor.commit();
            }
            if along.offset_m.abs() > OFF_ROAD_OFFSET_M {
                end = End::OffRoad;
            } else if completion > ARRIVAL_SHARE || plant.route.length_m() < ROUTE_M_MIN {
                end = End::Arrived;
            }
            if end != End::Horizon {
                rows.push(self.others(&actors, &simulated, k + 1));
                break;
            }
        }
        let mut meter = MotionMeter::default();
        egos.iter().for_each(|(sample, seconds, _)| meter.push(sample, *seconds));
        let adversary_hit = contact.as_ref().is_some_and(|c: &crate::sim::Contact| c.adversary);
        let mut outcome = Outcome {
            end,
            steps,
            contact,
            distance_m_min: None,
            ttc_s_min: None,
            post_encroachment_s_min: None,
            route_completion: completion,
            ego_lateral_m_max: lateral,
            ego: meter.finish(),
            adversaries: Vec::new(),
            trace,
            driving: None,
        };
        let whole: Vec<Sample> = egos.iter().filter(|(_, s, _)| *s == DT_S).map(|(e, ..)| *e).collect();
        let seconds = egos[egos.len() - 1].1;
        let tail = (!tails.is_empty() && seconds != DT_S).then(|| (egos[egos.len() - 1].0, seconds));
        self.account_nearness(&mut outcome, &egos, &rows, &tails, count);
        let mut encroachment: Option<usize> = None;
        for i in 0..count {
            let at = |k: usize| rows.get(k).and_then(|r| r.iter().find(|o| o.adversary == Some(i)));
            let mut poses: Vec<Option<(Sample, Place)>> =
                (0..whole.len()).map(|k| at(k).map(|o| (o.samples[0], Place::of(&o.samples[0])))).collect();
            if let Some(tail) = tails.get(i).filter(|_| seconds == DT_S) {
                poses[whole.len() - 1] = *tail;
            }
            let own = self.adversary_size(i, &rows, count);
            for (ka, a) in whole.iter().enumerate() {
                for (kb, b) in poses.iter().enumerate() {
                    let lag = ka.abs_diff(kb);
                    let Some((_, b)) = b.as_ref().filter(|_| lag <= ENCROACHMENT_STEPS) else { continue };
                    if size.at(Place::of(a)).overlaps(&own.at(*b)) {
                        encroachment = Some(encroachment.map_or(lag, |e| e.min(lag)));
                    }
                }
            }
            let tail = tail.as_ref().map(|(_, seconds)| (tails[i], *seconds));
            outcome.adversaries.push(self.report(i, &poses, tail, &own, initial[i], struck[i]));
        }
        outcome.post_encroachment_s_min =
            if adversary_hit { Some(0.0) } else { encroachment.map(|lag| lag as f64 * DT_S) };
        (outcome, rows)
    }

    fn wake<'p>(&'p self, actors: &mut Vec<Body<'p>>, simulated: &mut [bool], ego: &Sample, axis: Vec2, k: usize) {
        if !self.plant.options().plant.reactive_traffic.is_on(self.replays) || k >= self.plant.steps() {
            return;
        }
        for candidate in &self.plant.candidates[k] {
            let track = self.plant.rows.track[candidate.row as usize] as usize;
            let sample = self.track_at(track, k).unwrap();
            let (delta, turn) = (
                sample.position - ego.position,
                crate::kernel::num::wrap_angle(sample.heading_rad - ego.heading_rad).abs(),
            );
            let behind = delta.dot(axis) < -1.0 && axis.cross(delta).abs() < 15.0;
            if behind && turn < crate::kernel::num::FRAC_PI_2 && !simulated[track] {
                simulated[track] = true;
                actors.push(Body::reacting(self.plant, track, k, &candidate.path));
            }
        }
    }

    fn first_hit(&self, ego: &Ego, others: &[Other], ghosts: &mut Vec<ActorRef>) -> Option<Hit> {
        let size = self.plant.ego_size;
        let touches = |o: &Other, j: usize| size.at(ego.places[j]).overlaps(&o.size.at(o.places[j]));
        for other in others.iter().filter(|o| o.adversary.is_none()) {
            let was = ghosts.contains(&other.who);
            if touches(other, 0) && other.appears && !self.replays && !was {
                ghosts.push(other.who);
            } else if !touches(other, 0) && was {
                ghosts.retain(|g| *g != other.who);
            }
        }
        for j in 0..=SUBSTEPS {
            if let Some(other) = others.iter().find(|o| !ghosts.contains(&o.who) && touches(o, j)) {
                return Some(Hit {
                    substep: j,
                    with: other.who,
                    adversary: other.adversary.is_some(),
                    replayed: false,
                    size: other.size,
                    place: other.places[j],
                    velocity: other.samples[j].velocity,
                });
            }
        }
        None
    }

    /// Describes the earlier behaviour of the road user that was hit, looked up in everyone's places at the steps so far.
    fn before(&self, rows: &[Vec<Other>], k: usize, hit: &Hit, ego: &Along) -> Before {
        let past = |steps: usize| {
            let then = rows[k.saturating_sub(steps)].iter().find(|other| other.who == hit.with);
            then.map(|other| Place::of(&other.samples[0]))
        };
        Before::from_places(self.plant, &hit.size, ego, past(CUT_IN_STEPS), past(STANDING_STEPS), &hit.place)
    }

    fn adversary_size(&self, i: usize, rows: &[Vec<Other>], _count: usize) -> Size {
        match self.act.actions[i] {
            Action::Insert { kind, length_m, width_m, .. } => self.plant.size_of(kind, length_m, width_m),
            Action::Triggered(ref script) => self.plant.size_of(script.kind, script.length_m, script.width_m),
            _ => rows.iter().flatten().find(|o| o.adversary == Some(i)).map_or(self.plant.ego_size, |o| o.size),
        }
    }

    fn account_nearness(
        &self,
        outcome: &mut Outcome,
        egos: &[(Sample, f64, Place)],
        rows: &[Vec<Other>],
        tails: &[Option<(Sample, Place)>],
        count: usize,
    ) {
        let (mut distance, mut ttc) = (f64::INFINITY, f64::INFINITY);
        let mut see = |ego: &Sample, ego_place: Place, other: &Sample, place: Place, size: &Size| {
            let (a, b) = (self.plant.ego_size.at(ego_place), size.at(place));
            distance = distance.min(a.distance(&b));
            ttc = ttc.min(time_to_collision_s(&a, ego.velocity, &b, other.velocity).unwrap_or(f64::INFINITY));
        };
        for (k, (ego, seconds, ego_place)) in egos.iter().enumerate() {
            let last = k + 1 == egos.len() && !tails.is_empty();
            if last {
                for (i, tail) in tails.iter().enumerate() {
                    if let Some((tail, place)) = tail {
                        see(ego, *ego_place, tail, *place, &self.adversary_size(i, rows, count));
                    }
                }
            } else if *seconds == DT_S {
                let present = rows.get(k).into_iter().flatten();
                let relevant = present.filter(|o| count == 0 || o.adversary.is_some());
                relevant.for_each(|o| see(ego, *ego_place, &o.samples[0], Place::of(&o.samples[0]), &o.size));
            }
        }
        if outcome.contact.as_ref().is_some_and(|c| count == 0 || c.adversary) {
            (distance, ttc) = (0.0, 0.0);
        }
        outcome.distance_m_min = distance.is_finite().then_some(distance);
        outcome.ttc_s_min = ttc.is_finite().then_some(ttc);
    }

    fn report(
        &self,
        i: usize,
        poses: &[Option<(Sample, Place)>],
        tail: Option<(Option<(Sample, Place)>, f64)>,
        size: &Size,
        initial_overlap: bool,
        struck: Touched,
    ) -> AdversaryReport {
        let action = &self.act.actions[i];
        let from = begins(action).saturating_sub(self.plant.first_step());
        let (actor, log) = match action {
            Action::Insert { .. } | Action::Triggered(_) => {
                let adds = |action: &&Action| matches!(action, Action::Insert { .. } | Action::Triggered(_));
                (ActorRef::Inserted(self.act.actions[..i].iter().filter(adds).count()), None)
            }
            Action::Follow { track, .. }
            | Action::FollowThenReact { track, .. }
            | Action::FollowThenObey { track, .. } => (ActorRef::Track(*track), Some(*track)),
        };
        let mut meter = MotionMeter::default();
        let mut report = AdversaryReport {
            actor,
            kind: size.kind,
            acted: false,
            motion: Default::default(),
            simulated: Feasibility::default(),
            recorded: log.map(|track| self.plant.recorded(track)),
            initial_overlap,
            struck_bystander: struck.moving,
            struck_parked: struck.parked,
            route_completion: None,
            log_deviation_m_max: log.map(|_| 0.0),
            // Absent under the options that both are compared with.
            of_kind: None,
            of_place: None,
        };
        let whole = poses.iter().map(|p| (*p, DT_S));
        let all: Vec<(Option<(Sample, Place)>, f64)> = whole.chain(tail).collect();
        let mut last: Option<Sample> = None;
        let mut before: Option<Sample> = None;
        let simulated = &mut report.simulated;
        for (k, (now, seconds)) in all.iter().enumerate() {
            if let (Some((now, place)), true) = (now, k >= from) {
                if let Some(last) = &last {
                    meter.seed(last);
                    let off = now.position - last.position - (last.velocity + now.velocity) * (0.5 * seconds);
                    simulated.jump_m = simulated.jump_m.max(off.norm());
                    if self.plant.drivable.is_wrong_way_by_walk(now.position, place.axis) {
                        simulated.wrong_way_m += last.position.distance(now.position);
                    }
                    if let Some(before) = &before {
                        let as_before = (last.position - before.position) * (seconds / DT_S);
                        simulated.kink_m = simulated.kink_m.max((now.position - last.position - as_before).norm());
                    }
                }
                meter.push(now, *seconds);
                for corner in size.at(*place).corners() {
                    simulated.off_road_m = simulated.off_road_m.max(self.off_road_m(corner) - DRIVABLE_TOLERANCE_M);
                }
                if *seconds == DT_S {
                    let logged = log.and_then(|track| self.track_at(track, k));
                    let off = logged.map(|logged| logged.position.distance(now.position));
                    report.acted |= off.is_none_or(|off| off > ACTED_M);
                    report.log_deviation_m_max = report.log_deviation_m_max.map(|d| d.max(off.unwrap_or(0.0)));
                }
            }
            before = last.filter(|_| now.is_some());
            last = now.map(|(now, _)| now);
        }
        report.motion = meter.finish();
        self.windows(&mut report, poses, log, from, size);
        report
    }

    /// Fills in the values that need several steps: levels of the windows, and the share of its way that it got.
    fn windows(
        &self,
        report: &mut AdversaryReport,
        poses: &[Option<(Sample, Place)>],
        log: Option<usize>,
        from: usize,
        size: &Size,
    ) {
        // The first whole run of samples that reaches the intervention, with what was recorded before the rollout.
        let present = |k: &usize| poses[*k].is_some();
        let Some(begins) = (from.min(poses.len())..poses.len()).find(present) else { return };
        let start = (0..begins).rev().take_while(present).last().unwrap_or(begins);
        let first_step = self.plant.first_step();
        let earlier = (0..first_step).rev().take(2 * crate::sim::accounts::smooth::HALF_WINDOW);
        let earlier = earlier.map_while(|step| self.scene.tracks[log?].at(step).copied());
        let mut samples: Vec<Sample> = if start == 0 { earlier.collect() } else { Vec::new() };
        samples.reverse();
        let history = samples.len();
        samples.extend((start..poses.len()).map_while(|k| poses[k].map(|(sample, _)| sample)));
        let simulated = report.simulated;
        let levels = StepMeter::default().finish(&samples, history + begins - start, size);
        report.simulated = Feasibility {
            off_road_m: simulated.off_road_m,
            wrong_way_m: simulated.wrong_way_m,
            jump_m: simulated.jump_m,
            kink_m: simulated.kink_m,
            ..levels
        };
        let end = samples[samples.len() - 1].position;
        let way: Vec<Vec2> =
            (from..poses.len()).map_while(|k| self.track_at(log?, k)).map(|sample| sample.position).collect();
        let way_m: f64 = way.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        let (mut before_m, mut best) = (0.0, (f64::INFINITY, 0.0));
        for pair in way.windows(2) {
            let step = pair[1] - pair[0];
            let share = ((end - pair[0]).dot(step) / step.norm_squared().max(1e-12)).clamp(0.0, 1.0);
            let off = end.distance(pair[0].lerp(pair[1], share));
            if off <= best.0 {
                best = (off, before_m + share * step.norm());
            }
            before_m += step.norm();
        }
        report.route_completion = (way_m >= 5.0).then_some(best.1 / way_m);
    }

    fn is_parked(&self, who: ActorRef) -> bool {
        let ActorRef::Track(track) = who else { return false };
        let track = &self.scene.tracks[track];
        let seen: Vec<Vec2> = track.samples.iter().flatten().map(|s| s.position).collect();
        track.kind == crate::scene::AgentKind::Static || seen.iter().all(|at| at.distance(seen[0]) <= PARKED_M)
    }

    /// Returns `true` if a road user is not where it was recorded at the k-th step.
    fn differs(&self, who: ActorRef, now: &Sample, k: usize) -> bool {
        let ActorRef::Track(track) = who else { return true };
        self.track_at(track, k).is_none_or(|logged| logged.position.distance(now.position) > ACTED_M)
    }

    /// Returns `true` if two recordings overlap at a physics step.
    fn overlapped(&self, a: ActorRef, b: ActorRef) -> bool {
        let (ActorRef::Track(a), ActorRef::Track(b)) = (a, b) else { return false };
        let places = |track: usize, k: usize| {
            let now = self.track_at(track, k)?;
            Some(places_between(&now, self.track_at(track, k + 1).as_ref()))
        };
        let size = |track: usize| self.plant.sizes[track];
        (0..=self.plant.steps()).any(|k| match (places(a, k), places(b, k)) {
            (Some(at), Some(other)) => (0..=SUBSTEPS).any(|j| size(a).at(at[j]).overlaps(&size(b).at(other[j]))),
            _ => false,
        })
    }
}
