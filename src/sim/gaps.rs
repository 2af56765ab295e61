//! How near it came: time to collision of two boxes, and post-encroachment time from remembered footprints.

use crate::kernel::{OrientedBox, Vec2};
use crate::scene::DT_S;

use super::body::{Place, Size};

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
}

impl Footprints {
    pub fn with_room(steps: usize) -> Footprints {
        Footprints { places: Vec::with_capacity(steps) }
    }

    pub fn push(&mut self, place: Option<Place>) {
        self.places.push(place);
    }
}

/// Updates the smallest time between two road users covering one place, after both pushed their newest footprint:
/// the newest of each is held against the remembered ones of the other, nearest in time first.
pub fn encroach(best_steps: &mut usize, a: (&Footprints, &Size), b: (&Footprints, &Size)) {
    let now = a.0.places.len().min(b.0.places.len());
    for lag in 0..now.min(ENCROACHMENT_STEPS + 1) {
        if lag >= *best_steps {
            return;
        }
        let past = now - 1 - lag;
        if meet(a.0.places[now - 1], a.1, b.0.places[past], b.1)
            || meet(a.0.places[past], a.1, b.0.places[now - 1], b.1)
        {
            *best_steps = lag;
            return;
        }
    }
}

/// Decision steps as seconds; `None` if there was no encroachment.
pub fn encroachment_s(best_steps: usize) -> Option<f64> {
    (best_steps <= ENCROACHMENT_STEPS).then_some(best_steps as f64 * DT_S)
}

fn meet(a: Option<Place>, size_a: &Size, b: Option<Place>, size_b: &Size) -> bool {
    let (Some(a), Some(b)) = (a, b) else { return false };
    let reach = size_a.radius_m + size_b.radius_m;
    (b.position - a.position).norm_squared() <= reach * reach && size_a.at(a).overlaps(&size_b.at(b))
}
