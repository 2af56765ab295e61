//! PDM-Closed (Dauner et al., CoRL 2023; autonomousvision/tuplan_garage): fifteen proposals along the route, each simulated against a
//! forecast of everybody around, scored by nuPlan's measures; the best is driven. It looks around, where IDM looks ahead.
//!
//! `docs/EGOS.md` lists the things that our scenes lack. Kept are the quirks of the original that change decisions: forecasts held over
//! two steps, a leader that is looked for at even steps alone, an emergency brake whose reference may run backwards.

mod areas;
pub(super) mod centreline;
mod comfort;
mod fit;
pub(super) mod forecast;
mod proposals;
mod score;
mod settings;
pub(super) mod simulated;
#[cfg(test)]
mod tests;
pub(super) mod tracker;
pub mod tuning;

pub use settings::{PUBLISHED, Settings};

use std::collections::BTreeSet;

use crate::kernel::Vec2;
use crate::sim::{ActorRef, Control, Driver, Plant, View};
use centreline::{Centreline, Pose, route_lanes};
use comfort::Comfort;
use proposals::Trajectory;
use score::{Judge, Judgement};
use settings::{STATES, STEP_S};
use simulated::{Car, State};
use tracker::Tracker;

/// Largest distance at which the lane with the speed limit is looked for, metres.
const LIMIT_WITHIN_M: f64 = 3.0;

/// Data of a scene that is known before anybody moves.
struct Way {
    paths: [Centreline; 3],
    on_route: Vec<bool>,
}

/// The driver.
pub struct PdmDriver {
    settings: Settings,
    comfort: Comfort,
    way: Option<Way>,
    /// Road users that the ego overlapped once: they are ignored for ever.
    passed_over: BTreeSet<ActorRef>,
}

impl PdmDriver {
    /// Makes a driver with the published constants, or others.
    pub fn new(settings: Settings) -> PdmDriver {
        PdmDriver { settings, comfort: Comfort::new(), way: None, passed_over: BTreeSet::new() }
    }
}

impl Driver for PdmDriver {
    fn begin(&mut self, plant: &Plant) {
        self.passed_over.clear();
        self.way = Centreline::of(plant).map(|centreline| {
            let on_route = route_lanes(plant, &centreline);
            let paths = self.settings.offsets_m.map(|offset_m| centreline.beside(offset_m));
            Way { paths, on_route }
        });
    }

    fn decide(&mut self, view: &View<'_>) -> Control {
        let limit_mps = limit_mps(view, self.settings.free_speed_mps);
        let (settings, ego) = (&self.settings, view.ego());
        let Some(way) = &self.way else {
            // A scene whose route is no line is refused before anybody drives it.
            return Control::Drive { acceleration_mps2: -settings.brake_mps2, steering_rad: 0.0 };
        };
        let car = Car::of(ego.size);
        let now = car.state(ego);
        let own = car.footprint(now.position, now.heading_rad);
        let others = forecast::others(view, &own, red_light(view), settings, &mut self.passed_over);
        let pose = Pose { position: now.position, heading_rad: now.heading_rad };
        let trajectories = proposals::proposals(&way.paths, &car, (&pose, now.speed_mps), &others, limit_mps, settings);
        let simulated: Vec<[State; STATES]> = trajectories.iter().map(|poses| car.simulated(now, poses)).collect();
        let judge = Judge {
            plant: view.plant(),
            on_route: &way.on_route,
            centreline: &way.paths[0],
            car: &car,
            others: &others,
            comfort: &self.comfort,
            settings,
        };
        let judged = judge.judged(&simulated);
        let (best, judgement) = first_best(&judged);
        let trajectory = if is_emergency(judgement, now.speed_mps, settings) {
            emergency(&now, settings)
        } else {
            trajectories[best]
        };
        let command = Tracker::of(&trajectory, car.wheelbase_m).command(0, &now);
        Control::Drive {
            acceleration_mps2: command.acceleration_mps2,
            steering_rad: now.steering_rad + STEP_S * command.steering_rate_radps,
        }
    }
}

/// Returns the speed limit of the ego's lane, else the target speed of the scene, else the given speed, m/s.
pub(super) fn limit_mps(view: &View<'_>, free_speed_mps: f64) -> f64 {
    let (plant, ego) = (view.plant(), view.ego());
    let place = plant.lanes().nearest_lane(ego.sample.position, ego.sample.heading_rad, LIMIT_WITHIN_M);
    let limit = place.and_then(|place| plant.scene().road.lanes[place.lane].speed_limit_mps);
    let known = limit.or(plant.target_speed_mps()).filter(|limit| limit.is_finite() && *limit > 0.0);
    known.unwrap_or(free_speed_mps)
}

/// Returns the stop point of the nearest red light ahead, and the route's heading there.
pub(super) fn red_light(view: &View<'_>) -> Option<(Vec2, f64)> {
    let along = view.ego().along;
    let s_m = along.s_m + view.red_light_m()?;
    Some((view.route().at(s_m, along.segment), view.route().heading_at(s_m, along.segment)))
}

/// Returns the best proposal; of equals the first, which is the slower one on the centreline.
fn first_best(judged: &[Judgement]) -> (usize, &Judgement) {
    let mut best = 0;
    for (k, one) in judged.iter().enumerate() {
        if one.score > judged[best].score {
            best = k;
        }
    }
    (best, &judged[best])
}

fn is_emergency(judgement: &Judgement, speed_mps: f64, settings: &Settings) -> bool {
    judgement.at_fault_s.is_some_and(|at_s| at_s <= settings.emergency_s) && speed_mps <= settings.emergency_mps
}

/// Goes straight on at a speed that full brakes would leave; as published it lies below 0 where the ego is slow.
fn emergency(now: &State, settings: &Settings) -> Trajectory {
    let [low, high] = settings.along_mps2;
    let (speed, acceleration) = (now.speed_mps, now.acceleration_mps2);
    let reference_mps = if speed > 0.2 {
        1.1 * (speed + (-10.0 * speed).clamp(low, high))
    } else {
        (-4.0 * speed - acceleration).clamp(low, high)
    };
    let axis = Vec2::from_heading(now.heading_rad);
    std::array::from_fn(|k| Pose {
        position: now.position + axis * (reference_mps * STEP_S * k as f64),
        heading_rad: now.heading_rad,
    })
}
