//! How near it came: time to collision of two boxes, and post-encroachment time from remembered footprints.

use crate::kernel::{OrientedBox, Vec2};
use crate::scene::DT_S;
use crate::sim::prepared::body::{Place, Size};

/// Footprints farther apart in time than this are no encroachment, decision steps (10 s).
pub const ENCROACHMENT_STEPS: usize = 100;

/// Seconds until two boxes touch if both keep velocity and heading; 0 if they touch now, `None` if they never do.
/// Exact: on each of the four separating axes the time of overlap is one interval.
pub fn time_to_collision_s(a: &OrientedBox, velocity_a: Vec2, b: &OrientedBox, velocity_b: Vec2) -> Option<f64> {
    let delta = b.center - a.center;
    let velocity = velocity_b - velocity_a;
    let along = a.axis.dot(b.axis).abs();
    let across = a.axis.cross(b.axis).abs();
    let reach_a = |l: f64, w: f64| a.half_length_m * l + a.half_width_m * w;
    let reach_b = |l: f64, w: f64| b.half_length_m * l + b.half_width_m * w;
    let axes = [
        (a.axis, a.half_length_m + reach_b(along, across)),
        (a.axis.left(), a.half_width_m + reach_b(across, along)),
        (b.axis, b.half_length_m + reach_a(along, across)),
        (b.axis.left(), b.half_width_m + reach_a(across, along)),
    ];
    let (mut enter, mut leave) = (0.0f64, f64::INFINITY);
    for (axis, reach) in axes {
        let (place, speed) = (delta.dot(axis), velocity.dot(axis));
        if speed.abs() < 1e-12 {
            if place.abs() > reach {
                return None;
            }
            continue;
        }
        let (t0, t1) = ((-reach - place) / speed, (reach - place) / speed);
        enter = enter.max(t0.min(t1));
        leave = leave.min(t0.max(t1));
        if enter > leave {
            return None;
        }
    }
    Some(enter)
}

/// The footprints of one road user over the decision steps.
#[derive(Clone, Debug, Default)]
pub struct Footprints {
    places: Vec<Option<Place>>,
    /// Largest way between two neighbouring footprints, metres; infinite once it was away.
    step_m_max: f64,
}

impl Footprints {
    /// None yet, with room for so many decision steps.
    pub fn with_room(steps: usize) -> Footprints {
        Footprints { places: Vec::with_capacity(steps), step_m_max: 0.0 }
    }

    /// Adds the place at the next decision step; `None` while it is not there.
    pub fn push(&mut self, place: Option<Place>) {
        if let Some(&last) = self.places.last() {
            let step = match (last, place) {
                (Some(a), Some(b)) => a.position.distance(b.position),
                _ => f64::INFINITY,
            };
            self.step_m_max = self.step_m_max.max(step);
        }
        self.places.push(place);
    }
}

/// Updates the smallest time between two road users covering one place, after both pushed their newest footprint:
/// the newest of each is held against the remembered ones of the other, nearest in time first.
pub fn encroach(best_steps: &mut usize, a: (&Footprints, &Size), b: (&Footprints, &Size)) {
    look_back(best_steps, a, b);
    look_back(best_steps, b, a);
}

/// Holds the newest footprint of `a` against the past of `b`.
fn look_back(best_steps: &mut usize, a: (&Footprints, &Size), b: (&Footprints, &Size)) {
    let now = a.0.places.len().min(b.0.places.len());
    let Some(Some(newest)) = a.0.places.get(now.wrapping_sub(1)) else { return };
    let reach = a.1.radius_m + b.1.radius_m;
    let mut lag = 0;
    while lag < now.min(ENCROACHMENT_STEPS + 1).min(*best_steps) {
        let Some(past) = b.0.places[now - 1 - lag] else {
            lag += 1;
            continue;
        };
        let apart = newest.position.distance(past.position) - reach;
        if apart <= 0.0 && a.1.at(*newest).overlaps(&b.1.at(past)) {
            *best_steps = lag;
            return;
        }
        // It cannot have been here for as many steps as its longest step needs to cover the way.
        lag += ((apart / b.0.step_m_max.max(1e-3)) as usize).max(1);
    }
}

/// Decision steps as seconds; `None` if there was no encroachment.
pub fn encroachment_s(best_steps: usize) -> Option<f64> {
    (best_steps <= ENCROACHMENT_STEPS).then_some(best_steps as f64 * DT_S)
}
