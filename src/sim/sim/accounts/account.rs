//! The account of a rollout: takes every state in turn and sums an outcome up. The source of the motion does not matter: our
//! own closed loop, or another simulator that reports it.

use crate::scene::DT_S;
use crate::sim::encounters::gaps::Footprints;
use crate::sim::encounters::hit::Mover;
use crate::sim::prepared::body::Place;
use crate::sim::prepared::plant::Plant;
use crate::sim::rollouts::closed_loop::{ClosedLoop, EgoStep};

use super::driving::DrivingMeter;
use super::end::End;
use super::motion::MotionMeter;
use super::outcome::{Contact, Outcome};
use super::trace_digest::TraceDigest;
use super::watch::{Nearness, Watched};

/// Everything of an outcome that is summed up, so far.
pub(in crate::sim) struct Account {
    watched: Vec<Watched>,
    ego_footprints: Footprints,
    ego_meter: MotionMeter,
    start_s_m: f64,
    /// Share of the route driven.
    pub completion: f64,
    lateral_m_max: f64,
    nearness: Nearness,
    /// SafeBench's criteria, for a scene of its traffic families.
    pub driving: Option<DrivingMeter>,
    traced: TraceDigest,
}

impl Account {
    /// Before the first state is observed.
    pub fn new(state: &ClosedLoop<'_>) -> Account {
        let (plant, actors) = (&*state.plant, &state.world.actors);
        Account {
            watched: actors.iter().map(|a| Watched::new(plant, a, &state.intervention)).collect(),
            ego_footprints: Footprints::with_room(plant.steps() + 2),
            ego_meter: Default::default(),
            start_s_m: state.ego.along.s_m.clamp(0.0, plant.route.length_m()),
            completion: 0.0,
            lateral_m_max: state.ego.along.offset_m.abs(),
            nearness: Nearness::new(),
            driving: plant.course.as_ref().map(|course| DrivingMeter::new(course, actors, plant.steps())),
            traced: TraceDigest::new(plant),
        }
    }

    /// Takes the state at simulated step `k` into account, `seconds` after the last.
    pub fn observe(&mut self, state: &ClosedLoop<'_>, k: usize, seconds: f64) {
        let (plant, ego) = (&*state.plant, &state.ego);
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
        self.hash_state(state);
    }

    /// Streams the bits of every simulated pose; what is replayed stands in the plant's digest.
    fn hash_state(&mut self, state: &ClosedLoop<'_>) {
        self.traced.pose(0, &state.ego.sample);
        for (i, actor) in state.world.actors.iter().enumerate() {
            if let Some(now) = &actor.now {
                self.traced.pose(1 + i as u64, now);
            }
        }
    }

    /// The adversaries' contacts with others in the k-th step, up to a physics step.
    pub fn sweep(&mut self, state: &ClosedLoop<'_>, k: usize, step: &EgoStep, until: usize) {
        let ego = Mover { size: &state.plant.ego_size, path: &step.path, reach_m: step.reach_m };
        for (own, watched) in self.watched.iter_mut().enumerate() {
            watched.check_start(&state.plant, &state.world, own, k, &ego);
            watched.check_way(&state.plant, &state.world, own, k, until);
        }
    }

    /// The ego touches somebody: with an adversary, or where there is none, nothing can come nearer.
    pub fn touched(&mut self, state: &ClosedLoop<'_>, adversary: bool) {
        if state.count == 0 || adversary {
            (self.nearness.distance_m, self.nearness.ttc_s) = (0.0, 0.0);
        }
    }

    /// Takes the ego's place on its route into account.
    pub fn advance_on_route(&mut self, state: &ClosedLoop<'_>) {
        let along = &state.ego.along;
        self.lateral_m_max = self.lateral_m_max.max(along.offset_m.abs());
        let left = state.plant.route.length_m() - self.start_s_m;
        let driven = if left > 1e-9 { ((along.s_m - self.start_s_m) / left).clamp(0.0, 1.0) } else { 1.0 };
        self.completion = self.completion.max(driven);
    }

    /// The outcome of a rollout that ended so.
    pub fn outcome(&self, plant: &Plant, end: End, steps: usize, contact: Option<Contact>) -> Outcome {
        let last = [end as u64, steps as u64, contact.map_or(0.0, |c| c.time_s).to_bits()];
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
            adversaries: self.watched.iter().map(|watched| watched.report(plant)).collect(),
            trace: self.traced.finish(last),
            driving: self.driving.as_ref().map(DrivingMeter::finish),
        }
    }
}
