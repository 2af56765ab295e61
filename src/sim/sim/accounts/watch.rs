//! The running account of a rollout: everything of an outcome that is summed up step by step.

use crate::kernel::Vec2;
use crate::scene::{DT_S, Sample};
use crate::sim::encounters::bystanders::{self, Touched};
use crate::sim::encounters::contact;
use crate::sim::encounters::gaps::{Footprints, encroach, encroachment_s, time_to_collision_s};
use crate::sim::encounters::hit::Mover;
use crate::sim::prepared::body::Size;
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::actors::{Actor, first_change};
use crate::sim::road_users::driver::EgoState;
use crate::sim::road_users::intervention::{Action, ActorRef, Intervention};
use crate::sim::road_users::others::Others;

use super::feasibility::StepMeter;
use super::motion::MotionMeter;
use super::of_kind;
use super::outcome::{ACTED_M, AdversaryReport, WithRecording};
use super::smooth::HALF_WINDOW;

/// Smallest distance and time to collision so far.
#[derive(Clone, Copy, Debug)]
pub(in crate::sim) struct Nearness {
    pub distance_m: f64,
    pub ttc_s: f64,
}

impl Nearness {
    pub fn new() -> Nearness {
        Nearness { distance_m: f64::INFINITY, ttc_s: f64::INFINITY }
    }

    /// Takes one other road user into account; values that circles already rule out are not computed.
    pub fn see(&mut self, ego: &EgoState, position: Vec2, axis: Vec2, velocity: Vec2, size: &Size) {
        let apart = (position - ego.sample.position).norm() - ego.size.radius_m - size.radius_m;
        let closing = (velocity - ego.sample.velocity).norm();
        let (nearer, sooner) = (apart < self.distance_m, apart < self.ttc_s * closing);
        if !nearer && !sooner {
            return;
        }
        let own = ego.size.at(crate::sim::prepared::body::Place { position: ego.sample.position, axis: ego.axis });
        let other = size.at(crate::sim::prepared::body::Place { position, axis });
        if nearer {
            self.distance_m = self.distance_m.min(own.distance(&other));
        }
        if sooner && let Some(ttc) = time_to_collision_s(&own, ego.sample.velocity, &other, velocity) {
            self.ttc_s = self.ttc_s.min(ttc);
        }
    }
}

/// Length below which a recorded way counts as standing still: there is nothing to complete, metres.
const ROUTE_M_MIN: f64 = 5.0;

/// Observations of one adversary.
#[derive(Clone, Debug)]
pub(in crate::sim) struct Watched {
    actor: ActorRef,
    size: Size,
    /// First simulated step of the intervention.
    from_k: usize,
    /// Last simulated step that was observed whole.
    last_k: usize,
    log: Option<usize>,
    meter: MotionMeter,
    last: Option<Sample>,
    steps: StepMeter,
    /// Samples, one a decision step without a gap, and the first of them that the intervention moved.
    samples: Vec<Sample>,
    from_sample: Option<usize>,
    acted: bool,
    pub initial_overlap: bool,
    touched: Touched,
    log_deviation_m_max: Option<f64>,
    /// The report at the end of its encounter with the ego, while that is over.
    judged: Option<AdversaryReport>,
    footprints: Footprints,
    encroachment_steps: usize,
}

impl Watched {
    pub fn new(plant: &Plant, actor: &Actor, intervention: &Intervention) -> Watched {
        let action = actor.action.map(|a| &intervention.actions[a]);
        let from_k = action.map_or(0, first_change).saturating_sub(plant.first_step());
        let log = match action {
            Some(
                Action::Follow { track, .. }
                | Action::FollowThenReact { track, .. }
                | Action::FollowThenObey { track, .. },
            ) => Some(*track),
            _ => None,
        };
        Watched {
            actor: actor.who,
            size: actor.size,
            from_k,
            last_k: 0,
            log,
            meter: MotionMeter::default(),
            last: None,
            steps: StepMeter::default(),
            samples: Vec::with_capacity(plant.steps() + 2),
            from_sample: None,
            acted: false,
            initial_overlap: false,
            touched: Touched::default(),
            log_deviation_m_max: log.map(|_| 0.0),
            judged: None,
            footprints: Footprints::with_room(plant.steps() + 2),
            encroachment_steps: usize::MAX,
        }
    }

    fn acts_at(&self, k: usize) -> bool {
        k >= self.from_k
    }

    /// Takes the adversary's pose at simulated step `k`; `share` of a step further in the last, broken-off one.
    pub fn observe(&mut self, plant: &Plant, now: Option<&Sample>, axis: Vec2, size: &Size, k: usize, seconds: f64) {
        let acts = self.acts_at(k);
        let Some(now) = now else {
            self.last = None;
            self.steps.lose();
            if self.from_sample.is_none() {
                self.samples.clear();
            }
            return;
        };
        self.steps.push(&plant.drivable, now, axis, size, seconds, acts);
        if seconds == DT_S {
            self.from_sample = self.from_sample.or(acts.then_some(self.samples.len()));
            self.samples.push(*now);
        }
        if acts {
            if let Some(last) = self.last {
                self.meter.seed(&last);
            }
            self.meter.push(now, seconds);
        }
        self.last = Some(*now);
    }

