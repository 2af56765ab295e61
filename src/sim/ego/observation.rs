//! Observations and actions of a learned driver, in the settings of the paper. `docs/EGOS.md` lists every number. A change of
//! any number is another [`Setting`]: weights name the one that they were trained with.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::four_numbers;
use super::nearest::Nearest;
use crate::kernel::{Vec2, num};
use crate::sim::{Control, Seen, View, idm};

/// Meaning of an observation and an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Setting {
    /// MetaDrive's `ScenarioEnv`: ego state, navigation, distances to road edge and road users.
    #[serde(rename = "metadrive-1")]
    Metadrive1,
    /// SafeBench's four numbers, the second with the wrong sign, the fourth for anybody on the route: the weights `sac-safebench`
    /// were trained with these.
    #[serde(rename = "safebench-1")]
    Safebench1,
    /// SafeBench's four numbers.
    #[serde(rename = "safebench-2")]
    Safebench2,
}

/// Numbers in an action: steering and acceleration, both in [-1, 1].
pub const ACTION: usize = 2;

const EGO: usize = 10;
/// Points of the route ahead, metres along it.
const ROUTE_M: [f64; 10] = [2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0];
const EDGE_RAYS: usize = 12;
const LIDAR_RAYS: usize = 24;
/// Number of road users that [`Setting::Metadrive1`] describes one by one.
pub const NEIGHBOURS: usize = 6;
/// Most that [`observe`] describes.
pub const NEIGHBOURS_MAX: usize = 64;
const EACH: usize = 10;

const POINT_M: f64 = 30.0;
const EDGE_M: f64 = 30.0;
const SIGHT_M: f64 = 50.0;
const SPEED_MPS: f64 = 20.0;
/// Largest size of a number: larger ones are cut, so that no odd scene can throw a network far off.
const MOST: f64 = 3.0;

impl Setting {
    /// All settings.
    pub const ALL: [Setting; 3] = [Setting::Metadrive1, Setting::Safebench1, Setting::Safebench2];

    /// Returns the name in weight files and training files.
    pub fn name(self) -> &'static str {
        match self {
            Setting::Metadrive1 => "metadrive-1",
            Setting::Safebench1 => "safebench-1",
            Setting::Safebench2 => "safebench-2",
        }
    }

    /// Returns the number of values in an observation.
    pub fn length(self) -> usize {
        match self {
            Setting::Metadrive1 => length(NEIGHBOURS),
            Setting::Safebench1 | Setting::Safebench2 => four_numbers::LENGTH,
        }
    }

    /// Returns the lowest and highest value of each number.
    pub fn bounds(self) -> Vec<(f32, f32)> {
        match self {
            Setting::Metadrive1 => bounds(NEIGHBOURS),
            Setting::Safebench1 | Setting::Safebench2 => four_numbers::bounds().to_vec(),
        }
    }

    /// Writes the observation to `out`, in place of its contents.
    pub fn observe(self, view: &View<'_>, out: &mut Vec<f32>) {
        out.clear();
        match self {
            Setting::Metadrive1 => observe(view, NEIGHBOURS, out),
            Setting::Safebench1 => four_numbers::observe_first(view, out),
            Setting::Safebench2 => four_numbers::observe(view, out),
        }
    }

    /// Returns the ego's control for an action.
    pub fn control(self, view: &View<'_>, action: [f32; ACTION]) -> Control {
        let [steering, pedal] = action.map(|a| f64::from(a).clamp(-1.0, 1.0));
        match self {
            Setting::Metadrive1 => {
                let limits = view.plant().limits().at_step(view.decision());
                Control::Drive {
                    acceleration_mps2: idm::acceleration_mps2(pedal, &limits),
                    steering_rad: steering * limits.steering_rad,
                }
            }
            Setting::Safebench1 | Setting::Safebench2 => four_numbers::control(steering, pedal),
        }
    }
}

/// Returns how many numbers [`observe`] writes.
pub fn length(neighbours: usize) -> usize {
    EGO + 2 * ROUTE_M.len() + EDGE_RAYS + LIDAR_RAYS + neighbours * EACH
}

/// Returns the bounds of [`observe`], number by number.
pub fn bounds(neighbours: usize) -> Vec<(f32, f32)> {
    let most = MOST as f32;
    let (any, some, unit, share) = ((-most, most), (0.0, most), (-1.0, 1.0), (0.0, 1.0));
    let mut bounds = vec![some, unit, any, any, unit, any, share, share, share, any];
    bounds.extend([any; 2 * ROUTE_M.len()]);
    bounds.extend([share; EDGE_RAYS + LIDAR_RAYS]);
    bounds.extend([share, unit, unit, any, any, unit, unit, some, any, any].repeat(neighbours));
    bounds
}

