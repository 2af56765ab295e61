//! SafeBench's observation of four numbers and its action (`carla_env.py`, `route_planner.py` of trust-ai/SafeBench).

use crate::kernel::num;
use crate::sim::{Control, View};

/// Numbers in the observation.
pub const LENGTH: usize = 4;
/// Distance along the route of the waypoint from which offset and turn are measured, metres.
pub const WAYPOINT_M: f64 = 4.5;
/// Distance ahead below which a vehicle counts as one in front, metres.
const FRONT_M: f64 = 15.0;
/// Acceleration of a full pedal, m/s².
const PEDAL_MPS2: f64 = 3.0;
/// SafeBench's share of CARLA's full steering, which turns the front wheels by 70°.
pub const STEER_SHARE: f64 = 0.3;
const FULL_STEER_RAD: f64 = 70.0 * num::PI / 180.0;
/// CARLA's brake of an action -1, as a deceleration: 3/8 of full brakes of about 0.9 g, m/s².
const BRAKE_MPS2: f64 = 0.375 * 0.9 * 9.81;

/// Writes the distance from the route's line (positive to its left), turn from the route's heading (positive to the left), speed, and
/// 1 if a vehicle is ahead in the ego's lane. SafeBench writes the second number as minus the turn in CARLA's frame, which is
/// left-handed: that is plus in ours.
pub fn observe(view: &View<'_>, out: &mut Vec<f32>) {
    let (offset_m, turn_rad) = beside_waypoint(view);
    let front = view.is_behind_vehicle_in_lane(FRONT_M);
    out.extend([offset_m, turn_rad, view.ego().speed_mps, f64::from(front)].map(|x| x as f32));
}

/// Writes the numbers of `safebench-1`: the turn has the other sign, and the last is 1 if anybody at all is ahead on the route.
pub fn observe_first(view: &View<'_>, out: &mut Vec<f32>) {
    let (offset_m, turn_rad) = beside_waypoint(view);
    let front = view.front().is_some_and(|front| front.gap_m < FRONT_M);
    out.extend([offset_m, -turn_rad, view.ego().speed_mps, f64::from(front)].map(|x| x as f32));
}

/// Returns the offset of the ego from the line through the waypoint, metres, and its turn from that line, radians; both positive left.
fn beside_waypoint(view: &View<'_>) -> (f64, f64) {
    let (ego, route) = (view.ego(), view.route());
    let s_m = ego.along.s_m + WAYPOINT_M;
    let (point, heading_rad) = (route.at(s_m, ego.along.segment), route.heading_at(s_m, ego.along.segment));
    let (sine, cosine) = num::sin_cos(heading_rad);
    let delta = ego.sample.position - point;
    let turn = cosine * ego.axis.y - sine * ego.axis.x;
    (cosine * delta.y - sine * delta.x, num::asin(turn.clamp(-1.0, 1.0)))
}

/// Returns the lowest and highest value of each number: offset and speed have none.
pub fn bounds() -> [(f32, f32); LENGTH] {
    let turn = num::FRAC_PI_2 as f32;
    [(f32::NEG_INFINITY, f32::INFINITY), (-turn, turn), (0.0, f32::INFINITY), (0.0, 1.0)]
}

/// Returns the ego's control for a steering and a pedal, both in [-1, 1].
pub fn control(steering: f64, pedal: f64) -> Control {
    let most_mps2 = if pedal > 0.0 { PEDAL_MPS2 } else { BRAKE_MPS2 };
    Control::Drive { acceleration_mps2: pedal * most_mps2, steering_rad: steering * STEER_SHARE * FULL_STEER_RAD }
}
