//! Ridge regression on standardised columns, by Cholesky factorisation of X'WX + λI.
//!
//! Columns and targets are centred, so that the intercept is the target's mean and is not shrunk. A column that never
//! varied has no effect. Sums run in index order.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::kernel::num;
use crate::objects::RidgeLine;
use crate::statistics::table::Table;

/// Smallest accepted ratio of squared diagonal entries of the factor. Below it, X'WX + λI has lost almost all digits of
/// a double.
const CONDITION_MIN: f64 = 1e-12;

/// Lines with what their uncertainty rests on.
pub struct Sure {
    /// One a target.
    pub lines: Vec<RidgeLine>,
    /// (X'WX + λI)⁻¹, row by row.
    pub inverse: Vec<f64>,
}

/// The lines of several targets, from one factorisation. An error says why only means can be fitted.
pub fn fit(table: &Table, targets: &[&[f64]], lambda: f64) -> Result<Vec<RidgeLine>, String> {
    Ok(lines(&factorised(table, lambda)?, table, targets))
}

/// The same with the inverse, from which the standard error of a line at a point follows.
pub fn fit_sure(table: &Table, targets: &[&[f64]], lambda: f64) -> Result<Sure, String> {
    let cholesky = factorised(table, lambda)?;
    // It is symmetric, so that the order of its entries is that of its rows, too.
    let inverse = cholesky.inverse().iter().copied().collect();
    Ok(Sure { lines: lines(&cholesky, table, targets), inverse })
}

fn lines(cholesky: &Cholesky<f64, Dyn>, table: &Table, targets: &[&[f64]]) -> Vec<RidgeLine> {
    let line = |target: &&[f64]| {
        let intercept = table.mean(target);
        let mut moment = DVector::zeros(table.columns);
        for ((row, target), weight) in table.rows.iter().zip(*target).zip(&table.weights) {
            for (i, value) in row.iter().enumerate() {
                moment[i] += weight * value * (target - intercept);
            }
        }
        RidgeLine { intercept, weights: cholesky.solve(&moment).iter().copied().collect() }
    };
    targets.iter().map(line).collect()
}

/// Value of a line at a standardised row.
pub fn value_at(line: &RidgeLine, row: &[f64]) -> f64 {
    line.intercept + num::sum(line.weights.iter().zip(row).map(|(w, x)| w * x))
}

fn factorised(table: &Table, lambda: f64) -> Result<Cholesky<f64, Dyn>, String> {
    // Lower triangle, row by row; columns that do not vary are zero and cost nothing.
    let p = table.columns;
    let mut lower = vec![0.0; p * p];
    for (row, weight) in table.rows.iter().zip(&table.weights) {
        for (i, value) in row.iter().enumerate().filter(|(_, value)| **value != 0.0) {
            let scaled = weight * value;
            lower[i * p..=i * p + i].iter_mut().zip(row).for_each(|(sum, other)| *sum += scaled * other);
        }
    }
    let mut gram = DMatrix::from_fn(p, p, |i, j| lower[i.max(j) * p + i.min(j)]);
    for i in 0..p {
        gram[(i, i)] += lambda;
    }
    let cholesky = Cholesky::new(gram).ok_or("X'X + λI is not positive definite; raise ridge_lambda")?;
    let pivots: Vec<f64> = cholesky.l_dirty().diagonal().iter().map(|d| d * d).collect();
    let (low, high) = pivots.iter().fold((f64::INFINITY, 0.0f64), |(low, high), d| (low.min(*d), high.max(*d)));
    if p > 0 && !(high.is_finite() && low > CONDITION_MIN * high) {
        return Err("X'X + λI is ill-conditioned; raise ridge_lambda".to_string());
    }
    Ok(cholesky)
}
