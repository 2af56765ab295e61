//! The kinematic bicycle on (acceleration, yaw rate), forward and backward in time, with limits. The backward step is
//! the exact inverse of the forward one, so a motion may be grown from its end.

use crate::kernel::Vec2;
use crate::scene::Sample;

/// Limits of what a vehicle can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest acceleration and deceleration, m/s².
    pub acceleration_mps2_max: f64,
    /// Largest yaw rate, rad/s.
    pub yaw_rate_radps_max: f64,
    /// Largest lateral acceleration, speed times yaw rate, m/s².
    pub lateral_mps2_max: f64,
    /// Largest speed, m/s.
    pub speed_mps_max: f64,
}

/// One control, held for a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Control {
    /// Change of speed, m/s².
    pub acceleration_mps2: f64,
    /// Change of heading, rad/s; positive to the left.
    pub yaw_rate_radps: f64,
}

/// Place, heading and speed along the heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Centre of the box, metres.
    pub position: Vec2,
    /// Counter-clockwise from +x.
    pub heading_rad: f64,
    /// Along the heading, m/s.
    pub speed_mps: f64,
}

impl State {
    /// The state of a recorded sample.
    pub fn of(sample: &Sample) -> State {
        State { position: sample.position, heading_rad: sample.heading_rad, speed_mps: sample.speed_mps() }
    }

    /// The sample with this state; its velocity lies along the heading.
    pub fn sample(&self) -> Sample {
        let velocity = Vec2::from_heading(self.heading_rad) * self.speed_mps;
        Sample { position: self.position, heading_rad: self.heading_rad, velocity }
    }

    /// The state `dt_s` later: trapezoid in speed, mean heading.
    pub fn forward(&self, control: Control, dt_s: f64) -> State {
        let speed_mps = self.speed_mps + control.acceleration_mps2 * dt_s;
        let heading_rad = self.heading_rad + control.yaw_rate_radps * dt_s;
        let way = 0.5 * (self.speed_mps + speed_mps) * dt_s;
        let direction = Vec2::from_heading(0.5 * (self.heading_rad + heading_rad));
        State { position: self.position + direction * way, heading_rad, speed_mps }
    }

    /// The state `dt_s` earlier that this control leads from.
    pub fn backward(&self, control: Control, dt_s: f64) -> State {
        let speed_mps = self.speed_mps - control.acceleration_mps2 * dt_s;
        let heading_rad = self.heading_rad - control.yaw_rate_radps * dt_s;
        let way = 0.5 * (self.speed_mps + speed_mps) * dt_s;
        let direction = Vec2::from_heading(0.5 * (self.heading_rad + heading_rad));
        State { position: self.position - direction * way, heading_rad, speed_mps }
    }
}

impl Limits {
    /// The nearest control within the limits at a state; braking ends at standstill.
    pub fn clamped(&self, state: &State, control: Control, dt_s: f64) -> Control {
        let a = self.acceleration_mps2_max;
        let slowest = (-state.speed_mps / dt_s).max(-a);
        let fastest = ((self.speed_mps_max - state.speed_mps) / dt_s).min(a).max(slowest);
        let turn = self.yaw_rate_radps_max.min(self.lateral_mps2_max / state.speed_mps.abs().max(1e-3));
        Control {
            acceleration_mps2: control.acceleration_mps2.clamp(slowest, fastest),
            yaw_rate_radps: control.yaw_rate_radps.clamp(-turn, turn),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::num;
    use proptest::prelude::*;

    /// The control that leads from one state to the next one's speed and heading.
    fn control_between(from: &State, to: &State, dt_s: f64) -> Control {
        Control {
            acceleration_mps2: (to.speed_mps - from.speed_mps) / dt_s,
            yaw_rate_radps: num::wrap_angle(to.heading_rad - from.heading_rad) / dt_s,
        }
    }

    proptest! {
        #[test]
        fn a_step_back_undoes_a_step_forward(
            v in 0.0..20.0f64, heading in -3.0..3.0f64, a in -5.0..5.0f64, w in -0.8..0.8f64, dt in 0.05..0.5f64,
        ) {
            let state = State { position: Vec2::new(3.0, -4.0), heading_rad: heading, speed_mps: v };
            let control = Control { acceleration_mps2: a, yaw_rate_radps: w };
            let back = state.forward(control, dt).backward(control, dt);
            prop_assert!(back.position.distance(state.position) < 1e-9);
            prop_assert!((back.speed_mps - v).abs() < 1e-9 && (back.heading_rad - heading).abs() < 1e-9);
            let again = control_between(&state, &state.forward(control, dt), dt);
            prop_assert!((again.acceleration_mps2 - a).abs() < 1e-9 && (again.yaw_rate_radps - w).abs() < 1e-9);
        }

        #[test]
        fn limited_controls_never_drive_backward_or_too_fast(v in 0.0..20.0f64, a in -50.0..50.0f64, w in -9.0..9.0f64) {
            let limits = Limits {
                acceleration_mps2_max: 6.0, yaw_rate_radps_max: 0.9, lateral_mps2_max: 5.0, speed_mps_max: 20.0,
            };
            let state = State { position: Vec2::ZERO, heading_rad: 0.0, speed_mps: v };
            let control = limits.clamped(&state, Control { acceleration_mps2: a, yaw_rate_radps: w }, 0.1);
            let next = state.forward(control, 0.1);
            prop_assert!((-1e-9..=20.0 + 1e-9).contains(&next.speed_mps));
            prop_assert!((v * control.yaw_rate_radps).abs() <= 5.0 + 1e-9);
        }
    }
}
