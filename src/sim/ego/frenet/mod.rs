//! Frenet sampling (Werling et al., ICRA 2010), as CommonRoad's reactive planner does it: manoeuvres to sampled speeds, offsets and end
//! times; of those that the car can drive, it drives the cheapest one that meets nobody. It looks around, as PDM does, but it makes room by
//! metres where PDM waits, and it gives way to others that would drive into its side.
//!
//! `docs/EGOS.md` lists the differences from the source.

mod manoeuvre;
mod settings;
#[cfg(test)]
mod tests;

pub use settings::{PUBLISHED, Settings};

use std::collections::BTreeSet;

use super::pdm;
use super::pdm::centreline::{Centreline, Pose};
use super::pdm::forecast::{self, Other, contact_kind};
use super::pdm::simulated::{Car, State};
use super::pdm::tracker::Tracker;
use crate::kernel::{OrientedBox, num};
use crate::sim::fault::ContactKind;
use crate::sim::{ActorRef, Control, Driver, Plant, View};
use manoeuvre::{Abilities, Manoeuvre, Planned, Reference, Start, stop};
use settings::{STATES, STEP_S};

/// Number of states between two that are looked up on the map.
const ROAD_STEPS: usize = 3;

/// The driver.
pub struct FrenetDriver {
    settings: Settings,
    reference: Option<Reference>,
    /// Road users that the ego overlapped once: they are ignored for ever.
    passed_over: BTreeSet<ActorRef>,
    /// The manoeuvre being driven, and the decision at which it began.
    plan: Option<(usize, [Planned; STATES])>,
}

impl FrenetDriver {
    /// Makes a driver with the published constants, or others.
    pub fn new(settings: Settings) -> FrenetDriver {
        FrenetDriver { settings, reference: None, passed_over: BTreeSet::new(), plan: None }
    }

    /// Returns the cheapest manoeuvre that meets nobody, else full brakes; `None` where the ego stands across the reference.
    fn planned(&mut self, view: &View<'_>, car: &Car, now: &State) -> Option<[Planned; STATES]> {
        let (settings, reference) = (&self.settings, self.reference.as_ref()?);
        let limits = view.plant().limits().at_step(view.decision());
        let curvature_1pm = num::tan(now.steering_rad) / car.wheelbase_m;
        let pose = Pose { position: now.position, heading_rad: now.heading_rad };
        let start = Start::of(reference, pose, [now.speed_mps, now.acceleration_mps2, curvature_1pm])?;
        let able = Abilities {
            engine_mps2: limits.engine_mps2,
            brake_mps2: limits.brake_mps2,
            curvature_1pm: num::tan(limits.steering_rad) / car.wheelbase_m,
        };
        let own = car.footprint(now.position, now.heading_rad);
        let light = pdm::red_light(view);
        let others = forecast::others(view, &own, light, &pdm::PUBLISHED, &mut self.passed_over);
        let aimed_mps = pdm::limit_mps(view, settings.free_speed_mps);
        let beside_m = beside_road_m(view.plant(), &own, f64::INFINITY).max(settings.beside_road_m);
        for (steps, samples) in settings.levels {
            let mut ranked: Vec<(f64, Manoeuvre)> = manoeuvres(&start, now.speed_mps, steps, samples, settings)
                .filter_map(|one| Some((one.cost(reference, aimed_mps, &able, settings)?, one)))
                .collect();
            ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (_, one) in ranked {
                let states = one.states(reference);
                let boxes = states.each_ref().map(|at| car.footprint(at.pose.position, at.pose.heading_rad));
                let on_road = |own: &OrientedBox| beside_road_m(view.plant(), own, beside_m + 0.1) <= beside_m;
                if meets_nobody(&states, &boxes, &others, settings) && boxes.iter().step_by(ROAD_STEPS).all(on_road) {
                    return Some(states);
                }
            }
        }
        Some(stop(reference, &start, limits.brake_mps2))
    }
}

