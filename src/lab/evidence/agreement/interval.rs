//! An interval from draws of scenes.

use serde::Serialize;

/// Draws of scenes behind an interval.
pub const RESAMPLES: usize = 1000;

/// A value with the middle 95 % of what resampled scenes give.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    pub value: f64,
    pub low: f64,
    pub high: f64,
}

/// A value with the middle 95 % of what was drawn.
pub fn middle(value: f64, mut drawn: Vec<f64>) -> Interval {
    drawn.sort_by(f64::total_cmp);
    let at = |share: f64| drawn.get((share * (drawn.len().max(1) - 1) as f64).round() as usize).copied();
    Interval { value, low: at(0.025).unwrap_or(value), high: at(0.975).unwrap_or(value) }
}
