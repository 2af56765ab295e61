//! Ridge regression on standardised columns, by Cholesky factorisation of X'X + λI, with the leverage of a point.
//!
//! Columns and targets are centred, so that the intercept is the target's mean and is not shrunk. A column that never
//! varied has no effect. Sums run in index order.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::kernel::num;
use crate::objects::{GroupMean, Objectives, RidgeLine, WorldConfiguration, WorldFit};

/// Smallest accepted ratio of squared diagonal entries of the factor. Below it, X'X + λI has lost almost all digits of
/// a double.
const CONDITION_MIN: f64 = 1e-12;
/// A standard deviation below this share of the column's size is rounding, not variation.
const VARIATION_MIN: f64 = 1e-12;

/// Fits attack and realism to rows of features. `None` if there are no rows. If the system is ill-conditioned, only the
/// means are fitted and the reason is kept. `rows` are as long as the schema and finite; `columns` are indices into a
/// row.
pub fn fit_ridge(
    rows: &[&[f64]],
    labels: &[Objectives],
    columns: Vec<usize>,
    configuration: &WorldConfiguration,
) -> Option<WorldFit> {
    let n = rows.len().min(labels.len());
    let attack: Vec<f64> = labels.iter().take(n).map(|o| o.attack).collect();
    let realism: Vec<f64> = labels.iter().take(n).map(|o| o.realism).collect();
    let mean = Objectives { attack: num::mean(&attack)?, realism: num::mean(&realism)? };
    let (column_mean, column_std) = moments(&rows[..n], &columns);
    let mut fit = WorldFit {
        labels: n as u32,
        columns,
        column_mean,
        column_std,
        factor: Vec::new(),
        attack: mean_only(&attack, mean.attack, configuration),
        realism: mean_only(&realism, mean.realism, configuration),
        fallback: None,
        global: GroupMean { labels: n as u32, mean },
        groups: std::collections::BTreeMap::new(),
    };
    let x: Vec<Vec<f64>> = rows[..n].iter().map(|row| standardised(&fit, row)).collect();
    match factorised(&x, fit.columns.len(), configuration.ridge_lambda) {
        Ok(cholesky) => {
            fit.factor = packed(&cholesky);
            let freedom = freedom(&fit.factor, fit.columns.len(), configuration.ridge_lambda);
            fit.attack = line(&cholesky, &x, &attack, mean.attack, freedom, configuration);
            fit.realism = line(&cholesky, &x, &realism, mean.realism, freedom, configuration);
        }
        Err(reason) => fit.fallback = Some(reason),
    }
    Some(fit)
}

/// A row as the regression reads it.
pub(super) fn standardised(fit: &WorldFit, row: &[f64]) -> Vec<f64> {
    let scaled = |(k, place): (usize, &usize)| match (row.get(*place), fit.column_std.get(k)) {
        (Some(value), Some(std)) if *std > 0.0 => (value - fit.column_mean[k]) / std,
        _ => 0.0,
    };
    fit.columns.iter().enumerate().map(scaled).collect()
}

/// Value of a line at a standardised row.
pub(super) fn value_at(line: &RidgeLine, row: &[f64]) -> f64 {
    line.intercept + num::sum(line.weights.iter().zip(row).map(|(w, x)| w * x))
}

/// x'(X'X + λI)^-1 x + 1/n: variance of the fitted mean at a standardised row, in units of the residual variance.
/// Where only means were fitted, distance is measured in the columns' own spread instead.
pub(super) fn leverage(fit: &WorldFit, row: &[f64]) -> f64 {
    let n = f64::from(fit.labels.max(1));
    let spread =
        if fit.factor.is_empty() { num::sum(row.iter().map(|x| x * x)) / n } else { leverage_of(&fit.factor, row) };
    spread + 1.0 / n
}

/// Degrees of freedom that the columns use: tr X(X'X + λI)^-1 X' = p - λ tr (X'X + λI)^-1, which needs no pass over the
/// rows.
fn freedom(factor: &[f64], p: usize, lambda: f64) -> f64 {
    let mut unit = vec![0.0; p];
    let inverse_diagonal = (0..p).map(|i| {
        unit[i] = 1.0;
        let value = leverage_of(factor, &unit);
        unit[i] = 0.0;
        value
    });
    p as f64 - lambda * num::sum(inverse_diagonal)
}

