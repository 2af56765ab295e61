//! Least squares with smoothness: what speed and curvature a list of poses has (nuPlan's `batch_lqr_utils`).
//!
//! The unknowns there are a first value and its changes. Written in the values themselves, the matrices have two bands beside
//! their diagonal, and are solved in one pass.

use super::settings::{STEP_S, STEPS};

/// Weight of a change of the acceleration.
const JERK_WEIGHT: f64 = 1e-4;
/// Weight of a change of the curvature.
const CURVATURE_CHANGE_WEIGHT: f64 = 1e-2;
/// Weight of the first curvature.
const CURVATURE_WEIGHT: f64 = 1e-10;

/// A symmetric matrix with two bands below its diagonal, and the right side.
struct Banded {
    /// `[rows]`: the diagonal, and the entries one and two columns before it.
    rows: [[f64; 3]; STEPS],
    right: [f64; STEPS],
}

impl Banded {
    /// The normal equations of `targets[k] = weights[k] * x[k]`.
    fn of(weights: &[f64; STEPS], targets: &[f64; STEPS]) -> Banded {
        let mut rows = [[0.0; 3]; STEPS];
        let mut right = [0.0; STEPS];
        for k in 0..STEPS {
            rows[k][0] = weights[k] * weights[k];
            right[k] = weights[k] * targets[k];
        }
        Banded { rows, right }
    }

    /// Adds `weight * (sum of parts * x[from ..])²`.
    fn penalise(&mut self, from: usize, parts: &[f64], weight: f64) {
        for (i, a) in parts.iter().enumerate() {
            for (j, b) in parts.iter().enumerate().take(i + 1) {
                self.rows[from + i][i - j] += weight * a * b;
            }
        }
    }

    /// Solves it (LDLᵀ). All fits here are positive definite.
    fn solved(mut self) -> [f64; STEPS] {
        for k in 0..STEPS {
            for back in (1..=2.min(k)).rev() {
                // Row k less what the rows before it hold of its columns.
                let column = k - back;
                if back == 1 && k >= 2 {
                    self.rows[k][1] -= self.rows[k][2] * self.rows[column][1] * self.rows[k - 2][0];
                }
                self.rows[k][back] /= self.rows[column][0];
                self.rows[k][0] -= self.rows[k][back] * self.rows[k][back] * self.rows[column][0];
                self.right[k] -= self.rows[k][back] * self.right[column];
            }
        }
        let mut x = self.right;
        for (value, row) in x.iter_mut().zip(&self.rows) {
            *value /= row[0];
        }
        for k in (0..STEPS).rev() {
            for ahead in 1..=2.min(STEPS - 1 - k) {
                x[k] -= self.rows[k + ahead][ahead] * x[k + ahead];
            }
        }
        x
    }
}

/// Speeds of the steps whose ways along their headings are these, m/s.
pub fn speeds_mps(ways_m: &[f64; STEPS]) -> [f64; STEPS] {
    let mut fit = Banded::of(&[STEP_S; STEPS], ways_m);
    for k in 0..STEPS - 2 {
        // Of accelerations, which are differences of speeds over a step.
        fit.penalise(k, &[1.0, -2.0, 1.0], JERK_WEIGHT / (STEP_S * STEP_S));
    }
    fit.solved()
}

/// Curvatures of the steps with these speeds and turns, 1/m.
pub fn curvatures_1pm(speeds_mps: &[f64; STEPS], turns_rad: &[f64; STEPS]) -> [f64; STEPS] {
    let mut fit = Banded::of(&speeds_mps.map(|speed| STEP_S * speed), turns_rad);
    for k in 0..STEPS - 1 {
        fit.penalise(k, &[-1.0, 1.0], CURVATURE_CHANGE_WEIGHT / (STEP_S * STEP_S));
    }
    fit.penalise(0, &[1.0], CURVATURE_WEIGHT);
    fit.solved()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_of_constant_acceleration_and_curvature_is_found_again() {
        let speeds: [f64; STEPS] = std::array::from_fn(|k| 4.0 + 0.1 * k as f64);
        let found = speeds_mps(&speeds.map(|speed| STEP_S * speed));
        assert!(found.iter().zip(&speeds).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        let bends = curvatures_1pm(&speeds, &speeds.map(|speed| STEP_S * speed * 0.03));
        assert!(bends.iter().all(|bend| (bend - 0.03).abs() < 1e-6), "{bends:?}");
    }

    #[test]
    fn a_band_solves_what_a_full_matrix_solves() {
        let ways: [f64; STEPS] = std::array::from_fn(|k| 0.5 + 0.01 * ((k * k) % 7) as f64);
        let mut full = nalgebra::DMatrix::<f64>::zeros(STEPS, STEPS);
        for k in 0..STEPS {
            full[(k, k)] += STEP_S * STEP_S;
        }
        for k in 0..STEPS - 2 {
            for (i, a) in [1.0, -2.0, 1.0].iter().enumerate() {
                for (j, b) in [1.0, -2.0, 1.0].iter().enumerate() {
                    full[(k + i, k + j)] += JERK_WEIGHT / (STEP_S * STEP_S) * a * b;
                }
            }
        }
        let right = nalgebra::DVector::from_iterator(STEPS, ways.iter().map(|way| STEP_S * way));
        let wanted = full.cholesky().unwrap().solve(&right);
        let found = speeds_mps(&ways);
        assert!(found.iter().zip(wanted.iter()).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}\n{wanted:?}");
    }
}