/// Writes the observation `metadrive-1` to `out`, in place of its contents, with so many road users described one by one:
/// [`NEIGHBOURS`] in the setting, [`NEIGHBOURS_MAX`] at most.
pub fn observe(view: &View<'_>, neighbours: usize, out: &mut Vec<f32>) {
    out.clear();
    let (ego, route) = (view.ego(), view.route());
    let mut push = |x: f64| out.push(x.clamp(-MOST, MOST) as f32);
    let left_m = route.length_m() - ego.along.s_m;
    let front = view.front();
    push(ego.speed_mps / SPEED_MPS);
    push(ego.steering_rad / view.plant().limits().steering_rad);
    push(ego.acceleration_mps2 / 10.0);
    push(ego.along.offset_m / 4.0);
    push(route_turn_rad(view) / num::PI);
    push(left_m / 100.0);
    push(closeness(left_m, POINT_M));
    push(view.red_light_m().map_or(0.0, |gap_m| closeness(gap_m, SIGHT_M)));
    push(front.map_or(0.0, |f| closeness(f.gap_m, idm::SIGHT_M)));
    push(front.map_or(0.0, |f| (ego.sample.velocity - f.velocity).dot(ego.axis) / SPEED_MPS));
    for ahead_m in ROUTE_M {
        // Past its end the route is padded with its end.
        let point = route.at((ego.along.s_m + ahead_m).min(route.length_m()), ego.along.segment);
        let (ahead, left) = in_frame(view, point - ego.sample.position);
        push(ahead / POINT_M);
        push(left / POINT_M);
    }
    let mut edges_m = [0.0; EDGE_RAYS];
    view.road_edges_m(&rays(ego.axis, &EDGE_ANGLES), EDGE_M, &mut edges_m);
    edges_m.iter().for_each(|&edge_m| push(closeness(edge_m, EDGE_M)));
    let mut hits_m = [0.0; LIDAR_RAYS];
    view.lidar_m(&rays(ego.axis, &LIDAR_ANGLES), SIGHT_M, &mut hits_m);
    hits_m.iter().for_each(|&hit_m| push(closeness(hit_m, SIGHT_M)));
    let mut nearest: Nearest<Seen, NEIGHBOURS_MAX> = Nearest::new(neighbours);
    view.for_each_within(SIGHT_M, |seen| nearest.see((seen.position - ego.sample.position).norm_squared(), *seen));
    nearest.iter().for_each(|seen| each(view, seen).into_iter().for_each(&mut push));
    out.resize(length(neighbours), 0.0);
}

/// Returns the numbers of one other road user.
fn each(view: &View<'_>, seen: &Seen) -> [f64; EACH] {
    let ego = view.ego();
    let (ahead, left) = in_frame(view, seen.position - ego.sample.position);
    let (drift_ahead, drift_left) = in_frame(view, seen.velocity - ego.sample.velocity);
    let on_route = view.route().project_near(seen.position, &ego.along, SIGHT_M, SIGHT_M);
    [
        1.0,
        ahead / SIGHT_M,
        left / SIGHT_M,
        drift_ahead / SPEED_MPS,
        drift_left / SPEED_MPS,
        ego.axis.dot(seen.axis),
        ego.axis.cross(seen.axis),
        seen.size.radius_m / 5.0,
        (on_route.s_m - ego.along.s_m) / SIGHT_M,
        on_route.offset_m / 10.0,
    ]
}

/// Returns 1 at the ego, 0 at `reach_m` and beyond: absent things are zero.
fn closeness(at_m: f64, reach_m: f64) -> f64 {
    (1.0 - at_m / reach_m).clamp(0.0, 1.0)
}

/// Returns the turn from the ego's heading to the route's at its place, (-π, π].
pub fn route_turn_rad(view: &View<'_>) -> f64 {
    let ego = view.ego();
    num::wrap_angle(view.route().heading_at(ego.along.s_m, ego.along.segment) - ego.sample.heading_rad)
}

/// Returns a vector in the ego's frame: ahead and to the left.
fn in_frame(view: &View<'_>, delta: Vec2) -> (f64, f64) {
    let axis = view.ego().axis;
    (axis.dot(delta), axis.cross(delta))
}

/// Returns sine and cosine of equal angles, the first 0.
fn angles<const COUNT: usize>() -> [(f64, f64); COUNT] {
    core::array::from_fn(|i| num::sin_cos(num::TAU * i as f64 / COUNT as f64))
}

static EDGE_ANGLES: LazyLock<[(f64, f64); EDGE_RAYS]> = LazyLock::new(angles);
static LIDAR_ANGLES: LazyLock<[(f64, f64); LIDAR_RAYS]> = LazyLock::new(angles);

/// Returns unit vectors at these angles from `axis`, counter-clockwise.
fn rays<const COUNT: usize>(axis: Vec2, angles: &[(f64, f64); COUNT]) -> [Vec2; COUNT] {
    angles.map(|(sine, cosine)| Vec2::new(axis.x * cosine - axis.y * sine, axis.x * sine + axis.y * cosine))
}
