//! Float functions with the same bits on every CPU and build profile.
//!
//! The standard library's transcendental functions call the platform's libm, which picks code by CPU
//! (measured: `sin` differs on 0.064 % of inputs between FMA and non-FMA machines). Everything here goes
//! through the `libm` crate, which is plain Rust. `+ - * / sqrt abs floor ceil round min max` are exact by
//! IEEE 754 and may be used directly; `mul_add` and `powi` may not.

pub use core::f64::consts::{FRAC_PI_2, PI, TAU};

/// Sine of an angle in radians.
pub fn sin(x: f64) -> f64 {
    libm::sin(x)
}

/// Cosine of an angle in radians.
pub fn cos(x: f64) -> f64 {
    libm::cos(x)
}

/// `(sin x, cos x)`.
pub fn sin_cos(x: f64) -> (f64, f64) {
    libm::sincos(x)
}

/// Tangent of an angle in radians.
pub fn tan(x: f64) -> f64 {
    libm::tan(x)
}

/// Arc sine, radians.
pub fn asin(x: f64) -> f64 {
    libm::asin(x)
}

/// Arc cosine, radians.
pub fn acos(x: f64) -> f64 {
    libm::acos(x)
}

/// Arc tangent, radians.
pub fn atan(x: f64) -> f64 {
    libm::atan(x)
}

/// Angle of the point (x, y) from +x, in [-π, π].
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Hyperbolic tangent.
pub fn tanh(x: f64) -> f64 {
    libm::tanh(x)
}

/// `e^x`.
pub fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// Natural logarithm.
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// `base^exponent`.
pub fn pow(base: f64, exponent: f64) -> f64 {
    libm::pow(base, exponent)
}

/// Complementary error function.
pub fn erfc(x: f64) -> f64 {
    libm::erfc(x)
}

/// Natural logarithm of the gamma function, for x above 0.
pub fn ln_gamma(x: f64) -> f64 {
    libm::lgamma(x)
}

/// `sqrt(x² + y²)` without overflow; for lengths of moderate size `Vec2::norm` is cheaper.
pub fn hypot(x: f64, y: f64) -> f64 {
    libm::hypot(x, y)
}

/// Integer power by repeated squaring: a fixed order of multiplications, unlike `f64::powi`.
pub fn powu(base: f64, exponent: u32) -> f64 {
    let (mut result, mut square, mut left) = (1.0, base, exponent);
    while left > 0 {
        if left & 1 == 1 {
            result *= square;
        }
        square *= square;
        left >>= 1;
    }
    result
}

/// Logistic function `1 / (1 + e^-x)`.
pub fn sigmoid(x: f64) -> f64 {
    // Beyond this `e^-x` is less than half of the smallest difference from 1.
    if x > 37.0 {
        return 1.0;
    }
    1.0 / (1.0 + exp(-x))
}

/// An angle brought into (-π, π].
pub fn wrap_angle(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    let turns = ((angle_rad + PI) / TAU).ceil() - 1.0;
    let wrapped = angle_rad - turns * TAU;
    if wrapped <= -PI {
        wrapped + TAU
    } else if wrapped > PI {
        wrapped - TAU
    } else {
        wrapped
    }
}

/// A float fit to be stored: NaN and infinities refused, `-0.0` made `0.0`.
pub fn stored(x: f64) -> Option<f64> {
    x.is_finite().then_some(if x == 0.0 { 0.0 } else { x })
}

/// `x` rounded to `digits` decimals, half away from zero: for values that travel in prompts and patches.
pub fn rounded(x: f64, digits: u32) -> f64 {
    let scale = powu(10.0, digits);
    let value = (x * scale).round() / scale;
    if value == 0.0 { 0.0 } else { value }
}

/// Returns a number as every text prints it: rounded to `digits` decimals by [`rounded`], half away from zero. The formatter of the
/// standard library alone would round the binary number: 0.0375 is stored as a little less, and would be 0.037 in one text
/// and 0.038 in another.
pub fn fixed(x: f64, digits: u32) -> String {
    format!("{:.*}", digits as usize, rounded(x, digits))
}

/// Returns the same with its sign; a zero has none.
pub fn signed(x: f64, digits: u32) -> String {
    let value = rounded(x, digits);
    if value == 0.0 { fixed(value, digits) } else { format!("{value:+.*}", digits as usize) }
}

/// Sum in index order.
pub fn sum(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |total, value| total + value)
}

/// Arithmetic mean in index order; `None` for an empty list.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| sum(values.iter().copied()) / values.len() as f64)
}

/// The `q`-quantile (0..=1) by linear interpolation between order statistics; `None` for an empty list.
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = q.clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let low = place.floor() as usize;
    let high = (low + 1).min(sorted.len() - 1);
    Some(sorted[low] + (sorted[high] - sorted[low]) * (place - low as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sigmoid_that_is_one_is_so_to_the_bit_without_an_exponential() {
        for x in [36.0, 36.5, 37.0, 37.000_000_1, 37.5, 40.0, 700.0, 800.0, f64::INFINITY, f64::NAN, -40.0] {
            assert_eq!(sigmoid(x).to_bits(), (1.0 / (1.0 + exp(-x))).to_bits(), "{x}");
        }
    }

    #[test]
    fn a_printed_number_is_rounded_half_away_from_zero_as_it_is_read() {
        // 3 of 80 and 5 of 80: the first is stored as a little less, the other is exactly half way.
        assert_eq!([3.0 / 80.0, 5.0 / 80.0, -3.0 / 80.0].map(|x| fixed(x, 3)), ["0.038", "0.063", "-0.038"]);
        assert_eq!(format!("{:.3} {:.3}", 3.0 / 80.0, 5.0 / 80.0), "0.037 0.062", "which the standard library prints");
        assert_eq!([signed(3.0 / 80.0, 3), signed(-0.1125, 3), signed(-1e-9, 3)], ["+0.038", "-0.113", "0.000"]);
    }

    #[test]
    fn wrapping_keeps_the_direction_and_lands_in_the_half_open_turn() {
        for k in -40..=40 {
            let angle = f64::from(k) * 0.7;
            let wrapped = wrap_angle(angle);
            assert!(wrapped > -PI - 1e-15 && wrapped <= PI, "{angle} -> {wrapped}");
            assert!((sin(wrapped) - sin(angle)).abs() < 1e-12);
            assert!((cos(wrapped) - cos(angle)).abs() < 1e-12);
        }
        assert_eq!(wrap_angle(PI), PI);
        assert_eq!(wrap_angle(-PI), PI);
    }

    #[test]
    fn the_bits_of_transcendental_functions_are_pinned() {
        let mut state = 0.0;
        for k in 1..=1000 {
            let x = f64::from(k) * 0.37;
            state += sin(x) + cos(x) * exp(-x / 500.0) + atan2(x, 3.0) + pow(x, 0.3);
        }
        assert_eq!(f64::to_bits(state), PINNED, "{state} {:#018x}", state.to_bits());
    }

    // A change of the libm crate or of a wrapper moves this; every golden moves with it.
    const PINNED: u64 = 0x40b7_acb1_a074_7c22;

    #[test]
    fn quantiles_interpolate() {
        assert_eq!(quantile(&[3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(quantile(&[0.0, 10.0], 0.25), Some(2.5));
        assert_eq!(quantile(&[], 0.5), None);
    }
}
