//! MetaDrive's `TrajectoryIDMPolicy` on the ego's route: IDM speed (see [`crate::sim::idm`] for its kept quirks) and
//! two PID controllers for steering, smoothed. It never changes lane and heeds no light unless asked to.

use crate::kernel::{Vec2, num};
use crate::sim::bicycle::Car;
use crate::sim::idm::{self, Front, NORMAL_SPEED_KMPH, SIGHT_M};
use crate::sim::{Control, Driver, EgoState, Plant, View};

/// The driver aims at the heading that the route has this far ahead, metres.
const LOOK_AHEAD_M: f64 = 1.0;

/// Share of the way to the wanted steering taken in one decision step (a lag of 0.28 s). MetaDrive's wheels, tyres and
/// suspension put such a lag between steering and yaw; our kinematic car has none, and with it the controllers'
/// derivative gain of 3.5 per step would oscillate above 10 m/s. The sprung car has wheels, tyres and suspension of its own.
const STEERING_SHARE: f64 = 0.3;

/// On a SafeBench route pure pursuit looks as far ahead as the car drives in this time, but at least `PURSUIT_M`
/// metres.
const PURSUIT_S: f64 = 0.6;
const PURSUIT_M: f64 = 4.0;
/// Also on SafeBench routes: number of places ahead that are checked for bends, metres between them, lateral
/// acceleration in bends and braking before them, m/s². The values are those of ordinary driving in town.
const BEND_LOOKS: u32 = 12;
const BEND_SPACING_M: f64 = 2.0;
const BEND_MPS2: f64 = 2.0;
const BEND_BRAKE_MPS2: f64 = 1.5;

/// A discrete controller as MetaDrive writes it: sums and differences per decision step, not per second.
#[derive(Clone, Copy, Debug)]
struct Pid {
    proportional: f64,
    integral: f64,
    derivative: f64,
    sum: f64,
    last: f64,
}

impl Pid {
    const fn new(proportional: f64, integral: f64, derivative: f64) -> Pid {
        Pid { proportional, integral, derivative, sum: 0.0, last: 0.0 }
    }

    fn output(&mut self, error: f64) -> f64 {
        let change = error - self.last;
        self.sum += error;
        self.last = error;
        self.proportional * error + self.integral * self.sum + self.derivative * change
    }
}

/// Drives along the route and follows the road user ahead on it.
#[derive(Clone, Debug)]
pub struct IdmDriver {
    minds_lights: bool,
    heading: Pid,
    lateral: Pid,
}

impl IdmDriver {
    /// `minds_lights`: whether a red light on the route is a standing obstacle at its stop point. MetaDrive's policy
    /// sees lights only as lidar obstacles, and CAT's protocol switches them off (`no_light`), so by default it is not.
    pub fn new(minds_lights: bool) -> IdmDriver {
        IdmDriver { minds_lights, heading: Pid::new(1.2, 0.1, 3.5), lateral: Pid::new(0.3, 0.0, 0.0) }
    }

    fn steering_rad(&mut self, view: &View<'_>, ego: &EgoState) -> f64 {
        if view.plant().is_staged() {
            return pursuit_rad(view, ego);
        }
        let limit_rad = view.plant().limits().steering_rad;
        let lane = view.on_lane();
        let (line, at) = lane.unwrap_or((view.route(), ego.along));
        let heading_rad = line.heading_at(at.s_m + LOOK_AHEAD_M, at.segment);
        let turn = self.heading.output(num::wrap_angle(heading_rad - ego.sample.heading_rad));
        let shift = self.lateral.output(-at.offset_m);
        let wanted_rad = (turn + shift).clamp(-1.0, 1.0) * limit_rad;
        // Wheels, tyres and suspension of a car that has a lane are its own.
        if lane.is_some() { wanted_rad } else { ego.steering_rad + STEERING_SHARE * (wanted_rad - ego.steering_rad) }
    }

    fn front(&self, view: &View<'_>) -> Option<Front> {
        let mut nearest = view.front();
        if self.minds_lights
            && let Some(gap_m) = view.red_light_m()
            && gap_m <= SIGHT_M
            && nearest.is_none_or(|n| gap_m < n.gap_m)
        {
            nearest = Some(Front { gap_m, velocity: Vec2::ZERO });
        }
        nearest
    }
}

/// Steering at a point of the route ahead. In a sharp bend MetaDrive's controllers accumulate an error and then drive
/// beside the route. Logs have no such bends, but SafeBench's junctions do.
fn pursuit_rad(view: &View<'_>, ego: &EgoState) -> f64 {
    let look_m = PURSUIT_M.max(PURSUIT_S * ego.speed_mps);
    let delta = view.route().at(ego.along.s_m + look_m, ego.along.segment) - ego.sample.position;
    let curvature_1pm = 2.0 * ego.axis.cross(delta) / delta.norm_squared().max(1.0);
    Car::new(&ego.sample, 2.0 * ego.size.half_length_m).steering_for(curvature_1pm)
}

/// MetaDrive's normal speed on every road: its policy follows logs, whose paths fit the speed in bends. A SafeBench
/// route is not a log, so there the ego aims at the scene's speed and slows down before bends.
fn free_speed_kmph(view: &View<'_>, ego: &EgoState) -> f64 {
    let (true, Some(target_mps)) = (view.plant().is_staged(), view.plant().target_speed_mps()) else {
        return NORMAL_SPEED_KMPH;
    };
    let route = view.route();
    let mut free_mps = target_mps;
    for k in 0..BEND_LOOKS {
        let ahead_m = BEND_SPACING_M * f64::from(k);
        let s_m = ego.along.s_m + ahead_m;
        let heading = |s_m: f64| route.heading_at(s_m, ego.along.segment);
        let turn = num::wrap_angle(heading(s_m + BEND_SPACING_M) - heading(s_m - BEND_SPACING_M)).abs();
        let curvature_1pm = turn / (2.0 * BEND_SPACING_M);
        let bend_squared = BEND_MPS2 / curvature_1pm.max(1e-3);
        free_mps = free_mps.min((bend_squared + 2.0 * BEND_BRAKE_MPS2 * ahead_m).sqrt());
    }
    3.6 * free_mps
}

impl Driver for IdmDriver {
    fn begin(&mut self, _: &Plant) {
        *self = IdmDriver::new(self.minds_lights);
    }

    fn decide(&mut self, view: &View<'_>) -> Control {
        let ego = *view.ego();
        let front = self.front(view);
        let target_kmph = free_speed_kmph(view, &ego);
        let throttle = idm::throttle(ego.speed_mps, ego.sample.velocity, ego.axis, target_kmph, front.as_ref());
        let limits = view.plant().limits().at_step(view.decision());
        Control::Drive {
            acceleration_mps2: idm::acceleration_mps2(throttle, &limits),
            steering_rad: self.steering_rad(view, &ego),
        }
    }
}