/// |L^-1 x|² by forward substitution on the packed factor.
fn leverage_of(factor: &[f64], row: &[f64]) -> f64 {
    let mut solved: Vec<f64> = Vec::with_capacity(row.len());
    let mut at = 0;
    for (i, x) in row.iter().enumerate() {
        let Some(line) = factor.get(at..at + i + 1) else { break };
        let known = num::sum(line[..i].iter().zip(&solved).map(|(l, z)| l * z));
        solved.push((x - known) / line[i]);
        at += i + 1;
    }
    num::sum(solved.iter().map(|z| z * z))
}

/// Mean and standard deviation of each column; 0 where it does not vary.
fn moments(rows: &[&[f64]], columns: &[usize]) -> (Vec<f64>, Vec<f64>) {
    let of = |place: &usize| {
        let values: Vec<f64> = rows.iter().map(|row| row.get(*place).copied().unwrap_or(0.0)).collect();
        let mean = num::mean(&values).unwrap_or(0.0);
        let variance = num::sum(values.iter().map(|v| (v - mean) * (v - mean))) / values.len().max(1) as f64;
        let (std, size) = (variance.sqrt(), values.iter().fold(0.0, |top: f64, v| top.max(v.abs())));
        if !(mean.is_finite() && std.is_finite()) || std <= VARIATION_MIN * size {
            (if mean.is_finite() { mean } else { 0.0 }, 0.0)
        } else {
            (mean, std)
        }
    };
    columns.iter().map(of).unzip()
}

fn factorised(x: &[Vec<f64>], p: usize, lambda: f64) -> Result<Cholesky<f64, nalgebra::Dyn>, String> {
    // Lower triangle, row by row; columns that do not vary are zero and cost nothing.
    let mut lower = vec![0.0; p * p];
    for row in x {
        for (i, value) in row.iter().enumerate().filter(|(_, value)| **value != 0.0) {
            lower[i * p..=i * p + i].iter_mut().zip(row).for_each(|(sum, other)| *sum += value * other);
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

fn packed(cholesky: &Cholesky<f64, nalgebra::Dyn>) -> Vec<f64> {
    let l = cholesky.l_dirty();
    (0..l.nrows()).flat_map(|i| (0..=i).map(move |j| l[(i, j)])).collect()
}

fn line(
    cholesky: &Cholesky<f64, nalgebra::Dyn>,
    x: &[Vec<f64>],
    y: &[f64],
    mean: f64,
    freedom: f64,
    configuration: &WorldConfiguration,
) -> RidgeLine {
    let p = cholesky.l_dirty().nrows();
    let mut moment = DVector::zeros(p);
    for (row, target) in x.iter().zip(y) {
        for (i, value) in row.iter().enumerate() {
            moment[i] += value * (target - mean);
        }
    }
    let weights: Vec<f64> = cholesky.solve(&moment).iter().copied().collect();
    let mut line = RidgeLine { intercept: mean, weights, residual_std: 0.0 };
    let errors = x.iter().zip(y).map(|(row, target)| target - value_at(&line, row));
    let squares = num::sum(errors.map(|e| e * e));
    line.residual_std = residual_std(squares, y.len() as f64 - 1.0 - freedom, configuration);
    line
}

fn mean_only(y: &[f64], mean: f64, configuration: &WorldConfiguration) -> RidgeLine {
    let squares = num::sum(y.iter().map(|v| (v - mean) * (v - mean)));
    RidgeLine {
        intercept: mean,
        weights: Vec::new(),
        residual_std: residual_std(squares, y.len() as f64 - 1.0, configuration),
    }
}

/// With less than one degree of freedom left the residuals carry no information. The standard deviation of a rate is at
/// most 1/2.
fn residual_std(squares: f64, freedom: f64, configuration: &WorldConfiguration) -> f64 {
    let std = if freedom < 1.0 { 0.5 } else { (squares / freedom).sqrt() };
    std.max(configuration.residual_floor)
}
