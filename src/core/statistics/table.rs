//! The labelled rows as a regression reads them: standardised columns, and one weight per row.

use crate::kernel::num;

/// A standard deviation below this share of the column's size is rounding, not variation.
const VARIATION_MIN: f64 = 1e-12;

/// Rows of equal length with their weights.
#[derive(Clone, Debug)]
pub struct Table {
    /// Standardised values. `[rows][columns]`
    pub rows: Vec<Vec<f64>>,
    /// Weight of each row, > 0. `[rows]`
    pub weights: Vec<f64>,
    /// Number of columns of a row.
    pub columns: usize,
}

impl Table {
    /// The weighted mean of a target, 0 without rows.
    pub fn mean(&self, target: &[f64]) -> f64 {
        let whole = num::sum(self.weights.iter().copied());
        let sum = num::sum(self.weights.iter().zip(target).map(|(weight, value)| weight * value));
        if whole > 0.0 { sum / whole } else { 0.0 }
    }
}

/// Mean and standard deviation of a column; 0 where it does not vary or is no number that can be worked with.
pub fn moments(rows: &[&[f64]], place: usize) -> (f64, f64) {
    let values: Vec<f64> = rows.iter().map(|row| row.get(place).copied().unwrap_or(0.0)).collect();
    let mean = num::mean(&values).unwrap_or(0.0);
    let variance = num::sum(values.iter().map(|v| (v - mean) * (v - mean))) / values.len().max(1) as f64;
    let (std, size) = (variance.sqrt(), values.iter().fold(0.0, |top: f64, v| top.max(v.abs())));
    if !(mean.is_finite() && std.is_finite()) || std <= VARIATION_MIN * size {
        (if mean.is_finite() { mean } else { 0.0 }, 0.0)
    } else {
        (mean, std)
    }
}

/// A row as the regressions read it: these columns, in units of their deviation, not beyond ten of them.
pub fn standardised(row: &[f64], columns: &[usize], means: &[f64], stds: &[f64]) -> Vec<f64> {
    let scaled = |(k, place): (usize, &usize)| match (row.get(*place), means.get(k), stds.get(k)) {
        (Some(value), Some(mean), Some(std)) if *std > 0.0 => ((value - mean) / std).clamp(-10.0, 10.0),
        _ => 0.0,
    };
    columns.iter().enumerate().map(scaled).collect()
}
