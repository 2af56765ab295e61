//! nuPlan's tracker of a trajectory: a linear-quadratic regulator of the speed, and one of the place beside the trajectory.

use super::centreline::Pose;
use super::fit;
use super::settings::{STATES, STEP_S, STEPS};
use super::simulated::State;
use crate::kernel::num;

/// Steps ahead at which the regulators aim.
const HORIZON: usize = 10;
/// Weight of the speed's error over that of the acceleration: 10 to 1.
const SPEED_SHARE: f64 = 10.0 / 11.0;
/// Weights of the errors beside the trajectory, of the heading and of the steering; that of the steering rate is 1.
const SIDE_WEIGHTS: [f64; 3] = [1.0, 10.0, 0.0];
/// A speed up to which the car is stopped by a plain proportional law, m/s, and its gain, 1/s.
const STOP_MPS: f64 = 0.2;
const STOP_GAIN_1PS: f64 = 0.5;

/// A command of the tracker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Acceleration along the heading, m/s².
    pub acceleration_mps2: f64,
    /// Turning rate of the front wheels, rad/s, positive to the left.
    pub steering_rate_radps: f64,
}

/// A trajectory of the rear axle that is to be tracked, with its speeds and curvatures.
pub struct Tracker<'a> {
    poses: &'a [Pose; STATES],
    speeds_mps: [f64; STEPS],
    curvatures_1pm: [f64; STEPS],
    wheelbase_m: f64,
}

impl Tracker<'_> {
    /// Fits speeds and curvatures to the poses now and after each step.
    pub fn of(poses: &[Pose; STATES], wheelbase_m: f64) -> Tracker<'_> {
        let way = |k: usize| {
            let (sine, cosine) = num::sin_cos(poses[k].heading_rad);
            let by = poses[k + 1].position - poses[k].position;
            by.x * cosine + by.y * sine
        };
        let turn = |k: usize| num::wrap_angle(poses[k + 1].heading_rad - poses[k].heading_rad);
        let speeds_mps = fit::speeds_mps(&std::array::from_fn(way));
        let curvatures_1pm = fit::curvatures_1pm(&speeds_mps, &std::array::from_fn(turn));
        Tracker { poses, speeds_mps, curvatures_1pm, wheelbase_m }
    }

    /// Returns the command at a step in a state.
    pub fn command(&self, step: usize, state: &State) -> Command {
        let aimed_mps = self.speeds_mps[(step + HORIZON).min(STEPS - 1)];
        if state.speed_mps <= STOP_MPS && aimed_mps <= STOP_MPS {
            let acceleration_mps2 = -STOP_GAIN_1PS * (state.speed_mps - aimed_mps);
            return Command { acceleration_mps2, steering_rate_radps: 0.0 };
        }
        let acceleration_mps2 = -SPEED_SHARE * (state.speed_mps - aimed_mps);
        Command { acceleration_mps2, steering_rate_radps: self.steering_rate_radps(step, state, acceleration_mps2) }
    }

    fn steering_rate_radps(&self, step: usize, state: &State, acceleration_mps2: f64) -> f64 {
        let wanted = &self.poses[step];
        let (sine, cosine) = num::sin_cos(wanted.heading_rad);
        let off = state.position - wanted.position;
        // Beside the trajectory, heading against it, steering; and how a steering rate of 1 moves them.
        let mut at = [
            off.y * cosine - off.x * sine,
            num::wrap_angle(state.heading_rad - wanted.heading_rad),
            state.steering_rad,
        ];
        let mut by = [0.0; 3];
        for k in 0..HORIZON {
            let way_m = STEP_S * (state.speed_mps + k as f64 * STEP_S * acceleration_mps2);
            let bend = way_m * self.curvatures_1pm[(step + k).min(STEPS - 1)];
            let moved = |x: &[f64; 3]| [x[0] + way_m * x[1], x[1] + way_m / self.wheelbase_m * x[2], x[2]];
            at = moved(&at);
            at[1] -= bend;
            by = moved(&by);
            by[2] += STEP_S;
        }
        at[1] = num::wrap_angle(at[1]);
        let weighed = |a: &[f64; 3], b: &[f64; 3]| num::sum((0..3).map(|i| SIDE_WEIGHTS[i] * a[i] * b[i]));
        -weighed(&by, &at) / (weighed(&by, &by) + 1.0)
    }
}
