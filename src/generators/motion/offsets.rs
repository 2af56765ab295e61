//! Bounded offsets around a logged path: knots at even spacing, interpolated, scaled until feasible.

use super::Window;
use super::feasibility::{Bounds, LoggedPath};
use crate::kernel::Vec2;
use crate::scene::{DT_S, Sample, Track};

/// Below this speed a log's direction is its heading, m/s.
const MOVING_MPS: f64 = 0.5;
/// Intervals before the window that its first differences reach back to.
const HISTORY: usize = 3;

/// How offsets run between knots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Straight lines between the given offsets.
    Linear,
    /// Uniform Catmull-Rom.
    Cubic,
}

/// A logged path and the offsets that may be added to it.
#[derive(Clone, Debug)]
pub struct OffsetSpace {
    logged: Vec<Sample>,
    /// The log's sample just before the window.
    before: Option<Sample>,
    path: LoggedPath,
    knots: usize,
    /// Weights of the four knots around a step, by the step's position between two knots. `[position][4]`
    weights: Vec<[f64; 4]>,
}

impl OffsetSpace {
    /// Around the track's log in the window, up to where the log has its first gap; `None` for fewer than 10 samples.
    pub fn of_log(
        track: &Track,
        window: Window,
        knot_spacing_s: f64,
        interpolation: Interpolation,
        bounds: Bounds,
    ) -> Option<OffsetSpace> {
        let steps = window.from_step..window.from_step + window.steps;
        let logged: Vec<Sample> = steps.map_while(|step| track.at(step).copied()).collect();
        if logged.len() < 10 {
            return None;
        }
        let mut history: Vec<Sample> = (1..=HISTORY * bounds.interval_steps)
            .map_while(|back| window.from_step.checked_sub(back).and_then(|step| track.at(step)).copied())
            .collect();
        history.reverse();
        let all = || history.iter().chain(&logged);
        let direction = |s: &Sample| {
            let speed = s.speed_mps();
            if speed > MOVING_MPS { s.velocity * (1.0 / speed) } else { Vec2::from_heading(s.heading_rad) }
        };
        let path =
            LoggedPath::new(all().map(|s| s.position).collect(), history.len(), all().map(direction).collect(), bounds);
        let steps_per_knot = (knot_spacing_s / DT_S).round().max(1.0) as usize;
        let knots = logged.len().div_ceil(steps_per_knot).max(2);
        let weights = (0..steps_per_knot).map(|k| weights(interpolation, k as f64 / steps_per_knot as f64)).collect();
        Some(OffsetSpace { before: history.last().copied(), logged, path, knots, weights })
    }

    /// The logged motion that is moved. `[steps]`
    pub fn logged(&self) -> &[Sample] {
        &self.logged
    }

    /// The logged path with its bounds.
    pub fn path(&self) -> &LoggedPath {
        &self.path
    }

    /// Two coordinates for every knot but the first, which stays 0.
    pub fn dimensions(&self) -> usize {
        2 * (self.knots - 1)
    }

    /// Writes the offset of every sample for coordinates in [-1, 1] and gives the feasible scale θ.
    pub fn offsets(&self, place: &[f64], offsets: &mut Vec<Vec2>) -> f64 {
        let bound = self.path.bounds().offset_m_max;
        let knot = |k: usize| match k.min(self.knots - 1) {
            0 => Vec2::ZERO,
            k => Vec2::new(place[2 * k - 2], place[2 * k - 1]) * bound,
        };
        offsets.clear();
        let mut around = [Vec2::ZERO, knot(0), knot(1), knot(2)];
        for (k, steps) in self.logged.chunks(self.weights.len()).enumerate() {
            if k > 0 {
                around = [around[1], around[2], around[3], knot(k + 2)];
            }
            let [a, b, c, d] = around;
            offsets.extend(
                self.weights.iter().take(steps.len()).map(|[wa, wb, wc, wd]| a * *wa + b * *wb + c * *wc + d * *wd),
            );
        }
        self.path.scale(offsets)
    }

    /// Adds to `slope` the gradient at the coordinates, given the gradient at the offset of a sample.
    pub fn pull(&self, step: usize, offset_slope: Vec2, slope: &mut [f64]) {
        let pulled = offset_slope * self.path.bounds().offset_m_max;
        let k = step / self.weights.len();
        let knots = [k.saturating_sub(1), k, k + 1, k + 2];
        for (knot, weight) in knots.into_iter().zip(self.weights[step % self.weights.len()]) {
            // The first knot stays where it is.
            if let Some(place) = (2 * knot.min(self.knots - 1)).checked_sub(2) {
                slope[place] += weight * pulled.x;
                slope[place + 1] += weight * pulled.y;
            }
        }
    }

    /// The path with `theta` times the offsets. Headings turn with the direction of motion where there is any.
    pub fn samples(&self, offsets: &[Vec2], theta: f64) -> Vec<Sample> {
        let place = |k: usize| self.logged[k].position + offsets[k] * theta;
        let count = self.logged.len();
        let velocity = |k: usize| {
            let (from, from_s) = match (k, &self.before) {
                (0, Some(before)) => (before.position, -1.0),
                (0, None) => (place(0), 0.0),
                _ => (place(k - 1), k as f64 - 1.0),
            };
            let to = (k + 1).min(count - 1);
            (place(to) - from) * (1.0 / (DT_S * (to as f64 - from_s)))
        };
        (0..count).map(|k| self.turned(k, place(k), velocity(k), offsets[k] * theta)).collect()
    }

    fn turned(&self, k: usize, position: Vec2, velocity: Vec2, offset: Vec2) -> Sample {
        let log = &self.logged[k];
        if offset == Vec2::ZERO && k == 0 {
            return *log;
        }
        let moving = log.speed_mps() > MOVING_MPS && velocity.norm() > MOVING_MPS;
        let turn = if moving {
            crate::kernel::num::atan2(log.velocity.cross(velocity), log.velocity.dot(velocity))
        } else {
            0.0
        };
        Sample { position, heading_rad: log.heading_rad + turn, velocity }
    }
}

/// Weights of four neighbouring knots at the share `t` of the way from the second to the third.
fn weights(interpolation: Interpolation, t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    match interpolation {
        Interpolation::Linear => [0.0, 1.0 - t, t, 0.0],
        Interpolation::Cubic => [
            0.5 * (2.0 * t2 - t - t3),
            0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
            0.5 * (t + 4.0 * t2 - 3.0 * t3),
            0.5 * (t3 - t2),
        ],
    }
}
