//! Motion statistics built up step by step. Plain finite differences over the true time between samples, no filter:
//! the motion that a trajectory demands is judged as written.
//!
//! Speed is the norm of the velocity. Longitudinal acceleration is its change over time, jerk the change of that,
//! yaw rate the wrapped change of heading, lateral acceleration mean speed times yaw rate.

use crate::kernel::num;
use crate::scene::Sample;

use super::outcome::Motion;

#[derive(Clone, Copy, Debug, Default)]
pub struct MotionMeter {
    last: Option<(Sample, f64)>,
    acceleration_mps2: Option<f64>,
    speed_sum: f64,
    count: usize,
    so_far: Motion,
}

impl MotionMeter {
    /// Sets the sample before the first one: differences start from it, but it does not count itself.
    pub fn seed(&mut self, before: &Sample) {
        if self.count == 0 {
            self.last = Some((*before, before.speed_mps()));
        }
    }

    /// Takes the next sample, `seconds` after the last one.
    pub fn push(&mut self, sample: &Sample, seconds: f64) {
        let speed = sample.speed_mps();
        self.speed_sum += speed;
        self.count += 1;
        self.so_far.speed_mps_max = self.so_far.speed_mps_max.max(speed);
        if let Some((last, last_speed)) = self.last {
            self.difference(&last, last_speed, sample, speed, seconds);
        }
        self.last = Some((*sample, speed));
    }

    fn difference(&mut self, last: &Sample, last_speed: f64, sample: &Sample, speed: f64, seconds: f64) {
        let so_far = &mut self.so_far;
        let acceleration = (speed - last_speed) / seconds;
        so_far.acceleration_mps2_max = so_far.acceleration_mps2_max.max(acceleration);
        so_far.deceleration_mps2_max = so_far.deceleration_mps2_max.max(-acceleration);
        if let Some(before) = self.acceleration_mps2 {
            so_far.jerk_mps3_max = so_far.jerk_mps3_max.max(((acceleration - before) / seconds).abs());
        }
        self.acceleration_mps2 = Some(acceleration);
        let yaw_rate = (num::wrap_angle(sample.heading_rad - last.heading_rad) / seconds).abs();
        so_far.yaw_rate_radps_max = so_far.yaw_rate_radps_max.max(yaw_rate);
        let lateral = 0.5 * (speed + last_speed) * yaw_rate;
        so_far.lateral_acceleration_mps2_max = so_far.lateral_acceleration_mps2_max.max(lateral);
        so_far.distance_m += last.position.distance(sample.position);
    }

    pub fn finish(&self) -> Motion {
        let mean = if self.count > 0 { self.speed_sum / self.count as f64 } else { 0.0 };
        Motion { speed_mps_mean: mean, ..self.so_far }
    }
}
