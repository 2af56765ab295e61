//! Bounded offsets around a logged path: knots at even spacing, interpolated, scaled until feasible.

use super::feasibility::{Bounds, LoggedPath};
use super::stage::Window;
use crate::kernel::Vec2;
use crate::scene::{DT_S, Sample, Track};

/// Below this speed a log's direction is its heading, m/s.
const MOVING_MPS: f64 = 0.5;
/// Samples before the window that its first differences reach back to.
const HISTORY: usize = 3;

/// How offsets run between knots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
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
    steps_per_knot: usize,
    interpolation: Interpolation,
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
        let mut history: Vec<Sample> = (1..=HISTORY)
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
        Some(OffsetSpace { before: history.last().copied(), logged, path, knots, steps_per_knot, interpolation })
    }

    pub fn logged(&self) -> &[Sample] {
        &self.logged
    }

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
        for step in 0..self.logged.len() {
            let k = step / self.steps_per_knot;
            let share = (step % self.steps_per_knot) as f64 / self.steps_per_knot as f64;
            offsets.push(match self.interpolation {
                Interpolation::Linear => knot(k).lerp(knot(k + 1), share),
                Interpolation::Cubic => {
                    catmull_rom([knot(k.saturating_sub(1)), knot(k), knot(k + 1), knot(k + 2)], share)
                }
            });
        }
        self.path.scale(offsets)
    }

    /// Adds to `slope`, at the coordinates, what a slope at the offset of a sample means for them.
    pub fn pull(&self, step: usize, offset_slope: Vec2, slope: &mut [f64]) {
        let pulled = offset_slope * self.path.bounds().offset_m_max;
        let k = step / self.steps_per_knot;
        let t = (step % self.steps_per_knot) as f64 / self.steps_per_knot as f64;
        let weights = match self.interpolation {
            Interpolation::Linear => [(k, 1.0 - t), (k + 1, t), (k, 0.0), (k, 0.0)],
            Interpolation::Cubic => {
                let (t2, t3) = (t * t, t * t * t);
                let knots = [k.saturating_sub(1), k, k + 1, k + 2];
                let shares =
                    [2.0 * t2 - t - t3, 2.0 - 5.0 * t2 + 3.0 * t3, t + 4.0 * t2 - 3.0 * t3, t3 - t2].map(|w| 0.5 * w);
                core::array::from_fn(|i| (knots[i], shares[i]))
            }
        };
        for (knot, weight) in weights {
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

fn catmull_rom([a, b, c, d]: [Vec2; 4], t: f64) -> Vec2 {
    let (t2, t3) = (t * t, t * t * t);
    (b * 2.0 + (c - a) * t + (a * 2.0 - b * 5.0 + c * 4.0 - d) * t2 + (b * 3.0 - a - c * 3.0 + d) * t3) * 0.5
}
