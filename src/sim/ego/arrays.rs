//! The ego's surroundings as plain arrays, for encoders of one's own: metres, seconds and radians in the ego's frame (x ahead,
//! y to the left), rows of zeros where there is nobody. A row that is there begins with 1.

use std::f32::consts::PI;

use crate::kernel::Vec2;
use crate::sim::{Seen, View};

use super::observation::route_turn_rad;

/// Numbers of the ego: speed, steering of the last decision, change of speed over it, distance from the route (positive to the
/// left), turn from the heading to the route's, route left, metres to a red light on the route (-1 without), length, width.
pub const EGO: usize = 9;
/// Points of the route ahead: x, y.
pub const ROUTE: (usize, usize) = (20, 2);
/// Road users, the nearest first: 1, x, y, velocity x, y, cosine and sine of the heading, length, width, kind (0
/// vehicle, 1 pedestrian, 2 cyclist, 3 static).
pub const NEIGHBOURS: (usize, usize) = (32, 10);
/// Pieces of lanes' centre lines, the nearest first: 1, x and y of the first end, of the second, speed limit (0: not known).
pub const LANES: (usize, usize) = (64, 6);
/// Numbers in all, in this order.
pub const LENGTH: usize = EGO + ROUTE.0 * ROUTE.1 + NEIGHBOURS.0 * NEIGHBOURS.1 + LANES.0 * LANES.1;

/// Distance between points of the route, metres.
const POINT_M: f64 = 2.5;
/// Distance beyond which road users are left out, metres.
const SIGHT_M: f64 = 100.0;
/// Distance beyond which pieces of lanes are left out, by their middle, metres.
const LANE_M: f64 = 60.0;

/// The nearest items, in a buffer of fixed size.
struct Nearest<T, const COUNT: usize> {
    kept: [Option<(f64, T)>; COUNT],
    count: usize,
}

impl<T: Copy, const COUNT: usize> Nearest<T, COUNT> {
    fn new() -> Self {
        Nearest { kept: [None; COUNT], count: 0 }
    }

    /// Adds an item; of two that are equally near the first one comes first.
    fn see(&mut self, squared: f64, what: T) {
        let farther = |of: &Option<(f64, T)>| of.as_ref().is_none_or(|(at, _)| squared < *at);
        if self.count == COUNT && !farther(&self.kept[COUNT - 1]) {
            return;
        }
        let place = self.kept[..self.count].partition_point(|of| !farther(of));
        self.count = (self.count + 1).min(COUNT);
        self.kept[place..self.count].rotate_right(1);
        self.kept[place] = Some((squared, what));
    }
}

/// Writes the arrays to `out`, one behind the other, in place of its contents.
pub fn observe(view: &View<'_>, out: &mut Vec<f32>) {
    out.clear();
    let (ego, route) = (view.ego(), view.route());
    let own = [
        ego.speed_mps,
        ego.steering_rad,
        ego.acceleration_mps2,
        ego.along.offset_m,
        route_turn_rad(view),
        route.length_m() - ego.along.s_m,
        view.red_light_m().unwrap_or(-1.0),
        2.0 * ego.size.half_length_m,
        2.0 * ego.size.half_width_m,
    ];
    out.extend(own.map(|x| x as f32));
    let framed = |delta: Vec2| [ego.axis.dot(delta), ego.axis.cross(delta)];
    let local = |place: Vec2| framed(place - ego.sample.position);
    for point in 1..=ROUTE.0 {
        let s_m = (ego.along.s_m + point as f64 * POINT_M).min(route.length_m());
        out.extend(local(route.at(s_m, ego.along.segment)).map(|x| x as f32));
    }
    let mut seen: Nearest<Seen, { NEIGHBOURS.0 }> = Nearest::new();
    view.for_each_within(SIGHT_M, |other| {
        seen.see((other.position - ego.sample.position).norm_squared(), *other);
    });
    for (_, other) in seen.kept.iter().flatten() {
        let ([x, y], [vx, vy]) = (local(other.position), framed(other.velocity));
        let (cosine, sine) = (ego.axis.dot(other.axis), ego.axis.cross(other.axis));
        let (length_m, width_m) = (2.0 * other.size.half_length_m, 2.0 * other.size.half_width_m);
        let row = [1.0, x, y, vx, vy, cosine, sine, length_m, width_m, f64::from(other.size.kind as u8)];
        out.extend(row.map(|x| x as f32));
    }
    out.resize(EGO + ROUTE.0 * ROUTE.1 + NEIGHBOURS.0 * NEIGHBOURS.1, 0.0);
    lanes(view, &local, out);
    out.resize(LENGTH, 0.0);
}

/// Returns the lowest and highest value of each number.
pub fn bounds() -> Vec<(f32, f32)> {
    let (any, some, unit, flag) = ((f32::NEG_INFINITY, f32::INFINITY), (0.0, f32::INFINITY), (-1.0, 1.0), (0.0, 1.0));
    let ego = [some, any, any, any, (-PI, PI), any, (-1.0, f32::INFINITY), some, some];
    let neighbour = [flag, any, any, any, any, unit, unit, some, some, (0.0, 3.0)];
    let lane = [flag, any, any, any, any, some];
    let mut bounds = ego.to_vec();
    bounds.extend([any; ROUTE.0 * ROUTE.1]);
    bounds.extend(neighbour.repeat(NEIGHBOURS.0));
    bounds.extend(lane.repeat(LANES.0));
    bounds
}

fn lanes(view: &View<'_>, local: &impl Fn(Vec2) -> [f64; 2], out: &mut Vec<f32>) {
    let own = view.ego().sample.position;
    let lanes = &view.plant().scene().road.lanes;
    let mut near: Nearest<(usize, usize), { LANES.0 }> = Nearest::new();
    for (lane, of) in lanes.iter().enumerate() {
        for (piece, ends) in of.centre.windows(2).enumerate() {
            let squared = ((ends[0] + ends[1]) * 0.5 - own).norm_squared();
            if squared <= LANE_M * LANE_M {
                near.see(squared, (lane, piece));
            }
        }
    }
    for (_, (lane, piece)) in near.kept.iter().flatten() {
        let of = &lanes[*lane];
        let ([x, y], [to_x, to_y]) = (local(of.centre[*piece]), local(of.centre[piece + 1]));
        out.extend([1.0, x, y, to_x, to_y, of.speed_limit_mps.unwrap_or(0.0)].map(|x| x as f32));
    }
}
