//! The ego's surroundings as plain arrays, for encoders of one's own: metres, seconds and radians in the ego's frame (x ahead,
//! y to the left), rows of zeros where there is nobody. A row that is there begins with 1.

use std::f32::consts::PI;

use crate::kernel::Vec2;
use crate::sim::{Seen, View};

use super::nearest::Nearest;
use super::observation::route_turn_rad;

/// Most road users, and most pieces of lanes.
pub const NEIGHBOURS_MAX: usize = 64;
/// See [`NEIGHBOURS_MAX`].
pub const LANES_MAX: usize = 256;

/// Numbers of the ego: speed, steering of the last decision, change of speed over it, distance from the route (positive to the
/// left), turn from the heading to the route's, route left, metres to a red light on the route (-1 without), length, width.
const EGO: usize = 9;
/// Points of the route ahead: x, y.
const ROUTE: (usize, usize) = (20, 2);
/// Of a road user: 1, x, y, velocity x, y, cosine and sine of the heading, length, width, kind (0 vehicle, 1 pedestrian, 2 cyclist, 3
/// static).
const NEIGHBOUR: usize = 10;
/// Of a piece of a lane's centre line: 1, x and y of the first end, of the second, speed limit (0: not known).
const LANE: usize = 6;
/// Of the route's end: x, y, route left.
const GOAL: usize = 3;

/// Distance between points of the route, metres.
const POINT_M: f64 = 2.5;

/// How much of the surroundings is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrays {
    /// Rows for road users, of which the nearest are shown; [`NEIGHBOURS_MAX`] at most.
    pub neighbours: usize,
    /// Distance beyond which road users are left out, metres.
    pub range_m: f64,
    /// Rows for pieces of lanes, of which the nearest are shown; [`LANES_MAX`] at most.
    pub lanes: usize,
    /// Distance beyond which pieces of lanes are left out, by their middle, metres.
    pub lanes_range_m: f64,
    /// True if the route's end is shown.
    pub goal: bool,
}

impl Default for Arrays {
    fn default() -> Arrays {
        Arrays { neighbours: 32, range_m: 100.0, lanes: 64, lanes_range_m: 60.0, goal: false }
    }
}

impl Arrays {
    /// Returns name, rows (0 of a single one) and numbers a row of each array, in the order in which they are written.
    pub fn parts(&self) -> Vec<(&'static str, usize, usize)> {
        let (near, lanes) = (("neighbours", self.neighbours, NEIGHBOUR), ("lanes", self.lanes, LANE));
        let mut parts = vec![("ego", 0, EGO), ("route", ROUTE.0, ROUTE.1), near, lanes];
        if self.goal {
            parts.push(("goal", 0, GOAL));
        }
        parts
    }

    /// Returns the number of values in all.
    pub fn length(&self) -> usize {
        let goal = if self.goal { GOAL } else { 0 };
        EGO + ROUTE.0 * ROUTE.1 + self.neighbours * NEIGHBOUR + self.lanes * LANE + goal
    }

    /// Returns the lowest and highest value of each number.
    pub fn bounds(&self) -> Vec<(f32, f32)> {
        let (any, some, unit, flag) =
            ((f32::NEG_INFINITY, f32::INFINITY), (0.0, f32::INFINITY), (-1.0, 1.0), (0.0, 1.0));
        let ego = [some, any, any, any, (-PI, PI), any, (-1.0, f32::INFINITY), some, some];
        let neighbour = [flag, any, any, any, any, unit, unit, some, some, (0.0, 3.0)];
        let lane = [flag, any, any, any, any, some];
        let mut bounds = ego.to_vec();
        bounds.extend([any; ROUTE.0 * ROUTE.1]);
        bounds.extend(neighbour.repeat(self.neighbours));
        bounds.extend(lane.repeat(self.lanes));
        bounds.resize(self.length(), any);
        bounds
    }

    /// Writes the arrays to `out`, one behind the other, in place of its contents.
    pub fn observe(&self, view: &View<'_>, out: &mut Vec<f32>) {
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
        let mut seen: Nearest<Seen, NEIGHBOURS_MAX> = Nearest::new(self.neighbours);
        view.for_each_within(self.range_m, |other| {
            seen.see((other.position - ego.sample.position).norm_squared(), *other);
        });
        for other in seen.iter() {
            let ([x, y], [vx, vy]) = (local(other.position), framed(other.velocity));
            let (cosine, sine) = (ego.axis.dot(other.axis), ego.axis.cross(other.axis));
            let (length_m, width_m) = (2.0 * other.size.half_length_m, 2.0 * other.size.half_width_m);
            let row = [1.0, x, y, vx, vy, cosine, sine, length_m, width_m, f64::from(other.size.kind as u8)];
            out.extend(row.map(|x| x as f32));
        }
        out.resize(EGO + ROUTE.0 * ROUTE.1 + self.neighbours * NEIGHBOUR, 0.0);
        self.lanes(view, &local, out);
        out.resize(EGO + ROUTE.0 * ROUTE.1 + self.neighbours * NEIGHBOUR + self.lanes * LANE, 0.0);
        if self.goal {
            let [x, y] = local(route.points()[route.points().len() - 1]);
            out.extend([x, y, route.length_m() - ego.along.s_m].map(|x| x as f32));
        }
    }

    fn lanes(&self, view: &View<'_>, local: &impl Fn(Vec2) -> [f64; 2], out: &mut Vec<f32>) {
        let own = view.ego().sample.position;
        let lanes = &view.plant().scene().road.lanes;
        let mut near: Nearest<(usize, usize), LANES_MAX> = Nearest::new(self.lanes);
        for (lane, of) in lanes.iter().enumerate() {
            for (piece, ends) in of.centre.windows(2).enumerate() {
                let squared = ((ends[0] + ends[1]) * 0.5 - own).norm_squared();
                if squared <= self.lanes_range_m * self.lanes_range_m {
                    near.see(squared, (lane, piece));
                }
            }
        }
        for (lane, piece) in near.iter() {
            let of = &lanes[*lane];
            let ([x, y], [to_x, to_y]) = (local(of.centre[*piece]), local(of.centre[piece + 1]));
            out.extend([1.0, x, y, to_x, to_y, of.speed_limit_mps.unwrap_or(0.0)].map(|x| x as f32));
        }
    }
}
