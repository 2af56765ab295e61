//! The running account of a rollout: everything of an outcome that is summed up step by step.

use crate::kernel::Vec2;
use crate::scene::Sample;

use super::actors::{Actor, first_change};
use super::body::Size;
use super::contact;
use super::driver::EgoState;
use super::gaps::{Footprints, encroach, encroachment_s, time_to_collision_s};
use super::intervention::{Action, ActorRef, Intervention};
use super::motion::MotionMeter;
use super::others::Others;
use super::outcome::AdversaryReport;
use super::plant::Plant;

/// A corner this far beyond the lanes still counts as on the road: lane lines of recordings are no better, metres.
pub const DRIVABLE_TOLERANCE_M: f64 = 0.5;

/// Smallest distance and time to collision so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearness {
    pub distance_m: f64,
    pub ttc_s: f64,
}

impl Nearness {
    pub fn new() -> Nearness {
        Nearness { distance_m: f64::INFINITY, ttc_s: f64::INFINITY }
    }

    /// Takes one other road user into account; what circles already rule out is not computed.
    pub fn see(&mut self, ego: &EgoState, position: Vec2, axis: Vec2, velocity: Vec2, size: &Size) {
        let apart = (position - ego.sample.position).norm() - ego.size.radius_m - size.radius_m;
        let closing = (velocity - ego.sample.velocity).norm();
        let (nearer, sooner) = (apart < self.distance_m, apart < self.ttc_s * closing);
        if !nearer && !sooner {
            return;
        }
        let own = ego.size.at(super::body::Place { position: ego.sample.position, axis: ego.axis });
        let other = size.at(super::body::Place { position, axis });
        if nearer {
            self.distance_m = self.distance_m.min(own.distance(&other));
        }
        if sooner && let Some(ttc) = time_to_collision_s(&own, ego.sample.velocity, &other, velocity) {
            self.ttc_s = self.ttc_s.min(ttc);
        }
    }
}

/// What is watched of one adversary.
#[derive(Clone, Debug)]
pub(super) struct Watched {
    actor: ActorRef,
    /// First simulated step of the intervention.
    from_k: usize,
    log: Option<usize>,
    meter: MotionMeter,
    last: Option<Sample>,
    off_road_m_max: f64,
    wrong_way_m: f64,
    pub initial_overlap: bool,
    pub struck_bystander: bool,
    jump_m_max: f64,
    log_deviation_m_max: Option<f64>,
    footprints: Footprints,
    encroachment_steps: usize,
    /// Lane pieces that last held the corners and the centre.
    hints: [u32; 5],
}

impl Watched {
    pub fn new(plant: &Plant, actor: &Actor, intervention: &Intervention) -> Watched {
        let action = actor.action.map(|a| &intervention.actions[a]);
        let from_k = action.map_or(0, first_change).saturating_sub(plant.first_step());
        let log = match action {
            Some(Action::Follow { track, .. } | Action::FollowThenReact { track, .. }) => Some(*track),
            _ => None,
        };
        Watched {
            actor: actor.who,
            from_k,
            log,
            meter: MotionMeter::default(),
            last: None,
            off_road_m_max: 0.0,
            wrong_way_m: 0.0,
            initial_overlap: false,
            struck_bystander: false,
            jump_m_max: 0.0,
            log_deviation_m_max: log.map(|_| 0.0),
            footprints: Footprints::with_room(plant.steps() + 2),
            encroachment_steps: usize::MAX,
            hints: [0; 5],
        }
    }

    pub fn acts_at(&self, k: usize) -> bool {
        k >= self.from_k
    }

    /// Takes the adversary's pose at simulated step `k`; `share` of a step further in the last, broken-off one.
    pub fn observe(&mut self, plant: &Plant, now: Option<&Sample>, axis: Vec2, size: &Size, k: usize, seconds: f64) {
        let Some(now) = now else {
            self.last = None;
            return;
        };
        if !self.acts_at(k) {
            self.last = Some(*now);
            return;
        }
        if let Some(last) = self.last {
            self.meter.seed(&last);
            let explained = (last.velocity + now.velocity) * (0.5 * seconds);
            self.jump_m_max = self.jump_m_max.max((now.position - last.position - explained).norm());
            if plant.drivable.is_wrong_way(now.position, axis, &mut self.hints[4]) {
                self.wrong_way_m += last.position.distance(now.position);
            }
        }
        self.meter.push(now, seconds);
        self.last = Some(*now);
        let place = super::body::Place { position: now.position, axis };
        for (corner, hint) in size.at(place).corners().into_iter().zip(&mut self.hints) {
            let floor_m = self.off_road_m_max + DRIVABLE_TOLERANCE_M;
            let distance_m = plant.drivable.distance_m(corner, floor_m, hint);
            self.off_road_m_max = self.off_road_m_max.max(distance_m - DRIVABLE_TOLERANCE_M);
        }
    }

    /// Compares with its recording at simulated step `k`.
    pub fn compare_with_log(&mut self, plant: &Plant, now: Option<&Sample>, k: usize) {
        let (Some(now), Some(track)) = (now, self.log) else { return };
        if !self.acts_at(k) {
            return;
        }
        if let Some(row) = plant.rows.find(k, track) {
            let off = plant.rows.place(row).position.distance(now.position);
            self.log_deviation_m_max = self.log_deviation_m_max.map(|d| d.max(off));
        }
    }

    pub fn encroach(&mut self, ego: &Footprints, ego_size: &Size, actor: &Actor) {
        let place = actor.now.as_ref().map(|s| super::body::Place { position: s.position, axis: actor.axis });
        self.footprints.push(place);
        encroach(&mut self.encroachment_steps, (ego, ego_size), (&self.footprints, &actor.size));
    }

    /// Whether it overlaps anyone, the ego included, at the first step of the intervention.
    pub fn check_start(&mut self, plant: &Plant, world: &Others, own: usize, k: usize, ego: &contact::Mover<'_>) {
        if k != self.from_k || world.actors[own].now.is_none() {
            return;
        }
        self.initial_overlap = contact::touches(ego, &world.actors[own].mover(), 0).is_some()
            || contact::touches_bystander(plant, world, k, own, 0);
    }

    pub fn post_encroachment_s(&self) -> Option<f64> {
        encroachment_s(self.encroachment_steps)
    }

    pub fn report(&self) -> AdversaryReport {
        AdversaryReport {
            actor: self.actor,
            motion: self.meter.finish(),
            off_road_m_max: self.off_road_m_max,
            wrong_way_m: self.wrong_way_m,
            initial_overlap: self.initial_overlap,
            struck_bystander: self.struck_bystander,
            jump_m_max: self.jump_m_max,
            log_deviation_m_max: self.log_deviation_m_max,
        }
    }
}
