//! nuPlan's kinematic bicycle, about the rear axle, with the lags of its pedal and its steering.

use super::centreline::Pose;
use super::settings::{STATES, STEP_S};
use super::tracker::{Command, Tracker};
use crate::kernel::{OrientedBox, Vec2, num};
use crate::sim::bicycle::{FRONT_SHARE, REAR_SHARE};
use crate::sim::{EgoState, Size};

/// Time constants of pedal and steering, s.
const PEDAL_LAG_S: f64 = 0.2;
const STEERING_LAG_S: f64 = 0.05;
/// Steering rate at most, rad/s.
const STEERING_RATE_MAX_RADPS: f64 = num::PI / 3.0;

/// The ego at a step of a proposal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Of the rear axle, metres.
    pub position: Vec2,
    /// Radians, not wrapped.
    pub heading_rad: f64,
    /// Of the rear axle along the heading, m/s.
    pub speed_mps: f64,
    /// Along the heading, m/s².
    pub acceleration_mps2: f64,
    /// Of the front wheels, radians.
    pub steering_rad: f64,
    /// Its change, rad/s.
    pub steering_rate_radps: f64,
}

/// The car that is driven: that of our simulator, whose axles are MetaDrive's shares of its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Car {
    /// Metres.
    pub wheelbase_m: f64,
    /// From the rear axle to the middle of the box, metres.
    pub rear_m: f64,
    size: Size,
}

impl Car {
    /// With a box.
    pub fn of(size: Size) -> Car {
        let length_m = 2.0 * size.half_length_m;
        Car { wheelbase_m: (FRONT_SHARE + REAR_SHARE) * length_m, rear_m: REAR_SHARE * length_m, size }
    }

    /// The state of the ego now.
    pub fn state(&self, ego: &EgoState) -> State {
        State {
            position: ego.sample.position - ego.axis * self.rear_m,
            heading_rad: ego.sample.heading_rad,
            speed_mps: ego.sample.velocity.dot(ego.axis).max(0.0),
            acceleration_mps2: ego.acceleration_mps2,
            steering_rad: ego.steering_rad,
            steering_rate_radps: 0.0,
        }
    }

    /// The box of a state.
    pub fn footprint(&self, position: Vec2, heading_rad: f64) -> OrientedBox {
        let axis = Vec2::from_heading(heading_rad);
        let (length_m, width_m) = (2.0 * self.size.half_length_m, 2.0 * self.size.half_width_m);
        OrientedBox::along(position + axis * self.rear_m, axis, length_m, width_m)
    }

    /// Half the length of its box, metres.
    pub fn half_length_m(&self) -> f64 {
        self.size.half_length_m
    }

    /// Half the width of its box, metres.
    pub fn half_width_m(&self) -> f64 {
        self.size.half_width_m
    }

    /// The state a step later.
    fn stepped(&self, state: &State, command: &Command) -> State {
        let pedal = STEP_S / (STEP_S + PEDAL_LAG_S);
        let acceleration_mps2 = state.acceleration_mps2 + pedal * (command.acceleration_mps2 - state.acceleration_mps2);
        // The steering wanted a step from now is reached with a lag.
        let lagged = STEP_S / (STEP_S + STEERING_LAG_S) * command.steering_rate_radps;
        let steering_rate_radps = lagged.clamp(-STEERING_RATE_MAX_RADPS, STEERING_RATE_MAX_RADPS);
        let course = Vec2::from_heading(state.heading_rad);
        State {
            position: state.position + course * (STEP_S * state.speed_mps),
            heading_rad: state.heading_rad + STEP_S * state.speed_mps * num::tan(state.steering_rad) / self.wheelbase_m,
            speed_mps: state.speed_mps + STEP_S * acceleration_mps2,
            acceleration_mps2,
            steering_rad: state.steering_rad + STEP_S * steering_rate_radps,
            steering_rate_radps,
        }
    }

    /// Returns the states of this car when it tracks these poses.
    pub fn simulated(&self, first: State, poses: &[Pose; STATES]) -> [State; STATES] {
        let tracker = Tracker::of(poses, self.wheelbase_m);
        let mut states = [first; STATES];
        for k in 1..STATES {
            states[k] = self.stepped(&states[k - 1], &tracker.command(k - 1, &states[k - 1]));
        }
        states
    }
}
