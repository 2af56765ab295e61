//! Comfort of a proposal: accelerations, jerks and yaw, smoothed by Savitzky and Golay's polynomials.

use super::settings::{STATES, STEP_S, Settings};
use super::simulated::State;
use crate::kernel::num;

/// Most coefficients of a polynomial here.
const COEFFICIENTS: usize = 4;

/// Savitzky and Golay's smoothing: the polynomial of an order nearest to the values of a window at unit spacing. Its normal equations are the
/// same for all values, so they are eliminated once.
struct Smoothing<const WINDOW: usize> {
    size: usize,
    /// Powers of the places, the middle of the window being 0.
    powers: [[f64; COEFFICIENTS]; WINDOW],
    /// Upper triangle of the matrix. Below the diagonal stand the factors of the Gaussian elimination.
    matrix: [[f64; COEFFICIENTS]; COEFFICIENTS],
}

impl<const WINDOW: usize> Smoothing<WINDOW> {
    fn of(order: usize) -> Smoothing<WINDOW> {
        let size = order + 1;
        let middle = 0.5 * (WINDOW as f64 - 1.0);
        let powers = std::array::from_fn(|k| std::array::from_fn(|i| num::powu(k as f64 - middle, i as u32)));
        let mut matrix = [[0.0; COEFFICIENTS]; COEFFICIENTS];
        for powers in &powers {
            for (i, row) in matrix.iter_mut().enumerate().take(size) {
                for j in 0..size {
                    row[j] += powers[i] * powers[j];
                }
            }
        }
        // The normal matrix of distinct places is positive definite.
        for i in 0..size {
            for k in i + 1..size {
                let share = matrix[k][i] / matrix[i][i];
                let above = matrix[i];
                for (entry, upper) in matrix[k].iter_mut().zip(above).skip(i) {
                    *entry -= share * upper;
                }
                matrix[k][i] = share;
            }
        }
        Smoothing { size, powers, matrix }
    }

    /// Returns the coefficients from the constant on.
    fn polynomial(&self, values: &[f64]) -> [f64; COEFFICIENTS] {
        let mut right = [0.0; COEFFICIENTS];
        for (powers, value) in self.powers.iter().zip(values) {
            for (sum, power) in right.iter_mut().zip(powers).take(self.size) {
                *sum += power * value;
            }
        }
        for i in 0..self.size {
            for k in i + 1..self.size {
                right[k] -= self.matrix[k][i] * right[i];
            }
        }
        let mut coefficients = [0.0; COEFFICIENTS];
        for i in (0..self.size).rev() {
            let known = num::sum((i + 1..self.size).map(|j| self.matrix[i][j] * coefficients[j]));
            coefficients[i] = (right[i] - known) / self.matrix[i][i];
        }
        coefficients
    }

    /// Returns the derivative of a smoothed list, a value each; near the ends the first and the last window's polynomial goes on.
    fn derivative(&self, values: &[f64; STATES], times: u32) -> [f64; STATES] {
        let last = STATES - WINDOW;
        let mut known = (0, self.polynomial(&values[..WINDOW]));
        std::array::from_fn(|k| {
            let from = k.saturating_sub(WINDOW / 2).min(last);
            if known.0 != from {
                known = (from, self.polynomial(&values[from..from + WINDOW]));
            }
            let x = k as f64 - from as f64 - 0.5 * (WINDOW as f64 - 1.0);
            let [a, b, c, d] = known.1;
            let value = match times {
                0 => a + x * (b + x * (c + x * d)),
                1 => b + x * (2.0 * c + x * 3.0 * d),
                _ => 2.0 * c + 6.0 * d * x,
            };
            value / num::powu(STEP_S, times)
        })
    }
}

/// The smoothings of nuPlan's measures of comfort. Where nuPlan smooths twice, over 8 and over all 41 states, this smooths once over all.
pub struct Comfort {
    all: Smoothing<STATES>,
    turn: Smoothing<5>,
    turn_rate: Smoothing<5>,
}

impl Comfort {
    /// Makes the smoothings for any number of proposals.
    pub fn new() -> Comfort {
        Comfort { all: Smoothing::of(2), turn: Smoothing::of(2), turn_rate: Smoothing::of(3) }
    }

    /// Returns `true` if all bounds hold at all states.
    pub fn holds(&self, states: &[State; STATES], wheelbase_m: f64, settings: &Settings) -> bool {
        let yaw_of = |state: &State| state.speed_mps * num::tan(state.steering_rad) / wheelbase_m;
        let along = states.each_ref().map(|state| state.acceleration_mps2);
        let across = states.each_ref().map(|state| state.speed_mps * yaw_of(state));
        let size = states.each_ref().map(|state| {
            let across = state.speed_mps * yaw_of(state);
            (state.acceleration_mps2 * state.acceleration_mps2 + across * across).sqrt()
        });
        let headings = states.each_ref().map(|state| state.heading_rad);
        let all = |values: [f64; STATES], low: f64, high: f64| values.iter().all(|x| *x > low && *x < high);
        let even = |values, high: f64| all(values, -high, high);
        let [low_mps2, high_mps2] = settings.along_mps2;
        all(self.all.derivative(&along, 0), low_mps2, high_mps2)
            && even(self.all.derivative(&across, 0), settings.across_mps2)
            && even(self.all.derivative(&size, 1), settings.jerk_mps3)
            && even(self.all.derivative(&along, 1), settings.jerk_along_mps3)
            && even(self.turn_rate.derivative(&headings, 2), settings.yaw_radps2)
            && even(self.turn.derivative(&headings, 1), settings.yaw_radps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_of_the_order_and_its_derivatives_are_found_again_to_the_ends() {
        let t = |k: usize| STEP_S * k as f64;
        let values: [f64; STATES] = std::array::from_fn(|k| 1.0 + 2.0 * t(k) - 3.0 * t(k) * t(k));
        let comfort = Comfort::new();
        for k in [0, 1, 20, STATES - 1] {
            let wanted = [values[k], 2.0 - 6.0 * t(k), -6.0];
            for found in [
                [0, 1, 2].map(|times| comfort.all.derivative(&values, times)[k]),
                [0, 1, 2].map(|times| comfort.turn.derivative(&values, times)[k]),
                [0, 1, 2].map(|times| comfort.turn_rate.derivative(&values, times)[k]),
            ] {
                assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-8), "{k}: {found:?}");
            }
        }
    }
}
