//! Whether a proposal is comfortable: accelerations, jerks and yaw, smoothed by Savitzky and Golay's polynomials.

use super::settings::{STATES, STEP_S, Settings};
use super::simulated::State;
use crate::kernel::num;

/// Most coefficients of a polynomial here.
const COEFFICIENTS: usize = 4;

/// The polynomial of an order nearest to values at unit spacing, its coefficients from the constant on; the middle of the values is 0.
fn polynomial(values: &[f64], order: usize) -> [f64; COEFFICIENTS] {
    let middle = 0.5 * (values.len() as f64 - 1.0);
    let size = order + 1;
    let mut matrix = [[0.0; COEFFICIENTS + 1]; COEFFICIENTS];
    for (k, value) in values.iter().enumerate() {
        let x = k as f64 - middle;
        let powers: [f64; COEFFICIENTS] = std::array::from_fn(|i| num::powu(x, i as u32));
        for (i, row) in matrix.iter_mut().enumerate().take(size) {
            for j in 0..size {
                row[j] += powers[i] * powers[j];
            }
            row[COEFFICIENTS] += powers[i] * value;
        }
    }
    // Gauss; the normal matrix of distinct places is positive definite.
    for i in 0..size {
        for k in i + 1..size {
            let share = matrix[k][i] / matrix[i][i];
            let above = matrix[i];
            for (entry, upper) in matrix[k].iter_mut().zip(above).skip(i) {
                *entry -= share * upper;
            }
        }
    }
    let mut coefficients = [0.0; COEFFICIENTS];
    for i in (0..size).rev() {
        let known = num::sum((i + 1..size).map(|j| matrix[i][j] * coefficients[j]));
        coefficients[i] = (matrix[i][COEFFICIENTS] - known) / matrix[i][i];
    }
    coefficients
}

/// The derivative of a smoothed list, a value each; near the ends the first and the last window's polynomial goes on. `window` and `order`
/// are Savitzky and Golay's.
fn derivative(values: &[f64; STATES], window: usize, order: usize, times: u32) -> [f64; STATES] {
    let half = window / 2;
    let last = STATES - window;
    let mut out = [0.0; STATES];
    let mut known: Option<(usize, [f64; COEFFICIENTS])> = None;
    for (k, value) in out.iter_mut().enumerate() {
        let from = k.saturating_sub(half).min(last);
        let fit = match known {
            Some((of, fit)) if of == from => fit,
            _ => polynomial(&values[from..from + window], order),
        };
        known = Some((from, fit));
        let x = k as f64 - from as f64 - 0.5 * (window as f64 - 1.0);
        let [_, b, c, d] = fit;
        *value = match times {
            0 => fit[0] + x * (b + x * (c + x * d)),
            1 => b + x * (2.0 * c + x * 3.0 * d),
            _ => 2.0 * c + 6.0 * d * x,
        } / num::powu(STEP_S, times);
    }
    out
}

/// Whether all bounds hold at all states. What nuPlan smooths twice, over 8 and over all 41 states, is smoothed over all here.
pub fn is_comfortable(states: &[State; STATES], wheelbase_m: f64, settings: &Settings) -> bool {
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
    all(derivative(&along, STATES, 2, 0), low_mps2, high_mps2)
        && even(derivative(&across, STATES, 2, 0), settings.across_mps2)
        && even(derivative(&size, STATES, 2, 1), settings.jerk_mps3)
        && even(derivative(&along, STATES, 2, 1), settings.jerk_along_mps3)
        && even(derivative(&headings, 5, 3, 2), settings.yaw_radps2)
        && even(derivative(&headings, 5, 2, 1), settings.yaw_radps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_of_the_order_and_its_derivatives_are_found_again_to_the_ends() {
        let t = |k: usize| STEP_S * k as f64;
        let values: [f64; STATES] = std::array::from_fn(|k| 1.0 + 2.0 * t(k) - 3.0 * t(k) * t(k));
        for window in [5, STATES] {
            for k in [0, 1, 20, STATES - 1] {
                let found = [0, 1, 2].map(|times| derivative(&values, window, 2, times)[k]);
                let wanted = [values[k], 2.0 - 6.0 * t(k), -6.0];
                assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-8), "{window} {k}: {found:?}");
            }
        }
    }
}