    /// Compares it with its recording at simulated step `k`.
    pub fn compare_with_log(&mut self, plant: &Plant, now: Option<&Sample>, k: usize) {
        let Some(now) = now else { return };
        self.last_k = k;
        if !self.acts_at(k) {
            return;
        }
        match self.log.and_then(|track| plant.rows.find(k, track)) {
            Some(row) => {
                let off = plant.rows.place(row).position.distance(now.position);
                self.log_deviation_m_max = self.log_deviation_m_max.map(|d| d.max(off));
                self.acted |= off > ACTED_M;
            }
            None => self.acted = true,
        }
    }

    pub fn encroach(&mut self, ego: &Footprints, ego_size: &Size, actor: &Actor) {
        let place =
            actor.now.as_ref().map(|s| crate::sim::prepared::body::Place { position: s.position, axis: actor.axis });
        self.footprints.push(place);
        encroach(&mut self.encroachment_steps, (ego, ego_size), (&self.footprints, &actor.size));
    }

    /// Notes if it overlaps anyone, the ego included, at the first step of the intervention. Where it follows its recording, others
    /// were put in its way, so nothing is noted.
    pub fn check_start(&mut self, plant: &Plant, world: &Others, own: usize, k: usize, ego: &Mover<'_>) {
        if k != self.from_k || !self.acted || world.actors[own].now.is_none() {
            return;
        }
        self.initial_overlap = contact::touches(ego, &world.actors[own].mover(), 0).is_some()
            || bystanders::touched(plant, world, k, own, 0).any();
    }

    /// Notes which road user it touches in the k-th step up to a physics step, once it differs from its recording.
    pub fn check_way(&mut self, plant: &Plant, world: &Others, own: usize, k: usize, until: usize) {
        let all = self.touched.moving && self.touched.parked;
        if self.acted && !all && world.actors[own].now.is_some() {
            let now = bystanders::touched(plant, world, k, own, until);
            self.touched.moving |= now.moving;
            self.touched.parked |= now.parked;
        }
    }

    pub fn post_encroachment_s(&self) -> Option<f64> {
        encroachment_s(self.encroachment_steps)
    }

    /// Keeps the report as it is while the encounter with the ego is over; one that begins again is judged as a whole.
    pub fn judge(&mut self, plant: &Plant, encounter_is_over: bool) {
        if !encounter_is_over {
            self.judged = None;
        } else if self.judged.is_none() {
            self.judged = Some(self.so_far(plant));
        }
    }

    pub fn report(&self, plant: &Plant) -> AdversaryReport {
        self.judged.clone().unwrap_or_else(|| self.so_far(plant))
    }

    fn so_far(&self, plant: &Plant) -> AdversaryReport {
        let before = self.history(plant);
        let from = self.from_sample.map_or(usize::MAX / 2, |from| from + before.len());
        let samples: Vec<Sample> = before.into_iter().chain(self.samples.iter().copied()).collect();
        AdversaryReport {
            actor: self.actor,
            kind: self.size.kind,
            acted: self.acted,
            motion: self.meter.finish(),
            simulated: self.steps.finish(&samples, from, &self.size),
            recorded: self.log.map(|track| plant.recorded(track)),
            initial_overlap: self.initial_overlap,
            struck_bystander: self.touched.moving,
            struck_parked: self.touched.parked,
            route_completion: self.route_completion(plant),
            log_deviation_m_max: self.log_deviation_m_max,
            of_kind: plant.options().of_kind.then(|| WithRecording {
                simulated: of_kind::of_motion(&samples, from, &self.size),
                recorded: self.log.map(|track| plant.recorded_of_kind(track)),
            }),
            of_place: plant.options().of_place.then(|| WithRecording {
                simulated: plant.places().of_motion(&samples, from, self.size.kind),
                recorded: self.log.map(|track| plant.recorded_of_place(track)),
            }),
        }
    }

    /// Returns the samples recorded just before the first simulated step, so that the first windows can be filled.
    fn history(&self, plant: &Plant) -> Vec<Sample> {
        let scene = plant.scene();
        let Some(track) = self.log.map(|track| &scene.tracks[track]) else { return Vec::new() };
        if self.samples.len() <= self.last_k {
            return Vec::new();
        }
        let first = plant.first_step();
        let mut before: Vec<Sample> =
            (1..=2 * HALF_WINDOW).map_while(|back| track.at(first.checked_sub(back)?).copied()).collect();
        before.reverse();
        before
    }

    /// Returns the share of its recorded way at its place, over that of its recording, both at the last whole step.
    fn route_completion(&self, plant: &Plant) -> Option<f64> {
        let (track, at) = (self.log?, self.samples.last()?);
        self.from_sample?;
        let place = |k: usize| plant.rows.find(k, track).map(|row| plant.rows.place(row).position);
        let (mut way_m, mut driven_m, mut nearest_m) = (0.0, 0.0, f64::INFINITY);
        let mut last = place(self.from_k)?;
        for next in (self.from_k + 1..=self.last_k).map_while(place) {
            let step = next - last;
            let share = ((at.position - last).dot(step) / step.norm_squared().max(1e-12)).clamp(0.0, 1.0);
            let off_m = at.position.distance(last.lerp(next, share));
            if off_m <= nearest_m {
                (nearest_m, driven_m) = (off_m, way_m + share * step.norm());
            }
            (way_m, last) = (way_m + step.norm(), next);
        }
        (way_m >= ROUTE_M_MIN).then(|| driven_m / way_m)
    }
}
