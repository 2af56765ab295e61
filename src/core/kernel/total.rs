//! Total arithmetic, that of expressions and formulas: every result is finite, at most 1e12 in size and never -0.

use super::num;

/// Results are clamped to plus or minus this.
pub const MAGNITUDE_MAX: f64 = 1e12;
/// A denominator with a smaller absolute value is replaced by this, with its sign; zero counts as positive.
pub const DENOMINATOR_MIN: f64 = 1e-9;
/// Least argument of `log`: it gives the log of this for any smaller one, also negative or zero.
pub const LOG_ARGUMENT_MIN: f64 = 1e-12;

/// NaN becomes 0; any other value is clamped to the bound.
pub fn bounded(x: f64) -> f64 {
    if x.is_nan() || x == 0.0 { 0.0 } else { x.clamp(-MAGNITUDE_MAX, MAGNITUDE_MAX) }
}

/// The quotient; see [`DENOMINATOR_MIN`].
pub fn divide(a: f64, b: f64) -> f64 {
    let guarded = if b.abs() >= DENOMINATOR_MIN {
        b
    } else if b < 0.0 {
        -DENOMINATOR_MIN
    } else {
        DENOMINATOR_MIN
    };
    bounded(a / guarded)
}

/// Square root; 0 for a negative argument.
pub fn sqrt(x: f64) -> f64 {
    x.max(0.0).sqrt()
}

/// The exponential, at most the bound.
pub fn exp(x: f64) -> f64 {
    bounded(num::exp(x))
}

/// The natural logarithm; see [`LOG_ARGUMENT_MIN`].
pub fn log(x: f64) -> f64 {
    bounded(num::ln(x.max(LOG_ARGUMENT_MIN)))
}

/// `x` clamped to [low, high]; `high` if low is larger than high.
pub fn clamp(x: f64, low: f64, high: f64) -> f64 {
    x.max(low).min(high)
}
