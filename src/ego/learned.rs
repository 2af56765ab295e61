//! A driver with frozen weights: observation, network, action.
//!
//! Observation, [`OBSERVATION`] numbers of size about 1: speed / 20 m/s, acceleration / 10 m/s², steering / 40°,
//! lateral offset / 4 m, share of the route left; the turn of the route relative to the heading / π at 1, 5, 10, 20 m
//! ahead; gap to the road user ahead on the route / 20 m (1 if none) and its closing speed / 20 m/s; red light ahead /
//! 50 m (1 if none); then for each of the [`OTHERS`] nearest road users within 50 m, nearest first, 8 numbers: 1, place
//! ahead / 50 m and left / 50 m, relative velocity ahead / 20 m/s and left / 20 m/s, cosine and sine of its heading
//! against the ego's, radius / 5 m; eight zeros if there are fewer.
//!
//! Action, 2 numbers in [-1, 1]: throttle (full engine to full brake) and steering (full left positive).

use crate::kernel::num;
use crate::sim::{Control, Driver, Plant, Seen, View, idm};

use super::network::Network;

/// Road users in an observation.
pub const OTHERS: usize = 6;
const SELF: usize = 12;
const EACH: usize = 8;
/// Numbers in an observation.
pub const OBSERVATION: usize = SELF + OTHERS * EACH;
/// Numbers in an action.
pub const ACTION: usize = 2;

const SIGHT_M: f64 = 50.0;
const SPEED_MPS: f64 = 20.0;

/// Drives by a network.
#[derive(Clone, Debug)]
pub struct LearnedDriver {
    network: Network,
    values: Vec<f64>,
    spare: Vec<f64>,
}

impl LearnedDriver {
    /// A driver with these frozen weights.
    pub fn new(network: Network) -> LearnedDriver {
        let width = network.width_max();
        LearnedDriver { network, values: vec![0.0; width], spare: vec![0.0; width] }
    }
}

impl Driver for LearnedDriver {
    fn begin(&mut self, _: &Plant) {}

    fn decide(&mut self, view: &View<'_>) -> Control {
        self.values.fill(0.0);
        if let Some(observation) = self.values.first_chunk_mut() {
            observe(view, observation);
        }
        self.network.evaluate(&mut self.values, &mut self.spare);
        let limits = view.plant().limits();
        Control::Drive {
            acceleration_mps2: idm::acceleration_mps2(self.values[0], limits),
            steering_rad: self.values[1] * limits.steering_rad,
        }
    }
}

/// The observation of the network, [`OBSERVATION`] numbers; training uses it too.
pub fn observe(view: &View<'_>, out: &mut [f64; OBSERVATION]) {
    let (ego, route) = (view.ego(), view.route());
    let length_m = route.length_m();
    out[0] = ego.speed_mps / SPEED_MPS;
    out[1] = ego.acceleration_mps2 / 10.0;
    out[2] = ego.steering_rad / view.plant().limits().steering_rad;
    out[3] = ego.along.offset_m / 4.0;
    out[4] = 1.0 - (ego.along.s_m / length_m).clamp(0.0, 1.0);
    for (slot, ahead_m) in out[5..9].iter_mut().zip([1.0, 5.0, 10.0, 20.0]) {
        let heading = route.heading_at(ego.along.s_m + ahead_m, ego.along.segment);
        *slot = num::wrap_angle(heading - ego.sample.heading_rad) / num::PI;
    }
    let front = view.front();
    out[9] = front.map_or(1.0, |f| f.gap_m / idm::SIGHT_M);
    out[10] = front.map_or(0.0, |f| (ego.sample.velocity - f.velocity).dot(ego.axis) / SPEED_MPS);
    out[11] = view.red_light_m().map_or(1.0, |gap_m| (gap_m / SIGHT_M).min(1.0));
    for (seen, slot) in nearest(view).iter().flatten().zip(out[SELF..].chunks_exact_mut(EACH)) {
        let (delta, drift) = (seen.position - ego.sample.position, seen.velocity - ego.sample.velocity);
        slot.copy_from_slice(&[
            1.0,
            delta.dot(ego.axis) / SIGHT_M,
            ego.axis.cross(delta) / SIGHT_M,
            drift.dot(ego.axis) / SPEED_MPS,
            ego.axis.cross(drift) / SPEED_MPS,
            ego.axis.dot(seen.axis),
            ego.axis.cross(seen.axis),
            seen.size.radius_m / 5.0,
        ]);
    }
}

/// The nearest road users, nearest first; if two are equally near, the one seen first.
fn nearest(view: &View<'_>) -> [Option<Seen>; OTHERS] {
    let own = view.ego().sample.position;
    let apart = |seen: &Seen| (seen.position - own).norm_squared();
    let mut found: [Option<Seen>; OTHERS] = [None; OTHERS];
    view.for_each_within(SIGHT_M, |seen| {
        let place = found.iter().position(|f| f.as_ref().is_none_or(|f| apart(seen) < apart(f)));
        if let Some(place) = place {
            found[place..].rotate_right(1);
            found[place] = Some(*seen);
        }
    });
    found
}