/// Returns all manoeuvres of a level: end times, speeds, offsets, and the present offset.
fn manoeuvres(
    start: &Start,
    speed_mps: f64,
    steps: usize,
    samples: usize,
    settings: &Settings,
) -> impl Iterator<Item = Manoeuvre> {
    let even =
        move |low: f64, high: f64| (0..samples).map(move |k| low + (high - low) * k as f64 / (samples - 1) as f64);
    let slowest_mps = (speed_mps - settings.slower_mps).max(0.0);
    let fastest_mps = (slowest_mps + settings.speeds_mps).max(speed_mps + settings.faster_mps);
    let (start, offset_m, is_slow) = (*start, settings.offset_m, speed_mps < settings.slow_mps);
    let ends = (settings.end_step_min..STATES).step_by(steps);
    ends.flat_map(move |end| {
        even(slowest_mps, fastest_mps).flat_map(move |speed| {
            let offsets = even(-offset_m, offset_m).chain([start.aside[0]]);
            offsets.map(move |offset| Manoeuvre::to(&start, speed, offset, end, is_slow))
        })
    })
}

/// Returns how far the outermost corner is beside the lanes, metres, at most `within_m`.
fn beside_road_m(plant: &Plant, own: &OrientedBox, within_m: f64) -> f64 {
    let lanes = plant.lanes();
    let beside = |corner| {
        if within_m.is_finite() { lanes.off_road_within_m(corner, within_m) } else { lanes.off_road_m(corner) }
    };
    own.corners().into_iter().map(beside).fold(0.0, f64::max)
}

/// Returns `true` if the ego keeps its room to everybody. It ignores others that run into it from behind, or while it stands.
fn meets_nobody(
    states: &[Planned; STATES],
    boxes: &[OrientedBox; STATES],
    others: &[Other],
    settings: &Settings,
) -> bool {
    let wide = |own: &OrientedBox| OrientedBox {
        half_length_m: own.half_length_m + settings.room_m[0],
        half_width_m: own.half_width_m + settings.room_m[1],
        ..*own
    };
    others.iter().all(|other| {
        // A road user that is that near already may be passed as near.
        let is_near = wide(&boxes[0]).overlaps(&other.now);
        let reach_m = wide(&boxes[0]).radius() + other.now.radius();
        for (k, own) in boxes.iter().enumerate().skip(1) {
            let theirs = other.in_s(k as f64 * STEP_S);
            if (theirs.center - own.center).norm_squared() > reach_m * reach_m {
                continue;
            }
            let own = if is_near { *own } else { wide(own) };
            if own.overlaps(&theirs) {
                let kind = contact_kind(&own, states[k].pose.position, states[k].speed_mps, other, &theirs);
                return matches!(kind, ContactKind::EgoStands | ContactKind::Rear);
            }
        }
        true
    })
}

impl Driver for FrenetDriver {
    fn begin(&mut self, plant: &Plant) {
        self.passed_over.clear();
        self.plan = None;
        self.reference = Centreline::of(plant).map(Reference::of);
    }

    fn decide(&mut self, view: &View<'_>) -> Control {
        let (k, ego) = (view.decision(), view.ego());
        let car = Car::of(ego.size);
        let now = car.state(ego);
        if self.plan.is_none_or(|(made, _)| k >= made + self.settings.replan_steps) {
            self.plan = self.planned(view, &car, &now).map(|states| (k, states));
        }
        let Some((made, states)) = &self.plan else {
            return Control::Drive { acceleration_mps2: -view.plant().limits().brake_mps2, steering_rad: 0.0 };
        };
        let passed = k - made;
        let poses = std::array::from_fn(|j| states[passed + j].pose);
        let command = Tracker::of(&poses, car.wheelbase_m).command(0, &now);
        Control::Drive {
            acceleration_mps2: (states[passed + 1].speed_mps - now.speed_mps) / STEP_S,
            steering_rad: now.steering_rad + STEP_S * command.steering_rate_radps,
        }
    }
}
